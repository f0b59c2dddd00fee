// What tells the series apart besides colour: a mark each, on its curve and in the legend; and the
// dashes, which tell kinds of lines apart.

import { svg } from "./chart.js";

// By series, from 1: disc, square, triangle, diamond, triangle on its tip, plus, cross, hourglass.
const SHAPES = [
  "M-3.4 0a3.4 3.4 0 1 0 6.8 0a3.4 3.4 0 1 0-6.8 0z",
  "M-3-3h6v6h-6z",
  "M0-4.2L3.9 3h-7.8z",
  "M0-4.4L4.4 0L0 4.4L-4.4 0z",
  "M0 4.2L3.9-3h-7.8z",
  "M-1.4-4h2.8v2.6h2.6v2.8h-2.6v2.6h-2.8v-2.6h-2.6v-2.8h2.6z",
  "M-3.8-1.9L-1.9-3.8L0-1.9L1.9-3.8L3.8-1.9L1.9 0L3.8 1.9L1.9 3.8L0 1.9L-1.9 3.8L-3.8 1.9L-1.9 0z",
  "M-3.6-3.6h7.2L0 0L3.6 3.6h-7.2L0 0z",
];
const paths = SHAPES.map((shape) => new Path2D(shape));

export const DASHES = { dash: [7, 5], limit: [3, 4] };

// The outline of a series' mark, about the origin; of series 0, ink, a disc.
export function markPath(series) {
  return SHAPES[Math.max(0, series - 1)];
}

// Draws a mark on a canvas at (x, y) in its pixels, with a rim that sets it off from the curves.
export function drawMark(ctx, series, x, y, rim) {
  ctx.save();
  ctx.translate(x, y);
  ctx.scale(devicePixelRatio, devicePixelRatio);
  ctx.lineWidth = 1.5;
  ctx.strokeStyle = rim;
  ctx.stroke(paths[series - 1]);
  ctx.fill(paths[series - 1]);
  ctx.restore();
}

// The place of a legend's entry: a piece of its line, with its mark if it has one.
export function swatch(style, tone, series = 0) {
  const made = svg("svg", { class: "swatch", viewBox: "-10 -5 20 10", "aria-hidden": "true" });
  made.style.setProperty("--tone", tone);
  if (style === "area") made.append(svg("rect", { x: -9, y: -4, width: 18, height: 8, rx: 1.5 }));
  else if (style !== "points") made.append(svg("line", { x1: -10, x2: 10, y1: 0, y2: 0, class: style }));
  if (series || style === "points") made.append(svg("path", { d: markPath(series) }));
  return made;
}

// Where the marks of a polyline of places [x, y] go: every so many pixels along it, counted
// along x above all, a little later for each series, so that marks do not lie on one another.
export function markPositions(places, series, every = 90) {
  const found = [];
  let next = every * (0.25 + series / 11);
  let gone = 0;
  for (let i = 1; i < places.length && found.length < 40; i++) {
    const [[x0, y0], [x1, y1]] = [places[i - 1], places[i]];
    const length = Math.abs(x1 - x0) + 0.25 * Math.abs(y1 - y0);
    while (length > 0 && gone + length >= next && found.length < 40) {
      const part = (next - gone) / length;
      found.push([x0 + part * (x1 - x0), y0 + part * (y1 - y0)]);
      next += every;
    }
    gone += length;
  }
  return found;
}
