// A field over a plane, on Plotly, which is large: it is loaded once such a plot comes into view.

/* global Plotly */
import { card } from "./card.js";
import { fill } from "./labels.js";
import { colour } from "./palette.js";
import { extent, sentences } from "./summary.js";

const RIM = "#14171c";
const EVERY = 250; // [ms] between redraws

// The colours of values in the scene too (labs/colors.py), from the least to the largest.
const SEQUENTIAL = ["#2b2459", "#363d7d", "#3d589e", "#3477a0", "#35949d", "#56ad8f", "#82c381", "#bcd67c", "#f2e873"]
  .map((tone, place, { length }) => [place / (length - 1), tone]);

let loading = null;

function load(address) {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = address;
    script.onload = resolve;
    script.onerror = () => reject(new Error("The plotting library did not load."));
    document.head.append(script);
  });
  return loading;
}

export class HeatMap {
  constructor(plot, board) {
    this.plot = plot;
    Object.assign(this, card(plot.title, "", "canvas tall"));
    this.drawnAt = 0;
    new IntersectionObserver(async ([entry]) => {
      this.visible = entry.isIntersecting;
      if (!this.visible) return;
      try {
        await load(board.lab.vendor.plotly);
        this.ready = true;
        this.draw();
      } catch (error) {
        this.body.textContent = error.message;
      }
    }).observe(this.body);
    new ResizeObserver(() => this.draw(true)).observe(this.body);
  }

  update(fields) {
    const { x, y, z, arrows } = this.plot;
    if (!fields[z]) return;
    this.data = { x: fields[x], y: fields[y], z: fields[z] };
    this.arrows = arrows ? fields[arrows] : [];
    this.labels = [this.plot.x_label, this.plot.y_label, this.plot.z_label].map((text) => fill(text, fields));
    this.draw();
  }

  rebuild() {
    this.draw(true);
  }

  draw(now = false) {
    if (!this.ready || !this.visible || !this.data) return;
    if (!now && performance.now() - this.drawnAt < EVERY) return;
    this.drawnAt = performance.now();
    const [xLabel, yLabel, zLabel] = this.labels;
    const size = 0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize);
    const axis = (text) => ({ title: { text, standoff: 6 }, gridcolor: colour("grid"), zeroline: false, ticks: "" });
    const trace = {
      type: "heatmap", ...this.data, colorscale: SEQUENTIAL,
      colorbar: { title: { text: zLabel }, thickness: 10, outlinewidth: 0 },
    };
    const layout = {
      width: this.body.clientWidth, height: this.body.clientHeight,
      margin: { l: 4.5 * size, r: size, t: 0.75 * size, b: 3.6 * size },
      showlegend: false, paper_bgcolor: "transparent", plot_bgcolor: "transparent",
      font: { family: "system-ui, sans-serif", size, color: colour("axis") },
      xaxis: axis(xLabel), yaxis: { ...axis(yLabel), autorange: this.plot.downward ? "reversed" : true }, uirevision: "keep",
    };
    Plotly.react(this.body, [trace, ...this.arrowTraces()], layout, { displayModeBar: false, doubleClick: "reset" });
  }

  // The arrows, white with a dark rim: they stand out on every colour of the map. Each is as long as
  // its neighbours leave room for; what leads nowhere is a dot.
  arrowTraces() {
    if (!this.arrows.length) return [];
    const { clientWidth: width, clientHeight: height } = this.body;
    const [stepX, stepY] = [0, 1].map((i) => spacing(this.arrows.map((arrow) => arrow[i])));
    const lines = { x: [], y: [] };
    for (const [x, y, right, up] of this.arrows) {
      const [dx, dy] = [0.36 * stepX * right, 0.36 * stepY * up];
      lines.x.push(x - dx, x + dx, null);
      lines.y.push(y - dy, y + dy, null);
    }
    const extent = (values) => Math.abs(values.at(-1) - values[0]) || 1;
    // In pixels, about: of the body, so much is the map's.
    const [across, upward] = [(0.7 * width * stepX) / extent(this.data.x), (0.6 * height * stepY) / extent(this.data.y)];
    const leads = this.arrows.map(([, , right, up]) => right !== 0 || up !== 0);
    const room = Math.min(10, Math.max(6, 0.5 * Math.min(across, upward)));
    const traced = { type: "scatter", hoverinfo: "skip", ...lines, mode: "lines" };
    return [
      { ...traced, line: { color: RIM, width: 3.5 } },
      { ...traced, line: { color: "#ffffff", width: 1.75 } },
      {
        type: "scatter", hoverinfo: "skip", mode: "markers",
        x: this.arrows.map((_, i) => lines.x[3 * i + 1]), y: this.arrows.map((_, i) => lines.y[3 * i + 1]),
        marker: {
          symbol: leads.map((yes) => (yes ? "arrow" : "circle")), size: leads.map((yes) => (yes ? room : 4)),
          angle: this.arrows.map(([, , right, up]) => (180 / Math.PI) * Math.atan2(right * across, up * upward)),
          color: "#ffffff", opacity: 1, line: { color: RIM, width: 0.75 },
        },
      },
    ];
  }

  summary() {
    if (!this.data) return "";
    const [xLabel, yLabel, zLabel] = this.labels;
    const { x, y, z } = this.data;
    const parts = [`${zLabel} ${extent(z.flat()).replace(/, last.*/, "")}`, `${x.length} columns and ${y.length} rows`];
    if (this.plot.arrows) parts.push(`${this.arrows.length} arrows`);
    return sentences(`${this.plot.title}: a map over ${xLabel} and ${yLabel}`, parts);
  }

  clear() {}
}

// The least distance of two places that differ.
function spacing(places) {
  const sorted = [...new Set(places)].sort((a, b) => a - b);
  return sorted.length > 1 ? Math.min(...sorted.slice(1).map((place, i) => place - sorted[i])) : 1;
}
