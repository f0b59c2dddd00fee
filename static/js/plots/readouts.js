// Scalars as a row of tiles; a dash where a number is not defined (yet).

import { formatNumber } from "../format.js";
import { element } from "./card.js";
import { fillPlaceholders, isShown } from "./placeholders.js";

export class Readouts {
  constructor(plots, host) {
    this.tiles = plots.map((plot) => {
      const tile = element("div", "tile");
      const name = element("span");
      const line = element("div");
      const output = element("output", "", "—");
      const small = element("small");
      line.append(output, " ", small);
      tile.append(name, line);
      host.append(tile);
      return { plot, tile, name, output, small };
    });
    host.hidden = plots.length === 0;
    this.relabel({});
  }

  // The names and units as the parameters have them.
  relabel(labels) {
    for (const { plot, name, output, small } of this.tiles) {
      const label = fillPlaceholders(plot.label, labels);
      name.textContent = name.title = label;
      output.setAttribute("aria-label", label);
      small.textContent = fillPlaceholders(plot.unit, labels);
    }
  }

  // Those that mean something under these parameters.
  choose(params) {
    for (const { plot, tile } of this.tiles) tile.hidden = !isShown(plot, params);
  }

  // Marks the one of this label; none for "".
  mark(wanted) {
    for (const { plot, tile } of this.tiles) tile.classList.toggle("marked", plot.label === wanted);
  }

  update(run, now) {
    for (const { plot: { channel, whole }, output } of this.tiles) {
      const value = now ? now[run.columns.indexOf(channel)] : run.latest(channel);
      const text = whole && Number.isInteger(value) ? String(value) : formatNumber(value, 3);
      if (output.textContent !== text) output.textContent = text;
    }
  }
}
