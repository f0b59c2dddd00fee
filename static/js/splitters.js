// The borders between article, knobs and stage, and between scene and plots: dragged, or moved by
// arrow keys; a double click or Enter puts one back. Where they are is kept in this browser, as
// parts of the window. The style sheet keeps every part of the page wide and high enough to use.

import { storeData, storedData } from "./store.js";

const KEY = "layout";
const STEP = 0.02;

// By name: the part it resizes, and its least and largest share of the layout.
const BORDERS = {
  article: { part: ".reading", least: 0.2, most: 0.42 },
  knobs: { part: ".knobs", least: 0.13, most: 0.28 },
  scene: { part: ".view", least: 0.2, most: 0.68 },
};

export function wireSplitters() {
  const layout = document.querySelector(".layout");
  const kept = storedData(KEY, {});
  for (const splitter of layout.querySelectorAll("[role=separator]")) {
    new Splitter(splitter, layout, kept);
  }
}

class Splitter {
  constructor(splitter, layout, kept) {
    this.name = splitter.dataset.border;
    Object.assign(this, { splitter, layout, kept, ...BORDERS[this.name] });
    this.sized = layout.querySelector(this.part);
    this.across = splitter.getAttribute("aria-orientation") === "vertical";
    splitter.setAttribute("aria-valuemin", Math.round(100 * this.least));
    splitter.setAttribute("aria-valuemax", Math.round(100 * this.most));
    splitter.addEventListener("pointerdown", (event) => this.grab(event));
    splitter.addEventListener("dblclick", () => this.reset());
    splitter.addEventListener("keydown", (event) => this.press(event));
    if (Number.isFinite(kept[this.name])) this.put(kept[this.name]);
    new ResizeObserver(() => splitter.setAttribute("aria-valuenow", Math.round(100 * this.share))).observe(this.sized);
  }

  // Of the layout, that the part has now.
  get share() {
    const { sized, layout } = this;
    return this.across ? sized.offsetWidth / layout.offsetWidth : sized.offsetHeight / layout.offsetHeight;
  }

  put(share) {
    const within = Math.min(this.most, Math.max(this.least, share));
    this.layout.style.setProperty(`--${this.name}`, `${(100 * within).toFixed(2)}%`);
    this.layout.dataset[this.name] = "set";
    this.kept[this.name] = within;
  }

  storeShares() {
    storeData(KEY, this.kept);
  }

  reset() {
    this.layout.style.removeProperty(`--${this.name}`);
    delete this.layout.dataset[this.name];
    delete this.kept[this.name];
    this.storeShares();
  }

  grab(event) {
    if (event.button !== 0) return;
    event.preventDefault();
    this.splitter.focus({ preventScroll: true });
    const place = (at) => (this.across ? at.clientX / this.layout.offsetWidth : at.clientY / this.layout.offsetHeight);
    const begin = { share: this.share, at: place(event) };
    // The scene, a page of its own, would swallow the pointer.
    document.documentElement.classList.add("splitting");
    this.splitter.setPointerCapture(event.pointerId);
    const move = (at) => this.put(begin.share + place(at) - begin.at);
    const end = () => {
      document.documentElement.classList.remove("splitting");
      this.splitter.removeEventListener("pointermove", move);
      this.storeShares();
    };
    this.splitter.addEventListener("pointermove", move);
    this.splitter.addEventListener("lostpointercapture", end, { once: true });
  }

  press(event) {
    const [less, more] = this.across ? ["ArrowLeft", "ArrowRight"] : ["ArrowUp", "ArrowDown"];
    const to = { [less]: this.share - STEP, [more]: this.share + STEP, Home: this.least, End: this.most }[event.key];
    if (to !== undefined) this.put(to);
    else if (event.key === "Enter") this.reset();
    else return;
    event.preventDefault();
    event.stopPropagation();
    this.storeShares();
  }
}
