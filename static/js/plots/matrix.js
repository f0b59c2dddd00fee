// A small matrix in digits.

import { number } from "../format.js";
import { card, element } from "./card.js";
import { symbol } from "./symbol.js";

export class Matrix {
  constructor(plot) {
    this.plot = plot;
    Object.assign(this, card(plot.title, plot.unit, "matrix"));
    if (plot.mathml) this.legend.append(symbol(plot.mathml));
    this.table = this.body.appendChild(element("table"));
  }

  update(fields) {
    const rows = fields[this.plot.field];
    if (!rows) return;
    const cells = rows.map((row) => [row].flat());
    if (this.table.rows.length !== cells.length || this.table.rows[0]?.cells.length !== cells[0].length) {
      this.table.replaceChildren(...cells.map((row) => {
        const made = element("tr");
        made.append(...row.map(() => element("td")));
        return made;
      }));
    }
    cells.forEach((row, i) => row.forEach((value, j) => {
      const text = number(value, 3);
      const cell = this.table.rows[i].cells[j];
      if (cell.textContent !== text) cell.textContent = text;
    }));
  }

  clear() {}
}
