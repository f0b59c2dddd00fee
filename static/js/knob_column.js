// The column of knobs: it shows the parameters that act under the present choices, in groups that
// fold and remember it.

import { storeData, storedData } from "./store.js";

export class KnobColumn {
  constructor(lab, knobs) {
    this.tunables = lab.params;
    this.values = knobs.values;
    this.memory = `folded ${lab.slug}`;
    this.groups = [...document.querySelectorAll("#knobs .group")];
    const folded = storedData(this.memory, []);
    for (const group of this.groups) {
      const heading = group.querySelector("summary");
      if (!heading) continue;
      group.open = !folded.includes(heading.textContent);
      // Only what the reader folds is remembered, not what an experiment unfolds.
      heading.addEventListener("click", () => setTimeout(() => this.remember()));
    }
  }

  remember() {
    const folded = this.groups.filter((group) => group.open === false);
    storeData(this.memory, folded.map((group) => group.querySelector("summary").textContent));
  }

  // A parameter that does not act keeps its value, out of sight.
  show() {
    for (const tunable of this.tunables) rowOf(tunable.name).hidden = !acts(tunable, this.values);
    for (const group of this.groups) group.hidden = !group.querySelector(".knob:not([hidden])");
  }

  // Marks the knobs an experiment has set, and brings them into view.
  highlight(names) {
    for (const { name } of this.tunables) rowOf(name).classList.toggle("set", names.includes(name));
    const set = [...document.querySelectorAll(".knob.set:not([hidden])")]; // as they stand
    for (const row of set) row.closest("details")?.setAttribute("open", "");
    set.at(-1)?.scrollIntoView({ block: "nearest" });
    set[0]?.scrollIntoView({ block: "nearest" });
  }
}

// Whether a parameter changes anything under these values: the same as `Params.acts`.
export function acts({ when }, values) {
  if (!when.length) return true;
  return when.some((choices) => Object.entries(choices).every(([name, allowed]) => allowed.includes(values[name])));
}

function rowOf(name) {
  return document.getElementById(`param-${name}`);
}
