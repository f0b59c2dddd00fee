// y over x: a trajectory in a plane, or points such as eigenvalues with the line or circle that
// parts the stable from the unstable.

import { card } from "./card.js";
import { around, Chart } from "./chart.js";

export class Curve {
  constructor(plot) {
    this.plot = plot;
    Object.assign(this, card(plot.title, "", "canvas tall"));
    this.chart = new Chart(this.body, () => this.draw());
  }

  update(fields) {
    const { x, y } = this.plot;
    if (!fields[x] || !fields[y]) return;
    this.data = [fields[x].flat(), fields[y].flat()];
    this.draw();
  }

  draw() {
    if (!this.data || !this.body.clientWidth) return;
    const { points, guide, x_label: xLabel, y_label: yLabel } = this.plot;
    const [x, y] = this.data;
    const circle = guide === "unit-circle";
    // The ranges keep what was seen: points that wander are followed without a jumping frame.
    this.x = grown(this.x, around(circle ? [...x, -1, 1] : guide === "imaginary-axis" ? [...x, 0] : x));
    this.y = grown(this.y, around(circle ? [...y, -1, 1] : y));
    const chart = this.chart;
    chart.begin(this.x, this.y, { square: circle, xLabel, yLabel });
    const [x0, , y0, y1] = chart.ranges;
    if (guide === "imaginary-axis") {
      const stable = Math.max(0, chart.x(0) - chart.x(x0));
      chart.add("rect", { x: chart.x(x0), y: chart.y(y1), width: stable, height: chart.area.height, class: "stable" });
      chart.line([0, y0], [0, y1], "guide");
    }
    if (circle) {
      const r = chart.x(1) - chart.x(0);
      chart.add("circle", { cx: chart.x(0), cy: chart.y(0), r, class: "guide stable" });
    }
    if (points) {
      x.forEach((value, i) => this.mark(chart, value, y[i], "point"));
    } else {
      const path = x.map((value, i) => [value, y[i]]).filter(([a, b]) => Number.isFinite(a) && Number.isFinite(b));
      chart.add("polyline", { class: "curve", points: path.map(([a, b]) => `${chart.x(a).toFixed(1)},${chart.y(b).toFixed(1)}`).join(" ") });
      if (path.length) this.mark(chart, ...path.at(-1), "head");
    }
  }

  mark(chart, x, y, className) {
    if (Number.isFinite(x) && Number.isFinite(y)) {
      chart.add("circle", { cx: chart.x(x), cy: chart.y(y), r: 4.5, class: className });
    }
  }

  clear() {
    this.x = this.y = null;
  }
}

function grown(old, wanted) {
  const fits = old && old[0] <= wanted[0] && old[1] >= wanted[1];
  return fits && old[1] - old[0] < 3 * (wanted[1] - wanted[0]) ? old : wanted;
}
