// All plots of a lab: keeps the samples of this run and the one before, and what they have in
// common, the stretch of time shown and the component chosen.

import { SampleBuffer } from "../sample_buffer.js";
import { Bars } from "./bars.js";
import { element } from "./card.js";
import { Curves } from "./curves.js";
import { HeatMap } from "./heatmap.js";
import { Matrix } from "./matrix.js";
import { Note } from "./note.js";
import { clearColourCache } from "./palette.js";
import { isShown } from "./placeholders.js";
import { PlotTabs } from "./plot_tabs.js";
import { ReadoutRow } from "./readout_row.js";
import { Readouts } from "./readouts.js";
import { summarise } from "./summary.js";
import { TimeSeries } from "./timeseries.js";

const WORDS_EVERY = 2000; // [ms]
const LONGEST_WAIT = 50; // [ms] for what a change has done
const KINDS = { TimeSeries, Curves, Bars, Matrix, HeatMap, Note };

export class PlotBoard {
  // `isFresh` tells whether what was received shows the last change already.
  constructor(lab, isFresh) {
    this.lab = lab;
    this.isFresh = isFresh;
    this.drawn = 0; // [ms] when the plots were drawn last
    this.run = this.ghost = null;
    this.number = null; // counts restarts, as the server does
    this.window = 10;
    this.zoomed = null;
    this.selection = {};
    this.guess = null; // what the reader predicted: {channel, levels} or {channel, x, y}
    this.compared = null; // the run an experiment compares with, and beside which run
    this.labels = {}; // what the lab says under its present parameters
    this.said = "{}";
    this.readouts = new Readouts(lab.plots.filter((p) => p.kind === "Readout"), document.getElementById("tiles"));
    new ReadoutRow();
    this.plots = lab.plots.filter((p) => p.kind in KINDS).map((p) => new KINDS[p.kind](p, this));
    document.getElementById("plots").append(...this.plots.map((plot) => plot.section));
    this.plotTabs = new PlotTabs(lab.slug, this.plots, () => this.rearranged());
    this.series = this.plots.filter((plot) => plot instanceof TimeSeries);
    this.fieldPlots = this.plots.filter((plot) => plot.update);
    setInterval(() => summarise(this.plotTabs.shown), WORDS_EVERY);
    this.unzoomButton = document.getElementById("unzoom");
    this.unzoomButton?.addEventListener("click", () => this.unzoom());
    const select = (this.windowMenu = document.getElementById("window"));
    select?.addEventListener("change", () => this.setWindow(Number(select.value)));
    for (const tool of document.querySelectorAll("#tools .of-time")) tool.hidden = this.series.length === 0;
  }

  hello({ columns }) {
    const same = this.run && columns.join() === this.run.columns.join();
    if (same) return;
    this.run = new SampleBuffer(columns);
    this.ghost = null;
    this.writeSelectors();
    for (const plot of this.series) plot.rebuild();
  }

  telemetry({ run, rows, now, fields }) {
    if (!this.run) return;
    if (now || rows.length) this.now = now; // between two samples, while time stands still
    for (const row of rows) {
      const restarted = run !== this.number || (this.run.length > 0 && row[0] < this.run.last);
      if (restarted) this.begin(run);
      if (!this.run.length || row[0] > this.run.last) this.run.push(row);
    }
    if (fields) this.relabel(fields);
    if (fields) for (const plot of this.fieldPlots) plot.update(fields);
    if (rows.length || now) this.refresh();
  }

  // Of the fields, the words: texts and lists of texts that are no notes.
  relabel(fields) {
    const notes = this.plots.map(({ plot }) => plot.note);
    const isWord = ([name, value]) => typeof [value].flat()[0] === "string" && !notes.includes(name);
    const words = Object.fromEntries(Object.entries(fields).filter(isWord));
    const said = JSON.stringify(words);
    if (said === this.said) return;
    [this.labels, this.said] = [words, said];
    this.readouts.relabel(words);
    this.writeSelectors();
    for (const plot of this.series) plot.rebuild();
  }

  // Shows what means something under these parameters.
  choose(params) {
    const key = JSON.stringify(params);
    if (key === this.params) return;
    this.params = key;
    this.readouts.choose(params);
    this.plotTabs.choose(this.plots.filter(({ plot }) => isShown(plot, params)));
  }

  // Another run: what was drawn so far turns into the faint trace.
  begin(number) {
    this.number = number;
    if (this.run.length > 1) this.ghost = this.run;
    if (this.compared?.run === number) this.ghost = this.compared.history;
    this.run = new SampleBuffer(this.run.columns);
    this.zoomed = null;
  }

  // A run was made to compare with: it is the faint trace.
  compare({ run, columns, rows }) {
    const history = new SampleBuffer(columns);
    for (const row of rows) history.push(row);
    this.compared = { run, history };
    if (run === this.number) this.ghost = history;
    this.refresh();
  }

  clear() {
    if (!this.run) return;
    this.run = new SampleBuffer(this.run.columns);
    this.ghost = null;
    for (const plot of this.series) plot.span = null;
    for (const plot of this.fieldPlots) plot.clear();
    this.unzoom();
  }

  // [s]; 0 for all.
  setWindow(seconds) {
    this.window = seconds;
    const menu = this.windowMenu;
    if (menu && ![...menu.options].some(({ value }) => Number(value) === seconds)) menu.add(new Option(`${seconds} s`, seconds));
    if (menu) menu.value = seconds;
    this.unzoom();
  }

  // The stretch of time all time series show.
  range() {
    if (this.zoomed) return this.zoomed;
    const { first, last } = this.run;
    if (this.window) return [Math.max(0, last - this.window), Math.max(last, this.window)];
    const end = Math.max(last, this.ghost?.last ?? 0);
    return [Math.min(first, end - 1e-3), Math.max(end, first + 1)];
  }

  zoom(from, to) {
    this.zoomed = [from, to];
    this.refresh();
  }

  unzoom() {
    this.zoomed = null;
    this.refresh();
  }

  // Other plots are in view.
  rearranged() {
    this.writeSelectors();
    this.refresh();
  }

  // Draws at the next frame, however often it is asked to.
  refresh() {
    if (this.unzoomButton) this.unzoomButton.hidden = !this.zoomed;
    if (this.pending || !this.run) return;
    this.pending = requestAnimationFrame((now) => {
      this.pending = 0;
      // Drawing would hold up the very news it should show: it waits for them.
      if (!this.isFresh() && now - this.drawn < LONGEST_WAIT) return this.refresh();
      this.drawn = now;
      for (const plot of this.series) plot.draw();
      this.readouts.update(this.run, this.now);
    });
  }

  retheme() {
    clearColourCache();
    for (const plot of this.plots) plot.rebuild?.();
  }

  // Shows a reader where to look: the plots of these titles, and the read-out of this label.
  watch(titles, label) {
    const wanted = titles.map((title) => this.find(title));
    for (const plot of this.plots) plot.section.classList.toggle("watched", wanted.includes(plot));
    this.plotTabs.watch(wanted);
    this.readouts.mark(label);
  }

  find(title) {
    return this.plots.find(({ plot }) => plot.title === title);
  }

  // Shows what the reader predicted in the plots of its channel; null for nothing.
  mark(guess) {
    this.guess = guess;
    this.refresh();
  }

  // A channel of this run up to a time [s].
  curve(channel, until) {
    const t = this.run.column("t");
    const n = t.findLastIndex((time) => time <= until + 1e-6) + 1;
    return { t: t.subarray(0, n), y: this.run.column(channel)?.subarray(0, n) ?? [] };
  }

  // A channel's "last", "min", "max" or "peak" value so far, up to a time [s]; null for none.
  read(channel, of, until) {
    const now = this.now?.[this.run.columns.indexOf(channel)];
    const values = [...this.curve(channel, until).y, ...(now === undefined ? [] : [now])].filter(Number.isFinite);
    if (!values.length) return null;
    if (of === "last") return values.at(-1);
    if (of === "peak") return values.reduce((most, v) => Math.max(most, Math.abs(v)), 0);
    return values.reduce((a, b) => Math[of](a, b));
  }

  // [s] of what is shown.
  get time() {
    return this.now?.[0] ?? this.run?.last ?? 0;
  }

  // The component chosen for plots whose components share this name: an index, or "all".
  selected(select) {
    return select ? this.selection[select] ?? "all" : null;
  }

  // What the plots in view choose from.
  writeSelectors() {
    const host = document.getElementById("selectors");
    if (!host || !this.run) return;
    const counts = {};
    for (const { plot, section } of this.series) {
      if (!plot.select || section.hidden) continue;
      const n = Math.max(...plot.lines.map((line) => this.run.components(line.channel) ?? 0));
      if (n > 1) counts[plot.select] = Math.max(counts[plot.select] ?? 0, n);
    }
    host.replaceChildren(...Object.entries(counts).map(([name, n]) => this.selector(name, n)));
  }

  // Buttons for numbers, a menu for names.
  selector(name, n) {
    if (this.selected(name) >= n) delete this.selection[name];
    const names = this.labels[name];
    if (names?.some((word, i) => word !== String(i + 1))) return this.menu(name, names);
    const field = element("fieldset", "segments");
    field.append(element("legend", "", name));
    for (const value of [...Array(n).keys(), "all"]) {
      const label = element("label");
      const radio = element("input");
      radio.type = "radio";
      radio.name = `select-${name}`;
      radio.checked = this.selected(name) === value;
      radio.addEventListener("change", () => this.select(name, value));
      label.append(radio, element("span", "", value === "all" ? "all" : String(value + 1)));
      field.append(label);
    }
    return field;
  }

  menu(name, names) {
    const menu = element("select", "small");
    menu.setAttribute("aria-label", name);
    menu.title = `Which ${name}`;
    menu.append(new Option(`all: ${name}`, "all"), ...names.map((word, i) => new Option(word, i)));
    menu.value = this.selected(name);
    menu.addEventListener("change", () => this.select(name, menu.value === "all" ? "all" : Number(menu.value)));
    return menu;
  }

  select(name, value) {
    this.selection[name] = value;
    for (const plot of this.series) {
      if (plot.plot.select !== name) continue;
      plot.span = null;
      plot.switches.showAll();
      plot.rebuild();
    }
  }
}
