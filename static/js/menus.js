// Menus are native popovers; this only puts each beside the button that opens it and closes it after
// a choice.

const GAP = 6;

export function wireMenus() {
  const openers = new Map(); // by the menu's id: the button pressed last
  const opens = "[popovertarget]";
  document.addEventListener("click", ({ target }) => {
    const button = target.closest?.(opens);
    if (button) openers.set(button.getAttribute("popovertarget"), button);
  }, true);
  for (const button of document.querySelectorAll(opens)) button.setAttribute("aria-expanded", "false");
  for (const menu of document.querySelectorAll(".menu[popover]")) {
    menu.addEventListener("toggle", (event) => {
      const button = openers.get(menu.id);
      if (!button) return;
      button.setAttribute("aria-expanded", String(event.newState === "open"));
      if (event.newState === "open") place(menu, button);
    });
    menu.addEventListener("click", (event) => {
      if (menu.classList.contains("list") && event.target.closest("button")) menu.hidePopover();
    });
    menu.addEventListener("keydown", (event) => moveFocus(event, menu));
  }
  addEventListener("resize", () => {
    for (const menu of document.querySelectorAll(".menu:popover-open")) menu.hidePopover();
  });
}

// Below the button, or above where there is no room; never off the screen.
export function place(box, anchor) {
  const at = anchor.getBoundingClientRect();
  const { offsetWidth: width, offsetHeight: height } = box;
  const below = at.bottom + GAP;
  const top = below + height <= innerHeight - GAP ? below : Math.max(GAP, at.top - GAP - height);
  box.style.top = `${top}px`;
  box.style.left = `${Math.max(GAP, Math.min(at.left, innerWidth - width - GAP))}px`;
}

function moveFocus(event, menu) {
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  const items = [...menu.querySelectorAll(":scope > button")];
  if (!step || !items.length) return;
  event.preventDefault();
  const next = items.indexOf(document.activeElement) + step;
  items[(next + items.length) % items.length].focus();
}
