// A time series as vectors, for figures: what uPlot, and what is drawn beneath and above it, show on
// the page.

import { guessedLines } from "./guess.js";
import { markPath, markPositions } from "./marks.js";
import { finiteRange } from "./ticks.js";
import { ghostSamples, stackedAreas } from "./underlays.js";

export function paintTimeSeries(plot, chart) {
  const [from, to] = plot.board.range();
  const data = plot.samples(chart.body.clientWidth);
  const [t, ...all] = data;
  chart.begin([from, to], verticalRange(plot, data), { xLabel: "time [s]" });
  chart.clipped(() => {
    for (const { curve, from: low, to: high } of stackedAreas(plot, data)) {
      const outlined = [...points(t, high), ...points(t, low).reverse()];
      chart.add("polygon", { points: path(chart, outlined), class: "area tone", style: tone(curve) });
    }
    for (const { curve, x, y } of ghostSamples(plot, from, to)) {
      for (const piece of splitAtGaps(x, y)) polyline(chart, piece, "curve tone ghost", tone(curve));
    }
    plot.curves.forEach((curve, i) => {
      if (!plot.shows(curve) || plot.isArea(curve.line)) return;
      const whole = splitAtGaps(t, all[i]);
      for (const piece of whole) polyline(chart, piece, `curve tone ${curve.line.style}`, tone(curve));
      if (!plot.marked || !curve.series) return;
      const places = whole.flat().map(([a, b]) => [chart.x(a), chart.y(b)]);
      for (const [x, y] of markPositions(places, curve.series)) {
        chart.add("path", { d: markPath(curve.series), transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})`, class: "point tone", style: tone(curve) });
      }
    });
    if (plot.guess) paintGuess(chart, guessedLines(plot.guess, from, to));
  });
}

// That of the page's own chart, where it is drawn; else that of the curves shown.
function verticalRange(plot, data) {
  const { min, max } = plot.uplot?.scales.y ?? {};
  if (plot.visible && Number.isFinite(min)) return [min, max];
  let ends = [Infinity, -Infinity];
  plot.curves.forEach((curve, i) => {
    if (!plot.shows(curve) || curve.line.style === "limit" || plot.isArea(curve.line)) return;
    ends = finiteRange(data[i + 1], ends);
  });
  return plot.range(...ends, data);
}

function paintGuess(chart, lines) {
  for (const line of lines) polyline(chart, line, "curve guess", "");
  const { left, top, width } = chart.area;
  const end = Math.max(top + 2 * chart.em, chart.y(lines[0].at(-1)[1]));
  chart.text(left + width - 0.5 * chart.em, end - 0.5 * chart.em, "your guess", "end").classList.add("haloed");
}

// The stretches of a curve without gaps, as lists of [t, value].
function splitAtGaps(t, values) {
  const found = [[]];
  points(t, values).forEach((point) => (Number.isFinite(point[1]) ? found.at(-1).push(point) : found.push([])));
  return found.filter(({ length }) => length > 1);
}

function points(t, values) {
  return Array.from(t, (time, i) => [time, values[i]]);
}

function polyline(chart, line, className, style) {
  chart.add("polyline", { points: path(chart, line), class: className, style });
}

function path(chart, line) {
  return line.map(([t, value]) => `${chart.x(t).toFixed(2)},${chart.y(value).toFixed(2)}`).join(" ");
}

function tone(curve) {
  return `--tone: var(--${curve.tone})`;
}
