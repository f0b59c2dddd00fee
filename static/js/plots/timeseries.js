// Measured channels over time, on uPlot. Beneath them, faint, the same channels of the run before.

/* global uPlot */
import { speechText } from "../figures/text_layout.js";
import { formatNumber } from "../format.js";
import { decimate } from "../sample_buffer.js";
import { card } from "./card.js";
import { CursorBox } from "./cursor_box.js";
import { markCurves } from "./curve_marks.js";
import { drawGuess, guessedValues } from "./guess.js";
import { Legend } from "./legend.js";
import { DASHES } from "./marks.js";
import { paintTimeSeries } from "./paint_time_series.js";
import { colour, SERIES } from "./palette.js";
import { fillPlaceholders } from "./placeholders.js";
import { describeRange, joinSentences } from "./summary.js";
import { symbol } from "./symbol.js";
import { finiteRange } from "./ticks.js";
import { drawAreas, drawGhost, ghostSamples, stackedAreas } from "./underlays.js";

const DENSITY = 3; // samples a pixel that are worth drawing
const READ_OUT_EVERY = 100; // [ms]

export class TimeSeries {
  constructor(plot, board) {
    this.plot = plot;
    this.board = board;
    Object.assign(this, card(plot.title));
    this.switches = new Legend(this, () => this.showCurves());
    this.box = new CursorBox(this);
    this.span = null; // the y range shown last
    this.readAt = 0;
    this.visible = true;
    new IntersectionObserver(([entry]) => {
      this.visible = entry.isIntersecting;
      if (this.visible) this.draw();
    }).observe(this.body);
    new ResizeObserver(() => this.resize()).observe(this.body);
  }

  // One entry per curve: its column, line and component, by what the columns and selectors say.
  choose() {
    const chosen = this.board.selected(this.plot.select);
    const curves = [];
    this.components = 0;
    this.plot.lines.forEach((line, l) => {
      const n = this.board.run.components(line.channel);
      if (n === null) return;
      if (n === 0) return curves.push({ column: line.channel, line, l, c: null });
      const all = [...Array(n).keys()];
      const every = chosen === "all" || chosen === null;
      const one = every && this.plot.stacked ? Math.min(this.plot.lead, n - 1) : chosen;
      const shown = every && !this.plot.stacked ? all : all.filter((c) => c === one);
      if (line.style !== "limit") this.components = Math.max(this.components, shown.length);
      for (const c of shown) curves.push({ column: `${line.channel}[${c}]`, line, l, c });
    });
    for (const curve of curves) {
      const several = this.components > 1 && curve.c !== null;
      const limit = curve.line.style === "limit";
      curve.series = limit ? 0 : ((several ? curve.c : curve.l) % SERIES) + 1;
      curve.tone = limit ? "limit" : `series-${curve.series}`;
    }
    this.curves = curves;
    this.marked = new Set(curves.map(({ series }) => series).filter(Boolean)).size > 1;
  }

  // The unit of what is shown; empty where the components shown have several.
  get unit() {
    const shown = [...new Set(this.curves.map(({ c }) => c))];
    const units = new Set(shown.map((c) => fillPlaceholders(this.plot.unit, this.board.labels, c)));
    return units.size === 1 ? [...units][0] : "";
  }

  // Builds the chart anew: for other columns, another selection or another theme.
  rebuild() {
    this.uplot?.destroy();
    this.uplot = null;
    this.choose();
    if (!this.curves.length || !this.body.clientWidth) return;
    const font = `${Math.round(0.75 * rem())}px system-ui, sans-serif`;
    const axis = { stroke: colour("axis"), font, ticks: { show: false }, grid: { stroke: colour("grid"), width: 1 } };
    const options = {
      width: this.body.clientWidth,
      height: this.body.clientHeight,
      padding: [8, 1.1 * rem(), 0, 0],
      legend: { show: false },
      cursor: {
        sync: { key: "time", setSeries: false },
        drag: { x: true, y: false, setScale: false },
        points: { size: 6 },
        y: false,
        bind: { dblclick: () => () => this.board.unzoom() },
      },
      scales: {
        x: { time: false, auto: false, range: (u, low, high) => [low, high] },
        y: { range: (u, low, high) => this.range(low, high, u.data) },
      },
      axes: [
        { ...axis, size: 1.75 * rem(), gap: 4, space: 4 * rem(), values: (u, ticks) => ticks.map((t) => `${+t.toFixed(6)} s`) },
        { ...axis, size: (u, texts) => (1 + 0.45 * Math.max(3, ...(texts ?? []).map((text) => text.length))) * rem(), gap: 6, space: 1.9 * rem(), values: (u, ticks) => ticks.map((v) => tick(v)) },
      ],
      series: [{}, ...this.curves.map((curve) => this.series(curve))],
      hooks: {
        drawAxes: [(u) => drawAreas(this, u), (u) => drawGhost(this, u)],
        draw: [(u) => markCurves(this, u), (u) => drawGuess(u, this.guess)],
        setSelect: [(u) => this.zoom(u)],
        setCursor: [() => this.readOut(true)],
      },
    };
    this.uplot = new uPlot(options, [[], ...this.curves.map(() => [])], this.body);
    this.box.enter(this.uplot);
    this.setUnit(this.unit);
    this.switches.write();
    this.draw();
  }

  series(curve) {
    const { line, tone } = curve;
    const dash = DASHES[line.style];
    const limit = line.style === "limit";
    const area = this.isArea(line);
    return {
      stroke: colour(tone),
      ...(area && { paths: () => null }), // drawn by drawAreas
      width: limit || dash ? 1.25 : 1.75,
      dash,
      auto: !limit && !area, // a far limit must not flatten the curves
      points: { show: false },
      show: this.shows(curve),
    };
  }

  draw() {
    const u = this.uplot;
    if (!u || !this.visible) return;
    const [from, to] = this.board.range();
    u.batch(() => {
      u.setData(this.samples(u.width).map(nanToNull), false);
      u.setScale("x", { min: from, max: to });
    });
    // Under a resting pointer the samples move on.
    const { left, top } = u.cursor;
    if (left >= 0) u.setCursor({ left, top }, false);
    this.readOut(left >= 0);
  }

  // The times in range and each curve's values then, as many as this width can show.
  samples(width) {
    const { run } = this.board;
    const [a, b] = run.span(...this.board.range());
    const stride = Math.max(1, Math.floor((b - a) / (DENSITY * width)));
    return ["t", ...this.curves.map((curve) => curve.column)].map((name) => decimate(run.column(name), a, b, stride));
  }

  // On the chart of a figure, where the page has uPlot's.
  paint(chart) {
    if (!this.board.run) return;
    if (!this.uplot) {
      this.choose();
      this.setUnit(this.unit);
      this.switches.write();
    }
    if (this.curves.length) paintTimeSeries(this, chart);
  }

  // The y range: the curves and the ghost, and a limit once a curve comes near it. It grows at
  // once but shrinks only when much of it is empty, so that it does not tremble.
  range(low, high, data) {
    if (low === null || low === undefined) [low, high] = [Infinity, -Infinity];
    for (const { from, to } of stackedAreas(this, data)) [low, high] = finiteRange(to, finiteRange(from, [low, high]));
    for (const { y } of ghostSamples(this, ...this.board.range())) [low, high] = finiteRange(y, [low, high]);
    const guessed = guessedValues(this.guess, low, high);
    [low, high] = [Math.min(low, ...guessed), Math.max(high, ...guessed)];
    if (!(low <= high)) return [-1, 1];
    // A constant is seen from zero: a hair's breadth around it would be an axis of odd digits.
    const constant = high - low < 1e-3 * Math.max(Math.abs(low), Math.abs(high));
    if (constant) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
    const near = constant ? 0.2 : 0.6;
    for (const curve of this.curves.filter((curve) => curve.line.style === "limit")) {
      const limit = this.board.run.latest(curve.column);
      if (limit > 0 && high > near * limit) high = Math.max(high, limit);
      if (limit < 0 && low < near * limit) low = Math.min(low, limit);
    }
    const middle = (low + high) / 2;
    const half = Math.max((high - low) / 2, 1e-6);
    const wanted = [middle - 1.08 * half, middle + 1.08 * half];
    const [l, h] = this.span ?? wanted;
    const fits = l <= low && h >= high && h - l < 1.6 * (wanted[1] - wanted[0]);
    if (!fits) this.span = wanted;
    return this.span ?? (this.span = wanted);
  }

  // What the reader predicted of a curve shown here.
  get guess() {
    const { guess } = this.board;
    return guess && this.curves.some(({ column }) => column === guess.channel) ? guess : null;
  }

  isArea(line) {
    return Boolean(this.plot.stacked) && line.style === "solid";
  }

  zoom(u) {
    const { left, width } = u.select;
    if (width < 4) return;
    const [from, to] = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
    u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.board.zoom(from, to);
  }

  // The curves shown are others: as the legend says.
  showCurves() {
    this.span = null;
    this.curves.forEach((curve, i) => this.uplot.setSeries(i + 1, { show: this.shows(curve) }));
    this.draw();
  }

  shows(curve) {
    return this.switches.shows(curve);
  }

  // Values at the cursor, or the latest ones.
  readOut(now) {
    const u = this.uplot;
    if (!u || (!now && performance.now() - this.readAt < READ_OUT_EVERY)) return;
    this.readAt = performance.now();
    const { idx, left } = u.cursor;
    const at = left >= 0 && idx !== null && idx !== undefined && u.data[0].length > 0 ? idx : null;
    this.switches.showValues(u, at);
    this.box.show(u, at);
  }

  summary() {
    const [t, ...all] = this.uplot?.data ?? [[]];
    if (!t.length) return `${this.plot.title}: no curves yet.`;
    const names = this.board.labels[this.plot.select];
    const parts = this.curves.map(({ line, c }, i) => {
      const which = this.components > 1 && c !== null ? `, ${this.plot.select} ${names?.[c] ?? c + 1}` : "";
      return `${speechText(symbol(line.mathml))}${which}: ${describeRange(all[i])} ${fillPlaceholders(this.plot.unit, this.board.labels, c)}`.trimEnd();
    });
    return joinSentences(`${this.plot.title} over time, ${formatNumber(t[0], 3)} s to ${formatNumber(t[t.length - 1], 3)} s`, parts);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.body;
    if (!width) return;
    if (this.uplot) this.uplot.setSize({ width, height });
    else if (this.board.run) this.rebuild();
  }
}

// What has no value is null to uPlot, which leaves a gap there.
function nanToNull(samples) {
  return samples.some(Number.isNaN) ? Array.from(samples, (value) => (Number.isNaN(value) ? null : value)) : samples;
}

function tick(value) {
  return Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3)
    ? formatNumber(value, 2)
    : String(+value.toFixed(6)).replace("-", "−");
}

function rem() {
  return parseFloat(getComputedStyle(document.documentElement).fontSize);
}
