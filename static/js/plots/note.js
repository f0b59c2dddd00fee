// What a lab says of its world, in sentences.

import { card, element } from "./card.js";

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

  clear() {}
}
