// Several lines and sets of points in one chart, each of which the legend can switch off; axes
// may be logarithmic.

import { number } from "../format.js";
import { card, element } from "./card.js";
import { around, Chart } from "./chart.js";

export class Curves {
  constructor(plot) {
    this.plot = plot;
    Object.assign(this, card(plot.title, "", "canvas tall"));
    this.hidden = new Set(); // labels switched off
    this.notes = new Map();
    this.entries = plot.traces.map((trace) => (trace.label ? this.legend.appendChild(this.entry(trace)) : null));
    this.chart = new Chart(this.body, () => this.draw());
  }

  entry(trace) {
    const button = element("button", trace.style === "points" ? "points" : trace.style === "dash" ? "dash" : "");
    button.type = "button";
    button.style.setProperty("--tone", tone(trace));
    button.setAttribute("aria-pressed", "true");
    button.title = "Show or hide";
    button.append(element("span", "", trace.label));
    if (trace.note) {
      const note = button.appendChild(element("b", "note"));
      this.notes.set(note, trace.note);
    }
    button.addEventListener("click", () => {
      const shown = this.hidden.delete(trace.label) || !this.hidden.add(trace.label);
      button.setAttribute("aria-pressed", String(shown));
      this.draw();
    });
    return button;
  }

  update(fields) {
    const { traces, log_x: logX, log_y: logY } = this.plot;
    this.data = traces.map(({ x, y }) => {
      if (!fields[x] || !fields[y]) return [];
      const xs = fields[x].flat();
      const ys = fields[y].flat();
      const place = (v, log) => (log ? Math.log10(v) : v); // of what is not positive: not finite
      return xs.map((v, i) => [place(v, logX), place(ys[i], logY)]).filter(([a, b]) => Number.isFinite(a) && Number.isFinite(b));
    });
    this.data.forEach((points, i) => this.entries[i]?.classList.toggle("nothing", points.length === 0));
    for (const [note, name] of this.notes) {
      const [value] = fields[name]?.flat() ?? [];
      note.textContent = Number.isFinite(value) ? number(value) : "";
    }
    this.draw();
  }

  // What is drawn. A trace without a label goes with the one of its colour.
  get shown() {
    const gone = this.plot.traces.filter(({ label }) => this.hidden.has(label)).map(({ series }) => series);
    return this.plot.traces
      .map((trace, i) => ({ trace, points: this.data[i] }))
      .filter(({ trace }) => (trace.label ? !this.hidden.has(trace.label) : !gone.includes(trace.series)));
  }

  draw() {
    if (!this.data || !this.body.clientWidth) return;
    const { guide, equal, x_label: xLabel, y_label: yLabel, log_x: logX, log_y: logY } = this.plot;
    const shown = this.shown;
    const circle = guide === "unit-circle";
    const extra = circle ? [-1, 1] : [];
    const x = [...shown.flatMap(({ points }) => points.map(([a]) => a)), ...extra, ...(guide === "imaginary-axis" ? [0] : [])];
    const y = [...shown.flatMap(({ points }) => points.map(([, b]) => b)), ...extra];
    const chart = this.chart;
    chart.begin(around(x), around(y), { square: equal || circle, xLabel, yLabel, logX, logY });
    const [, , y0, y1] = chart.ranges;
    if (guide === "imaginary-axis") chart.line([0, y0], [0, y1], "guide");
    if (circle) chart.add("circle", { cx: chart.x(0), cy: chart.y(0), r: chart.x(1) - chart.x(0), class: "guide stable" });
    for (const { trace, points } of shown) this.trace(chart, trace, points);
  }

  trace(chart, { style, ...trace }, points) {
    const places = points.map(([a, b]) => [chart.x(a), chart.y(b)]);
    const colour = `--tone: ${tone(trace)}`;
    if (style !== "points" && places.length > 1) {
      const path = places.map((place) => place.map((v) => v.toFixed(1)).join(",")).join(" ");
      chart.add("polyline", { class: `curve tone ${style}`, style: colour, points: path });
    }
    if (style === "points" || style === "marked") {
      const r = style === "points" ? 4.5 : 2.5;
      for (const [cx, cy] of places) chart.add("circle", { cx, cy, r, class: "point tone", style: colour });
    }
  }

  clear() {}
}

function tone({ series }) {
  return series ? `var(--series-${series})` : "var(--ink)";
}
