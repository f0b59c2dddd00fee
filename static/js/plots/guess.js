// What the reader predicted, in the plot it is about: levels or a curve, dashed.

import { colour } from "./palette.js";

const REACH = 2; // A guess this many times as far off as the curves are tall stands at the edge.

// The values of a guess that the vertical range takes in, beside curves from low to high.
export function guessedValues(guess, low, high) {
  if (!guess) return [];
  const reach = REACH * Math.max(high - low, 1e-3 * Math.max(Math.abs(low), Math.abs(high)));
  const values = guess.y ?? guess.levels;
  return low <= high ? values.filter((v) => v > low - reach && v < high + reach) : values;
}

// Its lines over times [from, to], each of [t, value].
export function guessedLines({ levels, x, y }, from, to) {
  return levels?.map((level) => [[from, level], [to, level]]) ?? [x.map((t, i) => [t, y[i]])];
}

export function drawGuess(u, guess) {
  if (!guess) return;
  const { ctx, bbox } = u;
  const { min, max } = u.scales.x;
  const lines = guessedLines(guess, min, max);
  const bottom = bbox.top + bbox.height;
  const place = (v) => Math.min(bottom, Math.max(bbox.top, u.valToPos(v, "y", true)));
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.strokeStyle = ctx.fillStyle = colour("ink");
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
  ctx.beginPath();
  for (const line of lines) {
    line.forEach(([t, v], i) => ctx[i ? "lineTo" : "moveTo"](u.valToPos(t, "x", true), place(v)));
  }
  ctx.stroke();
  const size = 12 * devicePixelRatio;
  const end = place(lines[0].at(-1)[1]);
  ctx.font = `${size}px system-ui, sans-serif`;
  ctx.textAlign = "right";
  const below = end < bbox.top + 2 * size;
  const at = [bbox.left + bbox.width - size / 2, below ? end + 1.2 * size : end - 0.4 * size];
  ctx.setLineDash([]);
  ctx.strokeStyle = colour("surface"); // stands out from curves behind it
  ctx.lineWidth = 4 * devicePixelRatio;
  ctx.lineJoin = "round";
  ctx.strokeText("your guess", ...at);
  ctx.fillText("your guess", ...at);
  ctx.restore();
}
