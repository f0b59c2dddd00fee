// Which plots are pinned in view, two or four, and the tabs of all others. A tab pins its plot; the
// one that was pinned first makes room, unless an experiment watches it. What the reader pins is
// kept in this browser.

import { storeData, storedData } from "../store.js";
import { element } from "./card.js";

export class PlotTabs {
  constructor(slug, plots, changed) {
    this.key = `plots:${slug}`;
    this.plots = this.present = plots; // all, and those that mean something now
    this.changed = changed;
    this.watched = [];
    const kept = storedData(this.key, {});
    this.room = kept.room === 4 ? 4 : 2;
    const known = plots.filter(({ plot }) => kept.pinned?.includes(plot.title));
    this.pinned = known.length ? known : plots;
    const tabs = document.getElementById("tabs");
    this.tabs = plots.map((plot) => {
      const tab = element("button", "", plot.plot.title);
      tab.type = "button";
      tab.title = plot.plot.title;
      tab.addEventListener("click", () => {
        if (this.shown.includes(plot)) this.unpin(plot);
        else this.pin(plot);
        this.storePinned();
      });
      tabs?.append(tab);
      return tab;
    });
    this.four = document.getElementById("four");
    this.four?.addEventListener("click", () => {
      this.room = this.room === 4 ? 2 : 4;
      // More room is filled from the tabs.
      this.pinned = [...this.shown, ...this.present.filter((plot) => !this.shown.includes(plot))];
      this.storePinned();
      this.show();
    });
    this.show();
  }

  // The plots in view.
  get shown() {
    const pinned = this.pinned.filter((plot) => this.present.includes(plot));
    return (pinned.length ? pinned : this.present).slice(0, this.room);
  }

  // The plots that mean something under the present parameters.
  choose(plots) {
    if (plots.length === this.present.length && plots.every((plot) => this.present.includes(plot))) return;
    this.present = plots;
    this.show();
  }

  watch(plots) {
    this.watched = plots.slice(0, this.room);
    this.pinned = [...this.watched, ...this.shown.filter((plot) => !this.watched.includes(plot))];
    this.show();
    this.tabs[this.plots.indexOf(this.watched[0])]?.scrollIntoView({ block: "nearest", inline: "start" });
  }

  pin(plot) {
    const kept = [...this.shown];
    if (kept.length >= this.room) {
      const leaving = kept.find((other) => !this.watched.includes(other)) ?? kept[0];
      kept.splice(kept.indexOf(leaving), 1);
    }
    this.pinned = [...kept, plot];
    this.show();
  }

  unpin(plot) {
    if (this.shown.length === 1) return; // one plot stays
    this.pinned = this.shown.filter((other) => other !== plot);
    this.show();
  }

  storePinned() {
    storeData(this.key, { room: this.room, pinned: this.shown.map(({ plot }) => plot.title) });
  }

  show() {
    const { shown } = this;
    this.plots.forEach((plot, i) => {
      const place = shown.indexOf(plot);
      plot.section.hidden = place < 0;
      plot.section.style.order = place;
      plot.section.classList.toggle("first", place === 0);
      this.tabs[i].hidden = !this.present.includes(plot);
      this.tabs[i].setAttribute("aria-pressed", String(place >= 0));
    });
    this.four?.setAttribute("aria-pressed", String(this.room === 4));
    document.getElementById("plots").classList.toggle("four", shown.length > 2);
    if (this.four) this.four.hidden = this.present.length < 3;
    for (const plot of [...shown].reverse()) reveal(this.tabs[this.plots.indexOf(plot)]);
    this.changed();
  }
}

// Scrolls the row of tabs, and nothing else, to where this one is whole.
function reveal(tab) {
  const row = tab.parentElement;
  if (!row) return;
  const [own, all] = [tab, row].map((part) => part.getBoundingClientRect());
  row.scrollLeft += Math.min(0, own.left - all.left) + Math.max(0, Math.min(own.right - all.right, own.left - all.left));
}
