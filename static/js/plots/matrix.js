// A small matrix in digits, its cells shaded by their values if asked for.

import { card, element } from "./card.js";
import { diverging } from "./palette.js";
import { symbol } from "./symbol.js";

export class Matrix {
  constructor(plot) {
    this.plot = plot;
    Object.assign(this, card(plot.title, plot.unit, "matrix"));
    if (plot.mathml) this.legend.append(symbol(plot.mathml));
    this.table = this.body.appendChild(element("table", plot.shade ? "shaded" : ""));
  }

  update(fields) {
    const rows = fields[this.plot.field];
    const names = fields[this.plot.rows] ?? null;
    if (!rows) return;
    const cells = rows.map((row) => [row].flat());
    const largest = Math.max(...cells.flat().map((value) => Math.abs(value ?? 0)), 1e-9);
    [this.cells, this.largest] = [cells, largest];
    const decimals = decimalsFor(largest);
    const shape = JSON.stringify([names, cells.length, cells[0]?.length]);
    if (shape !== this.shape) {
      this.shape = shape;
      this.digits = 0;
      this.table.replaceChildren(...cells.map((row, i) => {
        const made = element("tr");
        if (names) made.append(element("th", "", names[i]));
        made.append(...row.map(() => element("td")));
        return made;
      }));
    }
    const texts = cells.map((row) => row.map((value) => digits(value, decimals)));
    this.size(texts, names ?? []);
    cells.forEach((row, i) => row.forEach((value, j) => {
      const text = texts[i][j];
      const cell = this.table.rows[i].cells[j + (names ? 1 : 0)];
      if (cell.textContent !== text) cell.textContent = text;
      if (this.plot.shade) cell.style.backgroundColor = diverging((value ?? 0) / largest);
    }));
  }

  // The same as vectors, between the lines that a matrix has at its sides.
  paint(chart) {
    if (!this.cells) return;
    const { width, em } = chart.clear();
    const texts = [...this.table.rows].map((row) => [...row.cells].map((cell) => cell.textContent));
    const named = this.table.rows[0].cells[0]?.localName === "th";
    const high = (this.figureHeight() - 0.6 * em) / texts.length;
    const longest = (column) => Math.max(...texts.map((row) => row[column].length));
    const widths = texts[0].map((_, j) => (0.62 * longest(j) + 1) * em);
    const whole = widths.reduce((a, b) => a + b);
    const shrink = Math.min(1, (width - 2 * em) / whole);
    let left = (width - shrink * whole) / 2;
    const side = (x) => chart.add("line", { x1: x, x2: x, y1: 0.3 * em, y2: 0.3 * em + texts.length * high, class: "side" });
    widths.forEach((full, j) => {
      const wide = shrink * full;
      if (j === Number(named)) side(left);
      texts.forEach((row, i) => {
        const y = 0.3 * em + i * high;
        const level = named ? j - 1 : j;
        if (this.plot.shade && level >= 0) {
          const style = `fill: ${diverging((this.cells[i][level] ?? 0) / this.largest)}`;
          chart.add("rect", { x: left + 0.5, y: y + 0.5, width: wide - 1, height: high - 1, style });
        }
        const text = chart.text(left + wide - 0.5 * shrink * em, y + high / 2 + 0.35 * em, row[j], "end");
        if (level >= 0) text.setAttribute("class", "digits");
        text.style.fontSize = `${shrink * em}px`;
      });
      left += wide;
    });
    side(left);
  }

  // [px] of it as vectors.
  figureHeight() {
    return this.table.rows.length * 22 + 8;
  }

  // What the style sheet needs to fit it into the card. A column never becomes narrower again while
  // its shape stays: digits that come and go would make the whole pulsate.
  size(texts, names) {
    const longest = (all) => Math.max(0, ...all.map((text) => text.length));
    this.digits = Math.max(this.digits, longest(texts.flat()));
    const columns = texts[0].length + (names.length ? longest(names) / this.digits : 0);
    for (const [name, value] of Object.entries({ columns, rows: texts.length, digits: this.digits })) {
      this.table.style.setProperty(`--${name}`, value);
    }
  }

  clear() {}
}

// All entries have the same decimals, three digits of the largest: columns stand in line.
function decimalsFor(largest) {
  return Math.min(8, Math.max(0, 2 - Math.floor(Math.log10(largest))));
}

function digits(value, decimals) {
  if (!Number.isFinite(value)) return "—";
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? "0" : text.replace("-", "−");
}
