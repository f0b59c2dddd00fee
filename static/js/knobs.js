// The table "Symbols and sliders": shows every parameter's present value and takes another one.

import { plain } from "./format.js";

const PATIENCE = 700; // [ms] an own change may take to come back before the stream is believed again

export class Knobs {
  constructor(lab, change) {
    this.change = change; // (changes) => Promise, throws the server's sentence
    this.values = {};
    this.rows = new Map();
    for (const tunable of lab.params) {
      const row = document.getElementById(`param-${tunable.name}`);
      if (row) this.rows.set(tunable.name, this.wire(tunable, row));
    }
  }

  wire(tunable, row) {
    const field = row.querySelector(".value :is(input, select, textarea)");
    const wrong = row.querySelector(".wrong");
    const undo = row.querySelector(".undo");
    const entry = { tunable, row, field, wrong, undo, until: 0 };
    field.addEventListener("change", () => this.commit(entry, read(entry)));
    undo.addEventListener("click", () => this.commit(entry, tunable.default));
    if (tunable.kind === "knob") field.addEventListener("focus", () => field.select());
    if (typed(entry)) {
      field.addEventListener("keydown", (event) => this.onKey(event, entry));
    }
    return entry;
  }

  onKey(event, entry) {
    const lines = entry.field.tagName === "TEXTAREA"; // where Enter begins another
    if (event.key === "Enter" && (!lines || event.ctrlKey || event.metaKey)) entry.field.blur();
    if (event.key === "Escape") {
      write(entry, this.values[entry.tunable.name]);
      entry.wrong.hidden = true;
      entry.field.blur();
    }
    const step = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!step || entry.tunable.kind !== "knob") return;
    event.preventDefault();
    const value = stepped(entry.tunable, this.values[entry.tunable.name], step);
    write(entry, value);
    this.commit(entry, value);
  }

  async commit(entry, value) {
    const { tunable, wrong } = entry;
    wrong.hidden = true;
    if (value === this.values[tunable.name]) return write(entry, value);
    entry.until = performance.now() + PATIENCE;
    try {
      await this.change({ [tunable.name]: value });
    } catch (error) {
      entry.until = 0;
      wrong.textContent = error.message;
      wrong.hidden = false;
      // A text that is wrong stays, to be put right; Escape brings the valid one back.
      if (tunable.kind !== "text") write(entry, this.values[tunable.name]);
    }
  }

  // The truth from the server.
  show(params) {
    for (const [name, entry] of this.rows) {
      const value = params[name];
      if (value === undefined) continue;
      const known = this.values[name];
      const own = performance.now() < entry.until;
      const typing = document.activeElement === entry.field && typed(entry);
      if (value === known && !own) continue;
      if (own && value === known) continue;
      this.values[name] = value;
      entry.row.classList.toggle("changed", value !== entry.tunable.default);
      entry.undo.hidden = value === entry.tunable.default;
      if (!typing || own) write(entry, value);
      entry.wrong.hidden = true;
      if (known !== undefined && !own) flash(entry.row);
      entry.until = 0;
    }
  }
}

// What the field says, as the server expects it. Nonsense is sent as it is: the server's sentence
// says what would be allowed.
function read({ tunable, field }) {
  if (tunable.kind === "toggle") return field.checked;
  if (tunable.kind === "choice") return tunable.options[Number(field.value)].value;
  if (tunable.kind === "text") return field.value;
  const text = field.value.trim().replace("−", "-").replace(/^(-?\d+),(\d+)$/, "$1.$2");
  const value = Number(text);
  return text !== "" && Number.isFinite(value) ? value : text;
}

function write({ tunable, field }, value) {
  if (value === undefined) return;
  if (tunable.kind === "toggle") field.checked = value;
  else if (tunable.kind === "choice") field.value = tunable.options.findIndex((option) => option.value === value);
  else if (tunable.kind === "text") field.value = value;
  else field.value = plain(value);
}

// Whether it is a field one types into.
function typed({ tunable }) {
  return tunable.kind === "knob" || tunable.kind === "text";
}

// The value a little further along the slider.
function stepped({ low, high, step, scale }, value, direction) {
  if (scale === "log" && value > 0) {
    const factor = Number((value * 1.1 ** direction).toPrecision(3));
    return Math.min(high, Math.max(low, factor));
  }
  const grain = step || (high - low) / 100;
  return Math.min(high, Math.max(low, Number((value + direction * grain).toPrecision(6))));
}

function flash(row) {
  row.classList.remove("flash");
  void row.offsetWidth; // restarts the animation
  row.classList.add("flash");
}
