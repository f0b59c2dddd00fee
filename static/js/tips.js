// Where a symbol that has a slider stands in a formula, pointing at it names it and its value.

import { plain } from "./format.js";
import { place } from "./menus.js";

export function wireTips(lab, valueOf) {
  const tip = document.getElementById("tip");
  const tunables = new Map(lab.params.map((tunable) => [tunable.name, tunable]));

  function show(mark) {
    const { name, label, symbol, help, unit = "", options } = tunables.get(mark.dataset.param);
    const value = valueOf(name);
    const shown = options?.find((option) => option.value === value)?.label ?? (typeof value === "number" ? `${plain(value)} ${unit}` : String(value));
    const bold = document.createElement("b");
    bold.textContent = `${label === symbol ? name : label}: ${shown}`;
    const text = document.createElement("span");
    text.textContent = help;
    tip.replaceChildren(bold, text);
    tip.hidden = false;
    place(tip, mark);
  }

  for (const mark of document.querySelectorAll("[data-param]")) {
    mark.addEventListener("pointerenter", () => show(mark));
    mark.addEventListener("pointerleave", () => (tip.hidden = true));
    mark.addEventListener("focus", () => show(mark));
    mark.addEventListener("blur", () => (tip.hidden = true));
    mark.addEventListener("click", (event) => {
      event.preventDefault();
      tip.hidden = true;
      reveal(mark.dataset.param);
    });
  }
}

// Brings a parameter's row into view, ready to type.
function reveal(name) {
  const field = document.getElementById(`value-${name}`);
  field?.closest("details")?.setAttribute("open", "");
  field?.closest(".knob").scrollIntoView({ block: "nearest", behavior: "smooth" });
  field?.focus({ preventScroll: true });
}
