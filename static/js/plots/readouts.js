// Scalars as a row of tiles; a dash where a number is not defined (yet).

import { number } from "../format.js";
import { element } from "./card.js";

export class Readouts {
  constructor(plots, host) {
    this.tiles = plots.map(({ channel, label, unit }) => {
      const tile = element("div", "tile");
      const name = element("span", "", label);
      name.title = label;
      const line = element("div");
      const output = element("output", "", "—");
      output.setAttribute("aria-label", label);
      line.append(output, " ", element("small", "", unit));
      tile.append(name, line);
      host.append(tile);
      return { channel, output };
    });
    host.hidden = plots.length === 0;
  }

  update(run) {
    for (const { channel, output } of this.tiles) {
      const text = number(run.latest(channel), 3);
      if (output.textContent !== text) output.textContent = text;
    }
  }
}
