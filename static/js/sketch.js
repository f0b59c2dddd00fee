// A curve drawn with the pointer on an empty plot, from left to right, in one stroke or several. Its
// buttons stand in the plot's header, in place of the legend.

import { element } from "./plots/card.js";
import { Chart } from "./plots/chart.js";

const BINS = 120; // places along the time axis
const END_FRACTION = 0.97; // of the axis: lifted there, the sketch is finished

export class Sketch {
  // `done` hears the curve {x [s], y}, or null once it is given up.
  constructor({ section, body, legend }, { range, unit }, seconds, done) {
    this.section = section;
    this.range = range;
    this.unit = unit;
    this.seconds = seconds;
    this.done = done;
    this.y = Array(BINS + 1).fill(null);
    this.pad = body.appendChild(element("div", "sketchpad"));
    this.chart = new Chart(this.pad, () => this.draw());
    this.pad.addEventListener("pointerdown", (event) => this.begin(event));
    this.pad.addEventListener("pointermove", (event) => this.move(event));
    this.pad.addEventListener("pointerup", () => this.endStroke());
    this.pad.addEventListener("pointercancel", () => (this.last = null));
    this.controls = this.buttons();
    this.legend = legend;
    legend.replaceWith(this.controls);
    section.classList.add("sketched");
    this.onKey = (event) => event.key === "Escape" && this.done(null);
    addEventListener("keydown", this.onKey);
  }

  buttons() {
    const controls = element("div", "sketch-buttons");
    const button = (text, action) => {
      const made = controls.appendChild(element("button", "small", text));
      made.type = "button";
      made.addEventListener("click", action);
      return made;
    };
    this.finish = button("Done", () => this.done(this.curve()));
    button("Again", () => this.clear());
    button("Cancel", () => this.done(null));
    this.finish.disabled = true;
    return controls;
  }

  remove() {
    removeEventListener("keydown", this.onKey);
    this.pad.remove();
    this.controls.replaceWith(this.legend);
    this.section.classList.remove("sketched");
  }

  clear() {
    this.y.fill(null);
    this.finish.disabled = true;
    this.draw();
  }

  begin(event) {
    event.preventDefault();
    this.pad.setPointerCapture(event.pointerId);
    this.last = null;
    this.move(event, true);
  }

  move(event, down = false) {
    if (!down && !this.last) return;
    const box = this.pad.getBoundingClientRect();
    const { left, top, width, height } = this.chart.area;
    const part = Math.min(1, Math.max(0, (event.clientX - box.left - left) / width));
    const depth = Math.min(1, Math.max(0, (event.clientY - box.top - top) / height));
    const [low, high] = this.range;
    const [bin, y] = [Math.round(part * BINS), high - depth * (high - low)];
    const [from, start] = this.last ?? [bin, y];
    for (let i = Math.min(from, bin); i <= Math.max(from, bin); i++) {
      this.y[i] = from === bin ? y : start + ((i - from) / (bin - from)) * (y - start);
    }
    this.last = [bin, y];
    this.finish.disabled = this.curve() === null;
    this.draw();
  }

  endStroke() {
    const at = this.last?.[0] ?? 0;
    this.last = null;
    if (at >= END_FRACTION * BINS && this.curve()) this.done(this.curve());
  }

  // The curve so far, gaps bridged; null while there is nothing to compare.
  curve() {
    const known = this.y.map((y, i) => [i, y]).filter(([, y]) => y !== null);
    if (known.length < BINS / 10) return null;
    return { x: known.map(([i]) => (i / BINS) * this.seconds), y: known.map(([, y]) => y) };
  }

  draw() {
    if (!this.pad.clientWidth) return;
    this.chart.begin([0, this.seconds], this.range, { xLabel: "t [s]", yLabel: this.unit });
    const { left, top, width, height } = this.chart.area;
    const empty = this.y.every((y) => y === null);
    if (empty) this.chart.text(left + width / 2, top + 0.3 * height, "Draw here, to the right edge", "middle");
    const { x, y } = this.curve() ?? { x: [], y: [] };
    const points = x.map((t, i) => `${this.chart.x(t)},${this.chart.y(y[i])}`).join(" ");
    this.chart.add("polyline", { class: "curve guess", points });
  }
}

// How far a run {t, y} is from a sketched curve: the root mean square over the times sketched.
export function rmsDistance({ x, y }, run) {
  let sum = 0;
  let count = 0;
  let i = 0;
  for (const [k, t] of x.entries()) {
    while (i + 1 < run.t.length && run.t[i + 1] <= t) i += 1;
    if (!run.t.length || t > run.t.at(-1) + 1e-6 || !Number.isFinite(run.y[i])) continue;
    sum += (y[k] - run.y[i]) ** 2;
    count += 1;
  }
  return count ? Math.sqrt(sum / count) : null;
}
