// Menus are native popovers; this only puts each beside the button that opens it and closes it after
// a choice.

const GAP = 6;

export function wireMenus() {
  for (const menu of document.querySelectorAll(".menu[popover]")) {
    const buttons = [...document.querySelectorAll(`[popovertarget="${menu.id}"]`)];
    let opener = null; // the button pressed last
    for (const button of buttons) {
      button.setAttribute("aria-expanded", "false");
      button.addEventListener("click", () => {
        if (button !== opener) menu.hidePopover(); // the press opens it again, beside this one
        opener = button;
      });
    }
    menu.addEventListener("toggle", ({ newState }) => {
      const open = newState === "open";
      for (const button of buttons) button.setAttribute("aria-expanded", String(open && button === opener));
      if (open) placeBeside(menu, opener);
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
export function placeBeside(box, anchor) {
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
