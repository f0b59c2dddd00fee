// On a phone the scene stays on top and the article scrolls beneath it. Knobs and plots come up as
// sheets from the lower edge, never as high as the scene; and the current experiment's card holds
// what it is about: the knobs it set and the plot it watches, before its answer; or, while a curve is
// sketched, that plot.

// As in static/css/narrow.css; upright or on its side.
const PHONE = matchMedia("(max-width: 47.99rem), (max-width: 74.99rem) and (max-height: 35.99rem)");

export class Sheets {
  constructor() {
    this.buttons = [...document.querySelectorAll("[data-sheet]")];
    for (const button of this.buttons) {
      button.addEventListener("click", () => this.toggle(button.dataset.sheet));
    }
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && this.open) this.toggle(this.open);
    });
    this.lent = []; // [element, the comment that keeps its place]
    const changed = () => requestAnimationFrame(() => this.arrange());
    const watcher = new MutationObserver(changed);
    for (const card of document.querySelectorAll(".experiment")) {
      watcher.observe(card, { attributeFilter: ["class"] });
    }
    watcher.observe(document.getElementById("plots"), { attributeFilter: ["class"], subtree: true });
    PHONE.addEventListener("change", changed);
  }

  get open() {
    return document.body.dataset.open ?? "";
  }

  toggle(sheet) {
    const open = this.open === sheet ? "" : sheet;
    if (open) document.body.dataset.open = open;
    else delete document.body.dataset.open;
    for (const button of this.buttons) {
      button.setAttribute("aria-expanded", String(button.dataset.sheet === open));
    }
  }

  // Puts knobs and plot into the current card, and back where they belong.
  arrange() {
    const [sketching, current] = ["sketching", "current"].map((name) => document.querySelector(`.experiment.${name}`));
    const card = PHONE.matches ? (sketching ?? current) : null;
    const selector = sketching ? ".plot:is(.watched, .sketched)" : ".knob.set, .plot.watched";
    const wanted = card ? [...document.querySelectorAll(selector)] : [];
    const there = this.lent.map(([element]) => element);
    const same = wanted.length === there.length && wanted.every((element) => there.includes(element));
    if (same && (!card || card === this.card)) return;
    for (const [element, place] of this.lent) place.replaceWith(element);
    this.lent = wanted.map((element) => {
      const place = document.createComment("");
      element.replaceWith(place);
      return [element, place];
    });
    this.card = card;
    this.box?.remove();
    if (!wanted.length) return;
    this.box = document.createElement("div");
    this.box.className = "own";
    this.box.append(...wanted);
    const answer = card.querySelector("details");
    card.insertBefore(this.box, answer);
    (this.box.querySelector(".sketched") ?? answer ?? this.box).scrollIntoView({ block: "nearest" });
  }
}
