// Ranges of axes, and the round numbers on them.

import { superscript } from "../format.js";

// The least and the largest of finite values and of those before; without any Infinity, -Infinity.
export function finiteRange(values, [low, high] = [Infinity, -Infinity]) {
  for (const value of values) {
    if (!Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

// The range of finite values, a little wider, and never empty.
export function paddedRange(values, { zero = false } = {}) {
  let [low, high] = finiteRange(values, zero ? [0, 0] : undefined);
  if (low > high) [low, high] = [0, 0];
  // A constant does not fill the frame with its rounding.
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (high - low < 1e-5 * size) [low, high] = [low - 0.5 * size, high + 0.5 * size];
  if (!(high > low)) [low, high] = [low - 1, high + 1];
  const margin = 0.08 * (high - low);
  return [low - margin, high + margin];
}

// The range of this width about a middle.
export function centredRange(middle, width) {
  return [middle - width / 2, middle + width / 2];
}

// Round numbers between two, `most` or fewer of them but two where there are, no nearer to one
// another than `least`.
export function ticks(low, high, most, least = 0) {
  const raw = Math.max(least, (high - low) / Math.max(1, most));
  const power = 10 ** Math.floor(Math.log10(raw));
  const steps = [0.5, 1, 2, 5, 10].map((m) => m * power);
  const at = steps.findIndex((s) => s >= raw);
  const found = multiples(low, high, steps[at]);
  return found.length < 2 && steps[at - 1] >= least ? multiples(low, high, steps[at - 1]) : found;
}

function multiples(low, high, step) {
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(+(k * step).toPrecision(12));
  return found;
}

// Ticks of a logarithmic axis: whole decades, or 1, 2 and 5 of each, or 1 and 3, where there are few
// decades and the numbers do not touch. Two at least, however close: a number alone shows no scale.
export function logTicks(low, high, most) {
  const stride = Math.max(1, Math.ceil((high - low) / Math.max(1, most)));
  const room = (fewest) => high - low <= 2 && Math.log10(fewest) * most > 0.48 * (high - low);
  const found = decadeTicks(low, high, room(2) ? [1, 2, 5] : room(3) ? [1, 3] : [1], stride);
  if (found.length > 1) return found;
  const closer = [[1], [1, 3], [1, 2, 5]].map((steps) => decadeTicks(low, high, steps));
  const even = ticks(10 ** low, 10 ** high, most).map(Math.log10); // where a decade is too long
  return [...closer, even].find(({ length }) => length > 1) ?? found;
}

// The logarithms of these multiples of every power of ten, or of every so many.
function decadeTicks(low, high, steps, stride = 1) {
  const found = [];
  for (let k = Math.floor(low / stride) * stride; k <= high; k += stride) {
    found.push(...steps.map((step) => k + Math.log10(step)).filter((v) => v >= low && v <= high));
  }
  return found;
}

// In words, the number whose logarithm this is: 0.02, 2000, 10⁻¹⁶, 5·10⁻⁷.
export function powerLabel(exponent) {
  const value = Number((10 ** exponent).toPrecision(3));
  if (Math.abs(exponent) < 4) return tickLabel(value);
  const [mantissa, tens] = value.toExponential().split("e");
  return `${mantissa === "1" ? "" : `${mantissa}·`}10${superscript(tens)}`;
}

// A tick's number in words.
export function tickLabel(value) {
  const size = Math.abs(value);
  const text = size >= 1e5 || (size > 0 && size < 1e-4) ? value.toExponential(0) : String(value);
  return text.replace("-", "−");
}
