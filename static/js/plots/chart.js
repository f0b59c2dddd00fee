// A small chart in SVG with round ticks, for what changes a few times a second, and for every plot
// that leaves the page. Its colours come from the style sheet, so that a change of theme needs no
// redrawing.

import { fitLabel, textWidth } from "../figures/text_layout.js";
import { centredRange, logTicks, powerLabel, tickLabel, ticks } from "./ticks.js";

let clips = 0;
const SVG = "http://www.w3.org/2000/svg";

export class Chart {
  // As large as its body; `draw` hears that this has changed.
  constructor(body, draw = null) {
    this.body = body;
    this.svg = svg("svg", { class: "chart", "aria-hidden": "true" });
    body.append(this.svg);
    if (draw) new ResizeObserver(draw).observe(body);
  }

  // Clears; tells its size and that of its letters [px].
  clear() {
    const { clientWidth: width, clientHeight: height } = this.body;
    this.em = em();
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.replaceChildren();
    return { width, height, em: this.em };
  }

  // Clears, and draws axes for the ranges; `xNames` are those of the ticks 1, 2, 3. `square` gives
  // both axes the same scale, `downward` turns that of y over, `whole` leaves fractions out, `right`
  // leaves room [em] beside the area. On a logarithmic axis the range is of logarithms to the base
  // 10, as are all places drawn.
  begin([x0, x1], [y0, y1], {
    square = false, downward = false, whole = false, xTicks = null, xNames = null, xLabel = "", yLabel = "",
    logX = false, logY = false, right = 0, grid = true,
  } = {}) {
    const { width, height, em } = this.clear();
    const least = whole ? 1 : 0;
    // Names that are wider than their bars are slanted.
    const longest = Math.min(12, Math.max(0, ...(xNames ?? []).map((name) => name.length)));
    const slanted = longest * 0.56 * em > (width - 4 * em) / (xTicks?.length || 1);
    const bottom = (slanted ? 1.4 + 0.34 * longest : 2) * em + (xLabel ? 1.4 * em : 0);
    const tall = Math.max(1, height - bottom - 0.7 * em);
    const yTicks = (from, to) => (logY ? logTicks : ticks)(from, to, tall / (3 * em), least);
    const yText = logY ? powerLabel : tickLabel;
    // As wide as the longest number, so that none is cut off: digits are 0.56 em wide or less.
    const digits = Math.max(...yTicks(y0, y1).map((v) => yText(v).length), 3);
    const upright = yLabel ? fitLabel(yLabel, (height * 12) / em) : [];
    const left = (0.9 + 0.56 * Math.min(digits, 12) + (upright.length ? 0.4 + 1.2 * upright.length : 0)) * em;
    this.area = { left, top: 0.7 * em, width: Math.max(1, width - left - (1 + right) * em), height: tall };
    if (square) {
      const perPixel = Math.max((x1 - x0) / this.area.width, (y1 - y0) / this.area.height);
      [x0, x1] = centredRange((x0 + x1) / 2, perPixel * this.area.width);
      [y0, y1] = centredRange((y0 + y1) / 2, perPixel * this.area.height);
    }
    this.ranges = downward ? [x0, x1, y1, y0] : [x0, x1, y0, y1];
    const { top } = this.area;
    for (const v of yTicks(y0, y1)) {
      if (grid) this.line([x0, v], [x1, v], v === 0 && !logY ? "zero" : "grid");
      this.text(left - 0.5 * em, this.y(v) + 0.35 * em, yText(v), "end");
    }
    // Numbers of bars that would touch are told in steps.
    const numbers = xNames ? 0 : (xTicks ?? []).length;
    const every = Math.max(1, Math.ceil((numbers * (0.56 * String(numbers).length + 0.4) * em) / this.area.width));
    for (const v of xTicks ?? (logX ? logTicks : ticks)(x0, x1, this.area.width / (6 * em), least)) {
      if ((v - 1) % every && numbers) continue;
      if (grid && !xTicks) this.line([v, y0], [v, y1], v === 0 && !logX ? "zero" : "grid");
      const text = xNames?.[v - 1] ?? (logX ? powerLabel : tickLabel)(v);
      const shown = text.length > 12 ? `${text.slice(0, 11)}…` : text;
      // A long number at the very end is moved until it is whole.
      const x = slanted ? this.x(v) : Math.min(this.x(v), width - (textWidth(shown) * em) / 24);
      const y = top + this.area.height + (slanted ? 1 : 1.5) * em;
      const made = this.text(x, y, shown, slanted ? "end" : "middle");
      if (slanted) made.setAttribute("transform", `rotate(-35 ${x} ${y})`);
    }
    if (xLabel) this.text(left + this.area.width / 2, height - 0.35 * em, xLabel, "middle");
    this.upright(upright, 1.1 * em);
  }

  // Lines of text from bottom to top, the first with its foot at x: in the middle of the area, or as
  // near to it as they are whole.
  upright(lines, x) {
    const { top, height } = this.area;
    for (const [i, text] of lines.entries()) {
      const half = (textWidth(text) * this.em) / 24;
      const y = Math.max(half, Math.min(top + height / 2, this.body.clientHeight - half));
      const foot = x + 1.2 * i * this.em;
      this.text(foot, y, text, "middle").setAttribute("transform", `rotate(-90 ${foot} ${y})`);
    }
  }

  // Draws in a group of its own, of which nothing is seen beyond the area.
  clipped(draw) {
    const id = `clip-${(clips += 1)}`;
    const { left, top, width, height } = this.area;
    const clip = this.add("clipPath", { id });
    clip.append(svg("rect", { x: left, y: top, width, height }));
    const all = this.svg;
    this.svg = this.add("g", { "clip-path": `url(#${id})` });
    draw();
    this.svg = all;
  }

  x(value) {
    return this.area.left + ((value - this.ranges[0]) / (this.ranges[1] - this.ranges[0])) * this.area.width;
  }

  y(value) {
    return this.area.top + (1 - (value - this.ranges[2]) / (this.ranges[3] - this.ranges[2])) * this.area.height;
  }

  line([x0, y0], [x1, y1], className) {
    return this.add("line", { x1: this.x(x0), y1: this.y(y0), x2: this.x(x1), y2: this.y(y1), class: className });
  }

  text(x, y, content, anchor) {
    const made = this.add("text", { x, y, "text-anchor": anchor });
    made.textContent = content;
    return made;
  }

  add(name, attributes) {
    return this.svg.appendChild(svg(name, attributes));
  }
}

// The size of a chart's letters [px].
export function em() {
  return 0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize);
}

export function svg(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}
