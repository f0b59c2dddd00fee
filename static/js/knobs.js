// The page's knobs: every parameter's present value, its track, and the way to another value.

import { plain } from "./format.js";
import { positionOf, stepped, valueAt } from "./scales.js";

const PATIENCE = 700; // [ms] an own change may take to come back before the stream is believed again
const KEYS = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10 };

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
    const field = document.getElementById(`value-${tunable.name}`);
    const track = document.getElementById(`track-${tunable.name}`);
    const wrong = row.querySelector(".wrong");
    const undo = row.querySelector(".undo");
    const entry = { tunable, row, field, track, wrong, undo, until: 0 };
    field.addEventListener("change", () => this.commit(entry, read(entry)));
    undo.addEventListener("click", () => this.commit(entry, tunable.default));
    if (tunable.kind === "knob") field.addEventListener("focus", () => field.select());
    if (typed(entry)) field.addEventListener("keydown", (event) => this.onKey(event, entry));
    if (track) this.wireTrack(entry);
    return entry;
  }

  wireTrack(entry) {
    const { tunable, track } = entry;
    track.style.setProperty("--default", positionOf(tunable, tunable.default));
    track.addEventListener("input", () => this.drag(entry, valueAt(tunable, Number(track.value))));
    track.addEventListener("dblclick", () => this.drag(entry, tunable.default));
    track.addEventListener("keydown", (event) => {
      const ends = { Home: tunable.low, End: tunable.high };
      const steps = KEYS[event.key];
      if (!steps && !(event.key in ends)) return;
      event.preventDefault();
      this.drag(entry, ends[event.key] ?? stepped(tunable, entry.wanted ?? this.values[tunable.name], steps));
    });
  }

  onKey(event, entry) {
    const lines = entry.field.tagName === "TEXTAREA"; // where Enter begins another
    if (event.key === "Enter" && (!lines || event.ctrlKey || event.metaKey)) entry.field.blur();
    if (event.key === "Escape") {
      write(entry, this.values[entry.tunable.name]);
      mark(entry, "");
      entry.field.blur();
    }
    const step = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!step || entry.tunable.kind !== "knob") return;
    event.preventDefault();
    const value = stepped(entry.tunable, this.values[entry.tunable.name], step);
    write(entry, value);
    this.commit(entry, value);
  }

  // While a thumb moves the latest value wins: one change is under way at a time.
  async drag(entry, value) {
    write(entry, value);
    entry.until = performance.now() + PATIENCE;
    const underWay = entry.wanted !== undefined;
    entry.wanted = value;
    if (underWay) return;
    while (entry.wanted !== undefined) {
      const next = entry.wanted;
      await this.commit(entry, next);
      if (entry.wanted === next) entry.wanted = undefined;
    }
  }

  async commit(entry, value) {
    const { tunable } = entry;
    mark(entry, "");
    if (value === this.values[tunable.name]) return write(entry, value);
    entry.until = performance.now() + PATIENCE;
    try {
      await this.change({ [tunable.name]: value });
    } catch (error) {
      entry.until = 0;
      // What is wrong stays, to be put right; Escape brings the valid one back.
      mark(entry, error.message);
    }
  }

  // Marks the knobs an experiment has set, and brings them into view.
  highlight(names) {
    for (const [name, { row }] of this.rows) row.classList.toggle("set", names.includes(name));
    const set = [...document.querySelectorAll(".knob.set")];
    for (const row of set) row.closest("details")?.setAttribute("open", "");
    set.at(-1)?.scrollIntoView({ block: "nearest" });
    set[0]?.scrollIntoView({ block: "nearest" });
  }

  // The truth from the server.
  show(params) {
    for (const [name, entry] of this.rows) {
      const value = params[name];
      if (value === undefined) continue;
      const known = this.values[name];
      const own = performance.now() < entry.until;
      const typing = document.activeElement === entry.field && typed(entry);
      if (value === known) continue;
      this.values[name] = value;
      entry.row.classList.toggle("changed", value !== entry.tunable.default);
      entry.undo.hidden = value === entry.tunable.default;
      if (entry.wanted !== undefined) continue; // the hand is still on it
      if (!typing || own) write(entry, value);
      mark(entry, "");
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

function write({ tunable, field, track }, value) {
  if (value === undefined) return;
  if (tunable.kind === "toggle") field.checked = value;
  else if (tunable.kind === "choice") field.value = tunable.options.findIndex((option) => option.value === value);
  else if (tunable.kind === "text") field.value = value;
  else field.value = plain(value);
  if (!track) return;
  const position = positionOf(tunable, value);
  track.value = position;
  track.style.setProperty("--at", position);
  track.setAttribute("aria-valuetext", `${plain(value)} ${tunable.unit}`.trim());
}

// Says what is wrong with a value, or with "" that nothing is.
function mark({ field, wrong }, message) {
  wrong.textContent = message;
  wrong.hidden = !message;
  field.setAttribute("aria-invalid", String(Boolean(message)));
}

// Whether it is a field one types into.
function typed({ tunable }) {
  return tunable.kind === "knob" || tunable.kind === "text";
}

function flash(row) {
  row.classList.remove("flash");
  void row.offsetWidth; // restarts the animation
  row.classList.add("flash");
}
