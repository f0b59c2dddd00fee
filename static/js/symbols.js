// A symbol in the article is its knob: pointing at it, a tap or Enter opens its row in place;
// dragged sideways it changes its value; and it can show that value in the formula.

import { shortNumber } from "./format.js";
import { acts } from "./knob_column.js";
import { placeBeside } from "./menus.js";
import { store, stored } from "./store.js";
import { positionOf, valueAt } from "./scales.js";

const LENGTH = 240; // [px] that a drag takes from one end of a track to the other
const DRAG_THRESHOLD = 5; // [px] before a press becomes a drag
const OPEN_DELAY = 150; // [ms] the mouse rests before the row opens,
const CLOSE_DELAY = 300; // and is away before it closes

export class Symbols {
  constructor(lab, knobs) {
    this.tunables = new Map(lab.params.map((tunable) => [tunable.name, tunable]));
    this.knobs = knobs;
    this.article = document.getElementById("article");
    this.box = document.getElementById("symbol-knob");
    this.mark = null; // the symbol whose row is open
    this.listen();
    this.wireNumbers();
  }

  listen() {
    const on = (target, type, listener) => target.addEventListener(type, (event) => listener(event, symbolAt(event)));
    on(this.article, "pointerover", (event, mark) => mark && event.pointerType === "mouse" && this.schedule(OPEN_DELAY, () => this.open(mark)));
    on(this.article, "pointerout", () => this.leave());
    on(this.article, "pointerdown", (event, mark) => mark && event.button === 0 && this.press(event, mark));
    on(this.article, "click", (event, mark) => mark && !this.dragged && this.open(mark, true));
    on(this.article, "focusin", (event, mark) => mark?.matches(":focus-visible") && !this.returning && this.open(mark));
    on(this.article, "focusout", () => this.leave());
    on(this.article, "keydown", (event, mark) => mark && this.onKey(event, mark));
    on(this.box, "pointerenter", () => clearTimeout(this.timer));
    on(this.box, "pointerleave", () => this.leave());
    on(this.box, "focusout", () => this.leave());
    on(this.box, "keydown", (event) => event.key === "Escape" && this.returnFocus());
    on(document, "pointerdown", (event) => !this.box.contains(event.target) && symbolAt(event) !== this.mark && this.close());
    document.addEventListener("scroll", () => this.follow(), { capture: true, passive: true });
    addEventListener("resize", () => this.follow());
  }

  // Opens the row of a symbol beside it: a copy of the one in the column, and as good. One that is
  // pinned stays when the mouse leaves.
  open(mark, pinned = false) {
    clearTimeout(this.timer);
    if (mark !== this.mark) {
      this.close();
      const name = mark.dataset.param;
      const element = cloneRow(document.getElementById(`param-${name}`));
      const idle = document.createElement("p");
      idle.className = "idle";
      idle.textContent = "Without effect under the present choices.";
      idle.hidden = acts(this.tunables.get(name), this.knobs.values);
      this.box.replaceChildren(element, idle);
      this.mark = mark;
      this.row = this.knobs.add(name, element);
      this.row.mark("");
      this.box.hidden = false;
      mark.classList.add("open");
      placeBeside(this.box, mark);
    }
    this.pinned ||= pinned;
  }

  close() {
    clearTimeout(this.timer);
    if (!this.mark) return;
    this.knobs.remove(this.row);
    this.mark.classList.remove("open");
    this.mark = this.row = null;
    this.pinned = false;
    this.box.hidden = true;
    this.box.replaceChildren();
  }

  schedule(time, action) {
    clearTimeout(this.timer);
    this.timer = setTimeout(action, time);
  }

  leave() {
    this.schedule(CLOSE_DELAY, () => {
      if (!this.pinned && !this.box.contains(document.activeElement)) this.close();
    });
  }

  // Stays beside its symbol while the article scrolls.
  follow() {
    if (!this.mark) return;
    const { top, bottom } = this.mark.getBoundingClientRect();
    const view = this.article.getBoundingClientRect();
    if (bottom < Math.max(0, view.top) || top > Math.min(innerHeight, view.bottom)) this.close();
    else placeBeside(this.box, this.mark);
  }

  onKey(event, mark) {
    if (event.key === "Escape") return this.close();
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    this.open(mark);
    (this.row.track ?? this.row.field).focus();
  }

  // The focus goes back to the symbol, which then stays closed.
  returnFocus() {
    const { mark } = this;
    this.close();
    this.returning = true;
    mark.focus({ preventScroll: true });
    this.returning = false;
  }

  // A press that moves sideways drags the value along its track.
  press({ clientX, pointerId }, mark) {
    const name = mark.dataset.param;
    const tunable = this.tunables.get(name);
    this.dragged = false;
    if (tunable.kind !== "knob") return;
    const start = positionOf(tunable, this.knobs.present(name));
    const released = new AbortController();
    const until = { signal: released.signal };
    document.addEventListener("pointermove", (event) => {
      if (event.pointerId !== pointerId) return;
      const moved = event.clientX - clientX;
      if (!this.dragged && Math.abs(moved) < DRAG_THRESHOLD) return;
      this.dragged = true;
      this.open(mark, true);
      if (!this.row.field.disabled) this.knobs.drag(name, valueAt(tunable, start + moved / LENGTH), this.row);
    }, until);
    for (const end of ["pointerup", "pointercancel"]) document.addEventListener(end, () => released.abort(), until);
  }

  // Numbers in formulas --------------------------------------------------------------------------

  wireNumbers() {
    const wanted = document.getElementById("numbers");
    wanted.checked = stored("numbers") === "yes";
    wanted.addEventListener("change", () => {
      store("numbers", wanted.checked ? "yes" : "no");
      this.show();
    });
    this.wanted = wanted;
  }

  // The present values, if they are wanted: in a formula in the symbol's place, else behind it.
  show() {
    this.article.classList.toggle("with-numbers", this.wanted.checked);
    if (!this.wanted.checked) return;
    for (const mark of this.article.querySelectorAll("[data-param]")) {
      const value = this.knobs.values[mark.dataset.param];
      if (typeof value !== "number") continue;
      const now = mark.querySelector(":scope > .now") ?? addNumber(mark);
      const text = shortNumber(value);
      if (now.localName === "span") now.textContent = `\u2009=\u2009${text}`;
      else now.textContent = value < 0 ? `(${text})` : text;
    }
  }
}

function symbolAt(event) {
  return event.target.closest?.("[data-param]") ?? null;
}

// A copy of a row, with names of its own for its parts.
function cloneRow(row) {
  const copy = row.cloneNode(true);
  copy.hidden = false;
  copy.classList.remove("set", "flash");
  for (const part of [copy, ...copy.querySelectorAll("*")]) {
    for (const name of ["id", "for", "aria-describedby"]) {
      const value = part.getAttribute(name);
      if (value) part.setAttribute(name, `here-${value}`);
    }
  }
  return copy;
}

// Of the kind that the symbol stands among: text, or a formula.
function addNumber(mark) {
  const inFormula = mark.localName === "mrow";
  const now = document.createElementNS(mark.namespaceURI, inFormula ? "mn" : "span");
  now.classList.add("now");
  mark.append(now);
  return now;
}
