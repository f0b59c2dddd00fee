// Lines and sets of points in one chart, each of which the legend can switch off; axes may be
// logarithmic.

import { formatNumber } from "../format.js";
import { card, element } from "./card.js";
import { Chart } from "./chart.js";
import { markPath, markPositions, swatch } from "./marks.js";
import { fillPlaceholders } from "./placeholders.js";
import { describeRange, joinSentences } from "./summary.js";
import { paddedRange } from "./ticks.js";

const SERIES = 8;

export class Curves {
  constructor(plot) {
    this.plot = plot;
    Object.assign(this, card(plot.title, "", "canvas tall"));
    this.hidden = new Set(); // labels switched off
    this.entries = new Map(); // by label: the button, and its note
    this.chart = new Chart(this.body, () => this.draw());
  }

  update(fields) {
    this.xLabel = fillPlaceholders(this.plot.x_label, fields);
    this.yLabel = fillPlaceholders(this.plot.y_label, fields);
    // A logarithm has no place for what is negative: the axis is then linear.
    const negative = ({ y }) => (fields[y] ?? []).flat().some((v) => v < 0);
    const traces = this.plot.traces.filter(({ optional, y }) => !optional || y in fields);
    this.logY = this.plot.log_y && !traces.some(negative);
    this.curves = traces.flatMap((trace) => this.expand(trace, fields));
    this.marked = new Set(this.curves.map(({ series }) => series).filter(Boolean)).size > 1;
    this.updateLegend();
    this.draw();
  }

  // The curves of a trace, one a column where its y is (n, k); its x may be, too.
  expand(trace, fields) {
    const { logY, plot: { log_x: logX } } = this;
    const place = (v, log) => (log ? Math.log10(v) : v); // of what is not positive: not finite
    const xs = fields[trace.x] ?? [];
    const ys = fields[trace.y] ?? [];
    const several = Array.isArray(ys[0]);
    const labels = Array.isArray(trace.label) ? trace.label : null;
    const count = several ? ys[0].length : (labels?.length ?? 1);
    return Array.from({ length: count }, (_, k) => ({
      style: trace.style,
      series: trace.series ? ((trace.series - 1 + k) % SERIES) + 1 : 0,
      label: labels ? labels[k] : fillPlaceholders(trace.label, fields, k),
      note: trace.note ? (fields[trace.note] ?? [])[k] : undefined,
      points: xs
        .map((v, i) => [place(Array.isArray(v) ? v[k] : v, logX), place(several ? ys[i][k] : ys[i], logY)])
        .filter(([a, b]) => Number.isFinite(a) && Number.isFinite(b)),
    }));
  }

  // The legend has what is there; what has no points yet is faint in it.
  updateLegend() {
    const labelled = this.curves.filter(({ label }) => label);
    const labels = labelled.map(({ label }) => label);
    if (labels.join("\n") !== [...this.entries.keys()].join("\n")) {
      this.entries = new Map(labelled.map((curve) => [curve.label, this.entry(curve)]));
      this.legend.replaceChildren(...this.entries.values());
    }
    for (const { label, note, points } of labelled) {
      const button = this.entries.get(label);
      button.classList.toggle("nothing", points.length === 0);
      const text = button.querySelector(".note");
      if (text) text.textContent = Number.isFinite(note) ? formatNumber(note) : "";
    }
  }

  entry({ label, style, series, note }) {
    const button = element("button");
    button.type = "button";
    button.append(swatch(style, tone(series), this.marked || style === "marked" ? series : 0));
    button.setAttribute("aria-pressed", String(!this.hidden.has(label)));
    button.title = "Show or hide";
    button.append(element("span", "", label), element("b", "note"));
    button.addEventListener("click", () => {
      const shown = this.hidden.delete(label) || !this.hidden.add(label);
      button.setAttribute("aria-pressed", String(shown));
      this.draw();
    });
    return button;
  }

  // What is drawn. A curve without a label goes with the one of its colour.
  get shown() {
    const gone = this.curves.filter(({ label }) => this.hidden.has(label)).map(({ series }) => series);
    return this.curves.filter(({ label, series }) => (label ? !this.hidden.has(label) : !gone.includes(series)));
  }

  draw() {
    if (this.body.clientWidth) this.paint(this.chart);
  }

  // Draws what there is on a chart, of the page or of a figure.
  paint(chart) {
    if (!this.curves) return;
    const { guide, equal, log_x: logX } = this.plot;
    const { xLabel, yLabel, logY } = this;
    const shown = this.shown;
    const circle = guide === "unit-circle";
    const axis = guide === "imaginary-axis" || guide === "left-half-plane";
    const extra = circle ? [-1, 1] : [];
    const x = paddedRange([...shown.flatMap(({ points }) => points.map(([a]) => a)), ...extra, ...(axis ? [0] : [])]);
    const y = paddedRange([...shown.flatMap(({ points }) => points.map(([, b]) => b)), ...extra]);
    // Beside a guide the frame stands still while points wander within it.
    this.x = guide === "none" ? x : keepRange(this.x, x);
    this.y = guide === "none" ? y : keepRange(this.y, y);
    chart.begin(this.x, this.y, { square: equal || circle, xLabel, yLabel, logX, logY });
    const [x0, , y0, y1] = chart.ranges;
    if (guide === "left-half-plane") {
      const width = Math.max(0, chart.x(0) - chart.x(x0));
      chart.add("rect", { x: chart.x(x0), y: chart.y(y1), width, height: chart.area.height, class: "stable" });
    }
    if (axis) chart.line([0, y0], [0, y1], "guide");
    if (circle) chart.add("circle", { cx: chart.x(0), cy: chart.y(0), r: chart.x(1) - chart.x(0), class: "guide stable" });
    for (const curve of shown) this.trace(chart, curve);
  }

  trace(chart, { style, series, points }) {
    const places = points.map(([a, b]) => [chart.x(a), chart.y(b)]);
    const colour = `--tone: ${tone(series)}`;
    if (style !== "points" && places.length > 1) {
      const path = places.map((place) => place.map((v) => v.toFixed(1)).join(",")).join(" ");
      chart.add("polyline", { class: `curve tone ${style}`, style: colour, points: path });
    }
    const own = style === "points" || style === "marked";
    if (!own && !(this.marked && series)) return;
    const size = style === "points" ? 1.2 : style === "marked" ? 0.8 : 1;
    for (const [x, y] of own ? places : markPositions(places, series)) {
      const at = `translate(${x.toFixed(1)} ${y.toFixed(1)}) scale(${size})`;
      chart.add("path", { d: markPath(series), transform: at, class: "point tone", style: colour });
    }
  }

  summary() {
    if (!this.curves) return "";
    const value = (v) => (this.logY ? 10 ** v : v);
    const there = this.curves.filter(({ points }) => points.length);
    const parts = there.map(({ label, points }) =>
      `${label || "points"}: ${points.length} points, ${describeRange(points.map(([, y]) => value(y)))}`);
    return joinSentences(`${this.plot.title}: ${this.yLabel || "values"} over ${this.xLabel}`, parts);
  }

  clear() {
    this.x = this.y = null;
  }
}

function tone(series) {
  return series ? `var(--series-${series})` : "var(--ink)";
}

// The old range while it fits and is not much too wide, else the wanted one.
function keepRange(old, wanted) {
  const fits = old && old[0] <= wanted[0] && old[1] >= wanted[1];
  return fits && old[1] - old[0] < 3 * (wanted[1] - wanted[0]) ? old : wanted;
}
