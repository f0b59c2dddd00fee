// Keyboard shortcuts of the lab page. They rest while one types or a dialog is open.

const KEYS = {
  " ": "toggle",
  ".": "step",
  o: "solve",
  i: "iterate",
  r: "reset",
  d: "defaults",
  "+": "faster",
  "=": "faster",
  "-": "slower",
  "−": "slower",
  c: "clear",
  l: "share",
  f: "full",
  v: "view",
  "?": "help",
};

// Inside these a key means something else already.
const TYPING = "input:not([type=radio]):not([type=checkbox]), select, textarea, [contenteditable]";
const PRESSING = "button, summary, a, input";

export function wireKeyboard(actions) {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    if (event.target.matches(TYPING) || document.querySelector("dialog[open], :popover-open")) return;
    if (event.key === " " && event.target.matches(PRESSING)) return;
    const digit = /^[1-9]$/.test(event.key) ? Number(event.key) : 0;
    const name = KEYS[event.key.toLowerCase()];
    if (!digit && !name) return;
    if (event.repeat && name !== "step" && name !== "iterate") return;
    event.preventDefault();
    if (digit) actions.experiment(digit - 1);
    else actions[name]();
  });
}
