// Which plots are pinned in view, and the tabs of all others. A tab pins its plot; the one that was
// pinned first makes room, unless an experiment watches it.

import { element } from "./card.js";

const PINNED = 2;

export class Shelf {
  constructor(plots, tabs, changed) {
    this.plots = plots;
    this.changed = changed;
    this.watched = [];
    this.pinned = plots.slice(0, PINNED);
    this.tabs = plots.map((plot) => {
      const tab = element("button", "", plot.plot.title);
      tab.type = "button";
      tab.title = plot.plot.title;
      tab.addEventListener("click", () => (this.pinned.includes(plot) ? this.unpin(plot) : this.pin(plot)));
      tabs?.append(tab);
      return tab;
    });
    this.show();
  }

  watch(plots) {
    this.watched = plots.slice(0, PINNED);
    for (const plot of [...this.watched].reverse()) {
      this.pinned = [plot, ...this.pinned.filter((other) => other !== plot)].slice(0, PINNED);
    }
    this.show();
  }

  pin(plot) {
    const kept = [...this.pinned];
    if (kept.length >= PINNED) {
      const leaving = kept.find((other) => !this.watched.includes(other)) ?? kept[0];
      kept.splice(kept.indexOf(leaving), 1);
    }
    this.pinned = [...kept, plot];
    this.show();
  }

  unpin(plot) {
    if (this.pinned.length === 1) return; // one plot stays
    this.pinned = this.pinned.filter((other) => other !== plot);
    this.show();
  }

  show() {
    this.plots.forEach((plot, i) => {
      const place = this.pinned.indexOf(plot);
      plot.section.hidden = place < 0;
      plot.section.style.order = place;
      this.tabs[i].setAttribute("aria-pressed", String(place >= 0));
    });
    this.changed();
  }
}
