// The experiments of the article: a button sets the parameters and starts anew; then the page
// tells what to look for, and where.

export class Experiments {
  constructor(lab, apply, watch, highlight) {
    this.lab = lab;
    this.defaults = Object.fromEntries(lab.params.map((p) => [p.name, p.default]));
    this.apply = apply; // (params) => Promise<boolean>: was it done
    this.watch = watch; // (title of a plot) => void
    this.highlight = highlight; // (names of parameters) => void
    this.wanted = null; // all parameters of the experiment started last
    this.reached = false; // whether the session has had them since
    this.cards = [...document.querySelectorAll("[data-experiment]")];
    this.cards.forEach((card, i) => {
      card.querySelector(".try").addEventListener("click", () => this.start(i));
    });
  }

  async start(i) {
    const card = this.cards[i];
    if (!card) return;
    const { set, watch } = this.lab.experiments[i];
    const wanted = (this.wanted = { ...this.defaults, ...set });
    this.reached = false;
    const done = await this.apply(set);
    if (this.wanted !== wanted) return; // another has begun, or the settings have moved on
    if (!done) return this.leave();
    for (const other of this.cards) other.classList.toggle("current", other === card);
    card.querySelector("details").open = true;
    card.scrollIntoView({ block: "nearest" });
    card.querySelector("details").scrollIntoView({ block: "nearest" }); // where the card is taller
    this.highlight(Object.keys(set));
    this.watch(watch);
  }

  // What the session's parameters are. An experiment is over once they move away from its own.
  show(params) {
    if (!this.wanted) return;
    const same = Object.entries(this.wanted).every(([name, value]) => params[name] === value);
    if (this.reached && !same) this.leave();
    this.reached ||= same;
  }

  leave() {
    this.wanted = null;
    this.reached = false;
    for (const card of this.cards) card.classList.remove("current");
    this.highlight([]);
    this.watch("");
  }
}
