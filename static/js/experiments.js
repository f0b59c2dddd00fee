// The experiments of the article: a button sets what the experiment asks for and starts anew; then
// the page tells what to look for, and where. Where a prediction is asked for, guessing starts it
// as well, and guess and outcome are set side by side.

import { Prediction } from "./prediction.js";
import { PHONE } from "./sheet.js"; // where the card itself grows, and keeps its place

export class Experiments {
  constructor(lab, apply, board, highlight) {
    this.lab = lab;
    this.defaults = Object.fromEntries(lab.params.map((p) => [p.name, p.default]));
    this.apply = apply; // (params, how to run) => Promise<boolean>: was it done
    this.board = board;
    this.highlight = highlight; // (names of parameters) => void
    this.wanted = null; // all parameters of the experiment started last
    this.reached = false; // whether the session has had them since
    this.latest = 0; // the session's run
    this.before = 0; // the session's run when the experiment was started
    this.cards = [...document.querySelectorAll("[data-experiment]")];
    this.predictions = this.cards.map((card, i) => {
      card.querySelector(".try").addEventListener("click", () => this.start(i));
      const experiment = lab.experiments[i];
      return experiment.predict && new Prediction(lab.slug, experiment, card, board, () => this.start(i));
    });
  }

  async start(i) {
    const card = this.cards[i];
    if (!card) return;
    const { set, run, watch, window, highlight } = this.lab.experiments[i];
    const wanted = (this.wanted = { ...this.defaults, ...set });
    this.reached = false;
    this.before = this.latest;
    this.predictions[i]?.commitPendingGuess();
    const done = await this.apply(set, run);
    for (const prediction of this.predictions) prediction?.closeSketch();
    if (this.wanted !== wanted) return; // another has begun, or the settings have moved on
    if (!done) return this.leave();
    for (const other of this.cards) other.classList.toggle("current", other === card);
    this.board.setWindow(window);
    this.board.watch(watch, highlight);
    this.board.mark(null);
    this.current = this.predictions[i];
    this.current?.begin();
    card.querySelector("details").open = true;
    if (!PHONE.matches) {
      card.scrollIntoView({ block: "nearest" });
      card.querySelector("details").scrollIntoView({ block: "nearest" }); // where the card is taller
    }
    this.highlight(Object.keys(set));
  }

  // How the session stands. An experiment is over once its parameters move away from its own.
  show(status) {
    this.latest = status.run;
    if (!this.wanted) return;
    const same = Object.entries(this.wanted).every(([name, value]) => status.params[name] === value);
    if (this.reached && !same) return this.leave();
    this.reached ||= same;
    if (this.reached && status.run > this.before) this.current?.follow(status);
  }

  leave() {
    this.wanted = null;
    this.reached = false;
    this.current = null;
    for (const card of this.cards) card.classList.remove("current");
    this.highlight([]);
    this.board.watch([], "");
    this.board.mark(null);
  }
}
