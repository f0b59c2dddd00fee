// Scalars as a row of tiles; a dash where a number is not defined (yet).

import { number } from "../format.js";
import { element } from "./card.js";

export class Readouts {
  constructor(plots, host) {
    this.tiles = plots.map(({ channel, label, unit, whole }) => {
      const tile = element("div", "tile");
      const name = element("span", "", label);
      name.title = label;
      const line = element("div");
      const output = element("output", "", "—");
      output.setAttribute("aria-label", label);
      line.append(output, " ", element("small", "", unit));
      tile.append(name, line);
      host.append(tile);
      return { tile, label, channel, output, whole };
    });
    host.hidden = plots.length === 0;
  }

  // Marks the one of this label; none for "".
  mark(wanted) {
    for (const { tile, label } of this.tiles) tile.classList.toggle("marked", label === wanted);
  }

  update(run, now) {
    for (const { channel, output, whole } of this.tiles) {
      const value = now ? now[run.columns.indexOf(channel)] : run.latest(channel);
      const text = whole && Number.isInteger(value) ? String(value) : number(value, 3);
      if (output.textContent !== text) output.textContent = text;
    }
  }
}
