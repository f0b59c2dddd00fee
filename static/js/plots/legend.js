// The legend of a time series: one entry a line with its value, or, of many components, lines and
// colours apart. Its entries show and hide their curves.

import { speechText } from "../figures/text_layout.js";
import { formatNumber } from "../format.js";
import { element } from "./card.js";
import { swatch } from "./marks.js";
import { SERIES } from "./palette.js";
import { fillPlaceholders } from "./placeholders.js";
import { symbol } from "./symbol.js";

export class Legend {
  // `toggled` hears that other curves are shown.
  constructor(plot, toggled) {
    this.plot = plot;
    this.toggled = toggled;
    this.hidden = new Set(); // lines and components switched off
    this.values = []; // [line, where its value is shown]
  }

  shows({ l, c }) {
    return !this.hidden.has(`l${l}`) && !this.hidden.has(`c${c}`);
  }

  showAll() {
    this.hidden.clear();
  }

  write() {
    const { plot } = this;
    const several = plot.components > 1;
    const lines = new Map(plot.curves.map((curve) => [curve.l, curve]));
    plot.legend.replaceChildren();
    this.values = [];
    for (const [l, { line, tone, series, c }] of lines) {
      const style = plot.isArea(line) ? "area" : line.style;
      const mark = plot.marked && !several && style !== "area" ? series : 0;
      const button = this.entry(`l${l}`, style, several && style !== "limit" ? "axis" : tone, mark);
      const math = button.appendChild(symbol(line.mathml, several ? null : c));
      button.setAttribute("aria-label", speechText(math));
      if (!several) this.values.push([l, button.appendChild(element("output", "", "—"))]);
    }
    const { labels } = plot.board;
    for (let c = 0; several && c < plot.components; c++) {
      const series = (c % SERIES) + 1;
      const button = this.entry(`c${c}`, "part", `series-${series}`, series);
      const name = labels[plot.plot.select]?.[c] ?? String(c + 1);
      button.append(name);
      button.setAttribute("aria-label", `${plot.plot.select} ${name}`.trim());
      if (!plot.unit && plot.plot.unit) button.append(element("small", "", fillPlaceholders(plot.plot.unit, labels, c)));
    }
  }

  entry(key, style, tone, series) {
    const button = element("button", style);
    button.type = "button";
    button.append(swatch(style, `var(--${tone})`, series));
    button.setAttribute("aria-pressed", String(!this.hidden.has(key)));
    button.title = "Show or hide";
    button.addEventListener("click", () => {
      if (!this.hidden.delete(key)) this.hidden.add(key);
      button.setAttribute("aria-pressed", String(!this.hidden.has(key)));
      this.toggled();
    });
    this.plot.legend.append(button);
    return button;
  }

  // The value of each line at a sample, or the latest.
  showValues({ data }, at) {
    for (const [l, output] of this.values) {
      const samples = data[this.plot.curves.findIndex((curve) => curve.l === l) + 1];
      const text = formatNumber(samples[at ?? samples.length - 1]);
      if (output.textContent !== text) output.textContent = text;
    }
  }
}
