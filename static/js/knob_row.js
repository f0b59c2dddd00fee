// One row of a knob: its name, its track and its value, in the column of knobs or beside a symbol
// of the article. All rows of a parameter go through `Knobs`.

import { plainNumber } from "./format.js";
import { positionOf, stepped, valueAt } from "./scales.js";
import { wireTextFile } from "./text_file.js";

const KEYS = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10 };

export class KnobRow {
  constructor(tunable, element, knobs) {
    this.tunable = tunable;
    this.element = element;
    this.knobs = knobs;
    this.field = element.querySelector(".value");
    this.track = element.querySelector(".track");
    this.wrong = element.querySelector(".wrong");
    this.undo = element.querySelector(".undo");
    this.unit = element.querySelector(".unit");
    this.field.addEventListener("change", () => knobs.commit(tunable.name, this.read(), this));
    this.undo.addEventListener("click", () => knobs.commit(tunable.name, tunable.default, this));
    if (tunable.kind === "knob") this.field.addEventListener("focus", () => this.field.select());
    if (this.typed) this.field.addEventListener("keydown", (event) => this.onKey(event));
    if (this.track) this.wireTrack();
    const take = (text) => {
      this.field.value = text; // what is wrong with it is put right there
      knobs.commit(tunable.name, text, this);
    };
    if (tunable.kind === "text") wireTextFile(element, this.field, take, (sentence) => this.mark(sentence));
  }

  wireTrack() {
    const { tunable, track, knobs } = this;
    const drag = (value) => knobs.drag(tunable.name, value, this);
    track.style.setProperty("--default", positionOf(tunable, tunable.default));
    track.addEventListener("input", () => drag(valueAt(tunable, Number(track.value))));
    track.addEventListener("dblclick", () => drag(tunable.default));
    track.addEventListener("keydown", (event) => {
      const ends = { Home: tunable.low, End: tunable.high };
      const steps = KEYS[event.key];
      if (!steps && !(event.key in ends)) return;
      event.preventDefault();
      drag(ends[event.key] ?? stepped(tunable, knobs.present(tunable.name), steps));
    });
  }

  onKey(event) {
    const { tunable, field, knobs } = this;
    const lines = field.tagName === "TEXTAREA"; // where Enter begins another
    if (event.key === "Enter" && (!lines || event.ctrlKey || event.metaKey)) field.blur();
    if (event.key === "Escape") {
      this.write(knobs.values[tunable.name]);
      this.mark("");
      field.blur();
    }
    const step = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!step || tunable.kind !== "knob") return;
    event.preventDefault();
    const value = stepped(tunable, knobs.values[tunable.name], step);
    this.write(value);
    knobs.commit(tunable.name, value, this);
  }

  // Whether it is a field one types into.
  get typed() {
    return this.tunable.kind === "knob" || this.tunable.kind === "text";
  }

  get typing() {
    return this.typed && document.activeElement === this.field;
  }

  // What the field says, as the server expects it. Nonsense is sent as it is: the server's sentence
  // says what would be allowed.
  read() {
    const { tunable, field } = this;
    if (tunable.kind === "toggle") return field.checked;
    if (tunable.kind === "choice") return tunable.options[Number(field.value)].value;
    if (tunable.kind === "text") return field.value;
    const text = field.value.trim().replace("−", "-").replace(/^(-?\d+),(\d+)$/, "$1.$2");
    const value = Number(text);
    return text !== "" && Number.isFinite(value) ? value : text;
  }

  write(value) {
    const { tunable, field, track } = this;
    if (value === undefined) return;
    if (tunable.kind === "toggle") field.checked = value;
    else if (tunable.kind === "choice") field.value = tunable.options.findIndex((option) => option.value === value);
    else if (tunable.kind === "text") field.value = value;
    else field.value = plainNumber(value);
    if (!track) return;
    const position = positionOf(tunable, value);
    track.value = position;
    track.style.setProperty("--at", position);
    this.showUnit();
  }

  // It may depend on a choice.
  showUnit() {
    const { tunable, unit, track, field } = this;
    if (!track) return;
    unit.textContent = unitUnder(tunable, this.knobs.values);
    track.setAttribute("aria-valuetext", `${field.value} ${unit.textContent}`.trim());
  }

  // How the valid value stands to the default.
  compare(value) {
    this.element.classList.toggle("changed", value !== this.tunable.default);
    this.undo.hidden = value === this.tunable.default;
  }

  // Says what is wrong with a value, or with "" that nothing is.
  mark(message) {
    this.wrong.textContent = message;
    this.wrong.hidden = !message;
    this.field.setAttribute("aria-invalid", String(Boolean(message)));
  }

  flash() {
    this.element.classList.remove("flash");
    void this.element.offsetWidth; // restarts the animation
    this.element.classList.add("flash");
  }
}

// The same as `Knob.unit_under`.
export function unitUnder({ unit, units }, values) {
  const found = Object.entries(units).map(([name, own]) => own[values[name]]);
  return found.find((own) => own !== undefined) ?? unit;
}
