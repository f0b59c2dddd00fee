// One bar a component, the limit each must stay within, and marks to compare with.

import { formatNumber } from "../format.js";
import { card } from "./card.js";
import { Chart } from "./chart.js";
import { joinSentences } from "./summary.js";
import { symbol } from "./symbol.js";
import { paddedRange } from "./ticks.js";

export class Bars {
  constructor(plot) {
    this.plot = plot;
    Object.assign(this, card(plot.title, plot.unit, "canvas tall"));
    if (plot.mathml) this.legend.append(symbol(plot.mathml));
    this.chart = new Chart(this.body, () => this.draw());
  }

  update(fields) {
    if (!fields[this.plot.field]) return;
    this.values = fields[this.plot.field].flat();
    this.limits = fields[this.plot.limit]?.flat() ?? [];
    this.marks = fields[this.plot.marks]?.flat() ?? [];
    this.names = fields[this.plot.names] ?? null;
    this.draw();
  }

  draw() {
    if (this.body.clientWidth) this.paint(this.chart);
  }

  paint(chart) {
    if (!this.values) return;
    const n = this.values.length;
    const wanted = paddedRange([...this.values, ...this.limits, ...this.limits.map((v) => -v), ...this.marks], { zero: true });
    const fits = this.y && this.y[0] <= wanted[0] && this.y[1] >= wanted[1];
    if (!fits || this.y[1] - this.y[0] > 3 * (wanted[1] - wanted[0])) this.y = wanted;
    chart.begin([0.4, n + 0.6], this.y, { xTicks: n > 30 ? null : this.values.map((_, i) => i + 1), xNames: this.names });
    this.values.forEach((value, i) => {
      if (!Number.isFinite(value)) return;
      const [a, b] = [chart.y(Math.max(0, value)), chart.y(Math.min(0, value))];
      const left = chart.x(i + 0.7);
      const full = Math.abs(value) >= 0.999 * this.limits[i];
      chart.add("rect", { x: left, y: a, width: chart.x(i + 1.3) - left, height: Math.max(1, b - a), class: full ? "column full" : "column" });
    });
    this.marks.forEach((mark, i) => {
      if (Number.isFinite(mark)) chart.line([i + 0.6, mark], [i + 1.4, mark], "mark");
    });
    this.limits.forEach((limit, i) => {
      for (const edge of [limit, -limit]) chart.line([i + 0.6, edge], [i + 1.4, edge], "limit");
    });
  }

  summary() {
    if (!this.values) return "";
    const parts = this.values.map((value, i) => `${this.names?.[i] ?? i + 1}: ${formatNumber(value, 3)}`);
    return joinSentences(`${this.plot.title}, bars${this.plot.unit ? ` in ${this.plot.unit}` : ""}`, parts);
  }

  clear() {
    this.y = null;
  }
}
