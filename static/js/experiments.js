// The experiments of the article: a button sets the parameters and starts anew; then the page
// tells what to look for, and where.

export class Experiments {
  constructor(lab, apply, watch, highlight) {
    this.lab = lab;
    this.apply = apply; // (params) => Promise<boolean>: was it done
    this.watch = watch; // (title of a plot) => void
    this.highlight = highlight; // (names of parameters) => void
    this.cards = [...document.querySelectorAll("[data-experiment]")];
    this.cards.forEach((card, i) => {
      card.querySelector(".try").addEventListener("click", () => this.start(i));
    });
  }

  async start(i) {
    const card = this.cards[i];
    if (!card) return;
    const { set, watch } = this.lab.experiments[i];
    if (!(await this.apply(set))) return;
    for (const other of this.cards) other.classList.toggle("current", other === card);
    card.querySelector("details").open = true;
    card.scrollIntoView({ block: "nearest" });
    card.querySelector("details").scrollIntoView({ block: "nearest" }); // where the card is taller
    this.highlight(Object.keys(set));
    this.watch(watch);
  }

  // The settings have moved on: no card is the current one.
  leave() {
    for (const card of this.cards) card.classList.remove("current");
    this.highlight([]);
    this.watch("");
  }
}
