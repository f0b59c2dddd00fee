// On a phone the scene stays on top and the article scrolls beneath it. Knobs and plots come up as
// sheets from the lower edge, never as high as the scene; and the current experiment's card holds
// what it is about: the read-out it names, the plot it watches and the knobs it set, before its
// answer; or, while a curve is sketched, that plot.

// As in static/css/narrow.css; upright or on its side.
export const PHONE = matchMedia("(max-width: 47.99rem), (max-width: 74.99rem) and (max-height: 35.99rem)");

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
    this.card = this.sketching = null; // the card that holds them, and whether for a sketch
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
    this.arrange();
  }

  // Puts knobs and plot into the current card, and back where they belong: in a sheet, if one is up.
  arrange() {
    const [sketching, current] = ["sketching", "current"].map((name) => document.querySelector(`.experiment.${name}`));
    const card = PHONE.matches ? (sketching ?? current) : null;
    const own = (selector, sheet) => (card && this.open !== sheet ? [...document.querySelectorAll(selector)] : []);
    const wanted = [
      ...(sketching ? [] : own(".tile.marked", "plot-board")),
      ...own(".plot:is(.watched, .sketched)", "plot-board"),
      ...(sketching ? [] : own(".knob.set", "knobs")),
    ];
    const there = this.lent.map(([element]) => element);
    const moved = wanted.length !== there.length || !wanted.every((element) => there.includes(element));
    const turned = card !== this.card || sketching !== this.sketching;
    if (!moved && !turned) return;
    // Not out of the hand that has just moved a knob.
    if (!card && this.box?.contains(document.activeElement)) {
      return this.box.addEventListener("focusout", () => setTimeout(() => this.arrange()), { once: true });
    }
    const height = this.box?.offsetHeight;
    for (const [element, place] of this.lent) place.replaceWith(element);
    this.lent = wanted.map((element) => {
      const place = document.createComment("");
      element.replaceWith(place);
      return [element, place];
    });
    if (turned) this.box?.remove();
    [this.card, this.sketching] = [card, sketching];
    if (!card) return;
    const answer = card.querySelector(".verdict"); // and what to look for, beneath
    if (turned) {
      this.box = document.createElement("div");
      this.box.className = "own";
      card.insertBefore(this.box, answer);
    }
    this.box.append(...wanted);
    // Behind a sheet nothing moves.
    this.box.style.minHeight = this.open && !turned ? `${height}px` : "";
    if (!turned) return;
    if (sketching) return this.box.querySelector(".sketched")?.scrollIntoView();
    // The question stays in sight, the button before all.
    for (const part of [...this.box.querySelectorAll(".plot"), card.querySelector(".question"), card.querySelector(".try")]) {
      part.scrollIntoView({ block: "nearest" });
    }
  }
}
