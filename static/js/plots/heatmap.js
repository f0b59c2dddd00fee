// A field over a plane in colours, with a scale beside it and arrows over it. Its cells are drawn on
// a canvas beneath the chart; in a figure each is a rectangle.

import { fitLabel } from "../figures/text_layout.js";
import { formatNumber } from "../format.js";
import { paintArrows } from "./arrows.js";
import { card, element } from "./card.js";
import { Chart, em } from "./chart.js";
import { fillPlaceholders } from "./placeholders.js";
import { describeRange, joinSentences } from "./summary.js";
import { finiteRange, paddedRange, tickLabel, ticks } from "./ticks.js";

// The colours of values in the scene too (labs/colors.py), from the least to the largest.
const SEQUENTIAL = ["#2b2459", "#363d7d", "#3d589e", "#3477a0", "#35949d", "#56ad8f", "#82c381", "#bcd67c", "#f2e873"];
const STEPS = colours(256);

export class HeatMap {
  constructor(plot) {
    this.plot = plot;
    Object.assign(this, card(plot.title, "", "canvas tall"));
    this.canvas = this.body.appendChild(element("canvas", "cells"));
    this.chart = new Chart(this.body, () => this.draw());
    this.box = this.body.appendChild(element("div", "reading-box"));
    this.box.hidden = true;
    this.body.addEventListener("pointermove", (event) => this.read(event));
    this.body.addEventListener("pointerleave", () => (this.box.hidden = true));
  }

  update(fields) {
    const { x, y, z, arrows } = this.plot;
    if (![x, y, z].every((name) => fields[name])) return; // those of another plot, while this one is hidden
    this.data = { x: fields[x], y: fields[y], z: fields[z], arrows: fields[arrows] ?? [] };
    this.labels = [this.plot.x_label, this.plot.y_label, this.plot.z_label].map((text) => fillPlaceholders(text, fields));
    this.draw();
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.body;
    if (!width || !this.data) return;
    const { canvas } = this;
    [canvas.width, canvas.height] = [width * devicePixelRatio, height * devicePixelRatio];
    const ctx = canvas.getContext("2d");
    // Whole pixels: neighbours leave no seam between them.
    const place = (v) => Math.round(v * devicePixelRatio);
    this.paint(this.chart, ({ x, y, width, height, fill }) => {
      ctx.fillStyle = fill;
      ctx.fillRect(place(x), place(y), place(x + width) - place(x), place(y + height) - place(y));
    });
  }

  // Without `cell` each stretch of one colour in a row becomes a rectangle.
  paint(chart, cell = (box) => chart.add("rect", { ...box, "shape-rendering": "crispEdges" })) {
    if (!this.data) return;
    const { x, y, z, arrows } = this.data;
    const [xEdges, yEdges] = [edges(x), edges(y)];
    const range = this.range(z);
    const [xLabel, yLabel, zLabel] = this.labels;
    const whole = [...x, ...y].every(Number.isInteger);
    const scale = ticks(...range, chart.body.clientHeight / 48);
    const zLines = zLabel ? fitLabel(zLabel, (chart.body.clientHeight * 12) / em()) : [];
    const right = 2.2 + 0.56 * Math.max(...scale.map((v) => tickLabel(v).length), 2) + (zLines.length ? 0.4 + 1.2 * zLines.length : 0);
    chart.begin(finiteRange(xEdges), finiteRange(yEdges), { xLabel, yLabel, downward: this.plot.downward, whole, right, grid: false });
    z.forEach((row, i) => {
      const [top, bottom] = [chart.y(yEdges[i]), chart.y(yEdges[i + 1])].sort((a, b) => a - b);
      const tones = row.map((value) => tone(value, range));
      for (let j = 0, k = 1; j < tones.length; j = k++) {
        while (k < tones.length && tones[k] === tones[j]) k += 1;
        const [left, end] = [chart.x(xEdges[j]), chart.x(xEdges[k])].sort((a, b) => a - b);
        if (tones[j]) cell({ x: left, y: top, width: end - left, height: bottom - top, fill: tones[j] });
      }
    });
    paintColourBar(chart, range, scale, zLines);
    paintArrows(chart, arrows);
  }

  // Of the values there are; a constant stands in its middle.
  range(z) {
    const [low, high] = finiteRange(z.flat());
    return high > low ? [low, high] : paddedRange([low]);
  }

  // The value under the pointer.
  read({ clientX, clientY }) {
    const at = this.body.getBoundingClientRect();
    const { left, top, width, height } = this.chart.area ?? {};
    const [across, down] = [clientX - at.left - left, clientY - at.top - top];
    const within = this.data && across >= 0 && across < width && down >= 0 && down < height;
    this.box.hidden = !within;
    if (!within) return;
    const { x, y, z } = this.data;
    const [x0, x1, y0, y1] = this.chart.ranges;
    const [j, i] = [nearest(x, x0 + (across / width) * (x1 - x0)), nearest(y, y1 + (down / height) * (y0 - y1))];
    const words = [`${this.labels[0]}: ${formatNumber(x[j], 4)}`, `${this.labels[1]}: ${formatNumber(y[i], 4)}`, `${this.labels[2]}: ${formatNumber(z[i][j], 4)}`];
    this.box.replaceChildren(...words.map((text) => element("span", "", text)));
    this.box.style.insetInline = across > width / 2 ? `${left + 4}px auto` : `auto ${at.width - left - width + 4}px`;
  }

  summary() {
    if (!this.data) return "";
    const [xLabel, yLabel, zLabel] = this.labels;
    const { x, y, z, arrows } = this.data;
    const parts = [`${zLabel} ${describeRange(z.flat()).replace(/, last.*/, "")}`, `${x.length} columns and ${y.length} rows`];
    if (this.plot.arrows) parts.push(`${arrows.length} arrows`);
    return joinSentences(`${this.plot.title}: a map over ${xLabel} and ${yLabel}`, parts);
  }

  clear() {}
}

// The scale of colours, right of the area.
function paintColourBar(chart, [low, high], scale, lines) {
  const { left, top, width, height } = chart.area;
  const { em } = chart;
  const bar = { x: left + width + 0.8 * em, width: 0.8 * em };
  const place = (v) => top + (1 - (v - low) / (high - low)) * height;
  const count = 64;
  for (let k = 0; k < count; k++) {
    const y = top + (k / count) * height;
    const fill = STEPS[Math.round((1 - (k + 0.5) / count) * (STEPS.length - 1))];
    chart.add("rect", { ...bar, y, height: height / count + (k < count - 1 ? 0.5 : 0), fill });
  }
  for (const v of scale) chart.text(bar.x + bar.width + 0.35 * em, place(v) + 0.35 * em, tickLabel(v), "start");
  chart.upright(lines, chart.body.clientWidth - (1.2 * lines.length - 0.6) * em);
}

// Where cells end: midway between their middles, and as far beyond the outermost.
function edges(middles) {
  if (middles.length === 1) return [middles[0] - 0.5, middles[0] + 0.5];
  const between = middles.slice(1).map((v, i) => (middles[i] + v) / 2);
  return [2 * middles[0] - between[0], ...between, 2 * middles.at(-1) - between.at(-1)];
}

function nearest(values, wanted) {
  return values.reduce((best, v, i) => (Math.abs(v - wanted) < Math.abs(values[best] - wanted) ? i : best), 0);
}

function tone(value, [low, high]) {
  return Number.isFinite(value) ? STEPS[Math.round(((value - low) / (high - low)) * (STEPS.length - 1))] : "";
}

// So many steps from the first colour to the last, by way of all between.
function colours(count) {
  const parts = SEQUENTIAL.map((hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16)));
  return Array.from({ length: count }, (_, k) => {
    const place = (k / (count - 1)) * (parts.length - 1);
    const at = Math.min(Math.floor(place), parts.length - 2);
    const mixed = parts[at].map((a, c) => Math.round(a + (place - at) * (parts[at + 1][c] - a)));
    return `#${mixed.map((v) => v.toString(16).padStart(2, "0")).join("")}`;
  });
}
