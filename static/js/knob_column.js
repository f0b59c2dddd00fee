// The column of knobs: it shows the parameters that act under the present choices, in groups that
// fold and remember it. Those an experiment has set stand together where they would not be in view
// at once.

import { PHONE } from "./sheet.js";
import { storeData, storedData } from "./store.js";

const ROOM = 20; // [px] above and below

export class KnobColumn {
  constructor(lab, knobs) {
    this.tunables = lab.params;
    this.values = knobs.values;
    this.column = document.getElementById("knobs");
    this.gathered = []; // [row, the comment that keeps its place]
    this.box = document.querySelector("#knobs .gathered");
    PHONE.addEventListener("change", () => this.restoreRows());
    this.memory = `folded ${lab.slug}`;
    this.groups = [...document.querySelectorAll("#knobs .group:not(.gathered)")];
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
    const turned = this.tunables.filter((tunable) => findRow(tunable.name).hidden === acts(tunable, this.values));
    for (const { name } of turned) findRow(name).hidden = !findRow(name).hidden;
    this.hideEmpty();
    if (turned.some(({ name }) => findRow(name).classList.contains("set"))) this.reveal();
  }

  hideEmpty() {
    for (const group of this.groups) group.hidden = !group.querySelector(".knob:not([hidden])");
  }

  // Marks the knobs an experiment has set, and brings them into view.
  highlight(names) {
    for (const { name } of this.tunables) findRow(name).classList.toggle("set", names.includes(name));
    if (names.length) this.reveal();
    else this.release();
  }

  reveal() {
    this.restoreRows();
    const set = [...document.querySelectorAll(".knob.set:not([hidden])")]; // as they stand
    for (const row of set) row.closest("details")?.setAttribute("open", "");
    if (set.length > 1 && !PHONE.matches && !this.fits(set)) this.collectRows(set);
    set.at(-1)?.scrollIntoView({ block: "nearest" });
    set[0]?.scrollIntoView({ block: "nearest" });
  }

  // Whether all of these are in view at once, as they stand.
  fits(rows) {
    const span = rows.at(-1).getBoundingClientRect().bottom - rows[0].getBoundingClientRect().top;
    return span < this.column.clientHeight - ROOM;
  }

  collectRows(rows) {
    this.gathered = rows.map((row) => {
      const place = document.createComment("");
      row.replaceWith(place);
      return [row, place];
    });
    this.box.append(...rows);
    this.box.hidden = false;
    this.column.scrollTop = 0;
    this.hideEmpty();
  }

  // Back to their groups, but not out of the hand that has just moved one.
  release() {
    if (!this.box.contains(document.activeElement)) return this.restoreRows();
    this.box.addEventListener("focusout", () => setTimeout(() => {
      if (!document.querySelector(".knob.set")) this.release();
    }), { once: true });
  }

  restoreRows() {
    for (const [row, place] of this.gathered) place.replaceWith(row);
    this.gathered = [];
    this.box.hidden = true;
    this.hideEmpty();
  }
}

// Whether a parameter changes anything under these values: the same as `Params.acts`.
export function acts({ when }, values) {
  if (!when.length) return true;
  return when.some((choices) => Object.entries(choices).every(([name, allowed]) => allowed.includes(values[name])));
}

function findRow(name) {
  return document.getElementById(`param-${name}`);
}
