// The box beside a time series' cursor: the time, and in the plot one points at all its curves'
// values there.

import { formatNumber } from "../format.js";
import { element } from "./card.js";
import { colour } from "./palette.js";
import { symbol } from "./symbol.js";

export class CursorBox {
  constructor(plot) {
    this.plot = plot;
    this.box = element("div", "reading-box");
    this.box.hidden = true;
  }

  // Moves it into a new chart.
  enter(u) {
    u.over.append(this.box);
  }

  // `at` is the index of a sample; null where there is no cursor.
  show(u, at) {
    const { plot, box } = this;
    box.hidden = at === null;
    if (at === null) return;
    const rows = plot.components > 1 ? plot.curves.filter((_, i) => u.series[i + 1].show) : [];
    box.replaceChildren(element("b", "", `t = ${u.data[0][at].toFixed(3)} s`));
    // Only the plot one points at lists all its curves; the others tell the time alone.
    if (u.over.matches(":hover")) {
      for (const curve of rows.filter((curve) => curve.line.style !== "limit")) {
        const entry = element("span");
        entry.style.color = colour(curve.tone);
        entry.style.gridColumn = curve.l + 1;
        entry.append(symbol(curve.line.mathml, curve.c));
        entry.append(element("output", "", formatNumber(u.data[plot.curves.indexOf(curve) + 1][at], 3)));
        box.append(entry);
      }
    }
    box.style.gridTemplateColumns = `repeat(${rows.length ? plot.plot.lines.length : 1}, auto)`;
    const right = u.cursor.left > u.over.clientWidth / 2;
    box.style.insetInline = right ? "0.25rem auto" : "auto 0.25rem";
  }
}
