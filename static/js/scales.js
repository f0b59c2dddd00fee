// Where on its track, in [0, 1], a knob's value sits, and back: the same as `Knob` in labs/params.py.

const LOG_SPAN = 1000; // a logarithmic track that reaches zero bends to linear below high / LOG_SPAN

export function positionOf({ low, high, scale }, value) {
  if (scale === "linear") return (value - low) / (high - low);
  if (low > 0) return Math.log(value / low) / Math.log(high / low);
  return Math.log1p((value / high) * (LOG_SPAN - 1)) / Math.log(LOG_SPAN);
}

// What a hand sets there; the ends are exact.
export function valueAt(knob, position) {
  const { low, high, scale } = knob;
  if (position <= 0) return low;
  if (position >= 1) return high;
  if (scale === "linear") return nearest(knob, low + position * (high - low));
  if (low > 0) return nearest(knob, low * (high / low) ** position);
  return nearest(knob, (high * Math.expm1(position * Math.log(LOG_SPAN))) / (LOG_SPAN - 1));
}

// In range, whole steps from the low end or three digits.
function nearest(knob, value) {
  const { low, high, scale, step } = knob;
  if (scale === "log") return bounded(knob, Number(value.toPrecision(3)));
  const grain = step || 10 ** Math.floor(Math.log10((high - low) / 200));
  const steps = Math.floor((value - low) / grain + 0.5);
  return bounded(knob, Number((low + steps * grain).toFixed(10)) + 0);
}

// The value some steps of the keyboard further along the track.
export function stepped(knob, value, steps) {
  const { low, high, step, scale } = knob;
  if (scale === "log" && value > 0) return bounded(knob, Number((value * 1.1 ** steps).toPrecision(3)));
  const grain = step || (high - low) / 100;
  return bounded(knob, Number((value + steps * grain).toPrecision(6)));
}

function bounded({ low, high }, value) {
  return Math.min(high, Math.max(low, value));
}
