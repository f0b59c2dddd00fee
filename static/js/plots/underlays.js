// What lies beneath the curves of a time series: stacked areas, and the faint run before.

import { decimate } from "../sample_buffer.js";
import { colour } from "./palette.js";

// The stacked curves shown, each with where it begins and ends at every sample: positive
// values upward from zero, negative ones downward. `data` is the times, and each curve's values.
export function* stackedAreas(plot, data) {
  if (!plot.plot.stacked || !data) return;
  const up = new Float64Array(data[0].length);
  const down = new Float64Array(data[0].length);
  for (const [i, curve] of plot.curves.entries()) {
    if (!plot.isArea(curve.line) || !plot.shows(curve)) continue;
    const samples = Float64Array.from(data[i + 1]);
    const from = samples.map((value, k) => (value >= 0 ? up[k] : down[k]));
    const to = samples.map((value, k) => from[k] + value);
    samples.forEach((value, k) => ((value >= 0 ? up : down)[k] = to[k]));
    yield { curve, from, to };
  }
}

export function drawAreas(plot, u) {
  const ctx = clip(u, 0.6);
  const x = Array.from(u.data[0], (t) => u.valToPos(t, "x", true));
  for (const { curve, from, to } of stackedAreas(plot, u.data)) {
    ctx.fillStyle = colour(curve.tone);
    ctx.beginPath();
    to.forEach((value, k) => ctx.lineTo(x[k], u.valToPos(value, "y", true)));
    for (let k = x.length - 1; k >= 0; k--) ctx.lineTo(x[k], u.valToPos(from[k], "y", true));
    ctx.fill();
  }
  ctx.restore();
}

export function* ghostSamples(plot, from, to) {
  const { ghost } = plot.board;
  if (!ghost) return;
  const [a, b] = ghost.span(from, to);
  const stride = Math.max(1, Math.floor((b - a) / 600));
  for (const curve of plot.curves) {
    if (curve.line.style === "limit" || plot.isArea(curve.line) || !plot.shows(curve)) continue;
    const y = ghost.column(curve.column);
    if (y) yield { curve, x: decimate(ghost.column("t"), a, b, stride), y: decimate(y, a, b, stride) };
  }
}

export function drawGhost(plot, u) {
  const ctx = clip(u, 0.32);
  ctx.lineWidth = 1.5 * devicePixelRatio;
  const [from, to] = plot.board.range();
  for (const { curve, x, y } of ghostSamples(plot, from, to)) {
    ctx.strokeStyle = colour(curve.tone);
    ctx.beginPath();
    for (let i = 0; i < x.length; i++) ctx.lineTo(u.valToPos(x[i], "x", true), u.valToPos(y[i], "y", true));
    ctx.stroke();
  }
  ctx.restore();
}

// The canvas, faint, and nothing beyond the plot's own area; until it is restored.
function clip({ ctx, bbox }, alpha) {
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.globalAlpha = alpha;
  return ctx;
}
