// What a lab says of its world, in sentences.

import { wrapText } from "../figures/text_layout.js";
import { card, element } from "./card.js";
import { em } from "./chart.js";

export class Note {
  constructor(plot) {
    this.plot = plot;
    Object.assign(this, card(plot.title, "", "canvas tall note"));
    this.body.tabIndex = 0; // it may scroll
  }

  update(fields) {
    const text = fields[this.plot.note];
    if (text === undefined || text === this.text) return;
    this.text = text;
    this.body.replaceChildren(...text.split("\n").map((line) => element("p", "", line)));
  }

  // In lines of a figure as wide as this [px].
  lines(width) {
    return wrapText(this.text ?? "", width - 2 * em());
  }

  paint(chart) {
    const { width, em } = chart.clear();
    this.lines(width).forEach((line, i) => {
      chart.text(em, (1.2 + 1.5 * i) * em, line, "start").setAttribute("class", "sentence");
    });
  }

  // [px] of it as vectors.
  figureHeight(width) {
    return (this.lines(width).length * 1.5 + 0.7) * em();
  }

  clear() {}
}
