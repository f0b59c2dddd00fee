// A prediction: the reader commits to a guess, which runs the experiment; then guess and outcome
// stand together, in the card and in the plot. What was guessed stays in this browser.

import { formatNumber } from "./format.js";
import { rmsDistance, Sketch } from "./sketch.js";
import { storeData, storedData } from "./store.js";

const OUTCOME_READINGS = 2; // what a solver has found may reach the page a moment after its status

export class Prediction {
  constructor(slug, experiment, card, board, commit) {
    this.key = `guesses/${slug}`;
    this.experiment = experiment;
    this.asked = experiment.predict;
    this.board = board;
    this.commit = commit; // starts the experiment
    this.card = card;
    this.form = card.querySelector(".predict");
    this.verdict = card.querySelector(".verdict");
    const { guess, outcome } = storedData(this.key, {})[experiment.title] ?? {};
    this.guess = this.isGuess(guess) ? guess : null;
    this.outcome = this.guess === null ? null : (outcome ?? null);
    this.wire();
    this.show();
  }

  wire() {
    const [button] = this.form.querySelectorAll("button");
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.asked.kind === "number") this.readNumber();
    });
    for (const choice of this.form.querySelectorAll("[data-choice]")) {
      choice.addEventListener("click", () => this.commitGuess(Number(choice.dataset.choice)));
    }
    if (this.asked.kind === "curve") button.addEventListener("click", () => this.sketch());
  }

  readNumber() {
    const value = this.typed();
    if (value === null) this.form.querySelector("input").focus();
    else this.commitGuess(value);
  }

  // The number that is typed; null, and marked, if it is none.
  typed() {
    const field = this.form.querySelector("input");
    const text = field.value.trim().replace("−", "-").replace(/^(-?\d*),(\d+)$/, "$1.$2");
    const wrong = this.form.querySelector(".wrong");
    const valid = text !== "" && Number.isFinite(Number(text));
    wrong.textContent = valid ? "" : "Type a number, such as 2.5 or 1e-3.";
    wrong.hidden = valid;
    field.setAttribute("aria-invalid", String(!valid));
    return valid ? Number(text) : null;
  }

  // The experiment's button is pressed: what stands there counts as the guess.
  commitPendingGuess() {
    const { kind } = this.asked;
    if (kind === "curve") this.guess = this.pad?.curve() ?? this.guess;
    else if (kind === "number" && this.form.querySelector("input").value.trim()) this.guess = this.typed() ?? this.guess;
    else return;
    if (this.guess !== null) this.save();
  }

  sketch() {
    const { watch, highlight, window, seconds } = this.experiment;
    this.closeSketch();
    this.board.setWindow(window);
    this.board.watch(watch, highlight);
    const plot = this.board.find(this.asked.plot);
    this.pad = new Sketch(plot, this.asked, seconds, (curve) => {
      this.pad.remove();
      if (curve) this.commitGuess(curve);
      else this.closeSketch();
    });
    this.card.classList.add("sketching"); // where the plot may come to it: sheet.js
    plot.section.scrollIntoView({ block: "nearest" });
  }

  closeSketch() {
    this.pad?.remove();
    this.pad = null;
    this.card.classList.remove("sketching");
  }

  commitGuess(guess) {
    this.guess = guess;
    this.outcome = null;
    this.save();
    this.commit();
  }

  // The experiment has been started, with a guess or without.
  begin() {
    this.readings = 0;
    this.outcome = null;
    if (this.guess !== null) this.board.mark(this.mark());
    if (this.guess !== null && this.isOutcomeKnown) {
      this.outcome = this.asked.answer;
      this.save();
    }
    this.show();
  }

  // Whether the article knows the outcome, and need not wait for it.
  get isOutcomeKnown() {
    return Number.isFinite(this.asked.answer);
  }

  // How the session stands, since the experiment was started.
  follow(status) {
    if (this.guess === null || this.isOutcomeKnown || this.readings >= OUTCOME_READINGS) return;
    if (!this.isDue(status)) return;
    const outcome = this.read(status);
    if (!Number.isFinite(outcome)) return; // not known yet
    this.readings += 1;
    this.outcome = outcome;
    this.save();
    this.show();
  }

  isDue({ t, trouble, solver }) {
    const { run, seconds } = this.experiment;
    if (trouble) return true;
    if (solver && !run.hold) return Boolean(solver.done);
    return t >= seconds - 1e-6;
  }

  // What is compared with the guess: the outcome; of a curve the distance from it.
  read({ run, solver }) {
    const { asked, experiment } = this;
    if (this.board.number !== run) return null;
    const until = solver && !experiment.run.hold ? Infinity : experiment.seconds;
    if (asked.kind === "curve") return rmsDistance(this.guess, this.board.curve(asked.channel, until));
    return this.board.read(asked.channel, asked.of, until);
  }

  mark() {
    const { kind, channel, of } = this.asked;
    const levels = of === "peak" ? [this.guess, -this.guess] : [this.guess]; // of either sign
    if (kind === "number") return channel ? { channel, levels } : null;
    return kind === "curve" ? { channel, ...this.guess } : null;
  }

  save() {
    const { key, experiment, guess, outcome } = this;
    storeData(key, { ...storedData(key, {}), [experiment.title]: { guess, outcome } });
  }

  isGuess(guess) {
    const { kind, choices } = this.asked;
    if (kind === "choice") return Number.isInteger(guess) && guess >= 0 && guess < choices.length;
    if (kind === "number") return Number.isFinite(guess);
    return Array.isArray(guess?.x) && guess.x.length > 1 && guess.x.length === guess.y?.length;
  }

  show() {
    const { guess, outcome, asked } = this;
    const told = outcome !== null;
    for (const choice of this.form.querySelectorAll("[data-choice]")) {
      const i = Number(choice.dataset.choice);
      choice.setAttribute("aria-pressed", String(i === guess));
      choice.classList.toggle("right", guess !== null && told && i === asked.answer);
      choice.classList.toggle("wrong", told && i === guess && i !== asked.answer);
    }
    const field = this.form.querySelector("input");
    if (field && guess !== null && document.activeElement !== field && !field.value) field.value = String(guess);
    this.verdict.hidden = guess === null;
    if (guess !== null) this.verdict.replaceChildren(...(told ? this.outcomeText() : this.pendingText()));
  }

  pendingText() {
    const { run, seconds } = this.experiment;
    const solved = !run.hold && document.getElementById("solver");
    return [`${this.guessText()} The outcome comes ${solved ? "when the solver is done" : `at t = ${seconds} s`}.`];
  }

  guessText() {
    return this.asked.kind === "number" ? `Your guess: ${this.withUnit(this.guess)}.` : "Your guess is drawn dashed.";
  }

  outcomeText() {
    const { guess, outcome, asked } = this;
    if (asked.kind === "choice") {
      if (guess === outcome) return ["Right."];
      const right = this.form.querySelector(`[data-choice="${outcome}"]`);
      return ["Not so. The answer: ", right.firstElementChild.cloneNode(true)];
    }
    if (asked.kind === "curve") return [`Your curve is off by ${this.withUnit(outcome)} (root mean square).`];
    const off = guess - outcome;
    const part = Math.abs(off) < 10 * Math.abs(outcome) ? ` (${formatNumber(100 * Math.abs(off / outcome), 2)} %)` : "";
    const how = off === 0 ? "exactly it" : `${this.withUnit(Math.abs(off), 2)} too ${off > 0 ? "high" : "low"}${part}`;
    return [`Your guess: ${this.withUnit(guess)}. Outcome: `, strong(this.withUnit(outcome)), `: ${how}.`];
  }

  withUnit(value, digits = 3) {
    const text = Number.isInteger(value) && Math.abs(value) < 1e6 ? String(value).replace("-", "−") : formatNumber(value, digits);
    return `${text} ${this.asked.unit}`.trim();
  }
}

function strong(text) {
  const made = document.createElement("strong");
  made.textContent = text;
  return made;
}
