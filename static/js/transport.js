// The controls of the simulation. What they show is what the server says, never what was wished.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const SNAP = 0.045; // in decades

export class Transport {
  constructor(send) {
    this.send = send; // (command) => Promise, never throws
    this.status = null;
    this.run = document.getElementById("run");
    this.clock = document.querySelector("#clock span");
    this.pace = document.getElementById("pace");
    this.speed = document.getElementById("speed");
    this.speedValue = document.getElementById("speed-value");
    this.seed = document.getElementById("seed");
    this.speed?.addEventListener("input", () => this.slide());
    this.speed?.addEventListener("dblclick", () => this.setSpeed(1));
    this.seed.addEventListener("change", () => this.setSeed());
    for (const button of document.querySelectorAll("[data-action]")) {
      button.addEventListener("click", () => send({ command: "press", action: button.dataset.action }));
    }
  }

  enable(yes) {
    for (const control of document.querySelectorAll("[data-needs]")) control.disabled = !yes;
  }

  toggle() {
    if (!this.run) return null;
    // After trouble the world waits for a reset; to run means to begin anew.
    if (this.status?.trouble) return this.send({ command: "reset" }).then(() => this.send({ command: "run" }));
    // What one looks at runs, unless it has said otherwise.
    return this.send({ command: (this.status?.running ?? true) ? "pause" : "run" });
  }

  slide() {
    const position = Number(this.speed.value);
    const near = SPEEDS.find((speed) => Math.abs(Math.log10(speed) - position) < SNAP);
    this.setSpeed(near ?? Number((10 ** position).toPrecision(2)));
  }

  setSpeed(factor) {
    if (!this.speed) return null;
    const bounded = Math.min(4, Math.max(0.1, factor));
    this.showSpeed(bounded);
    this.chosen = performance.now();
    return this.send({ command: "speed", factor: bounded });
  }

  changeSpeed(direction) {
    const now = this.status?.speed ?? 1;
    const next = direction > 0
      ? SPEEDS.find((speed) => speed > now * 1.001)
      : SPEEDS.findLast((speed) => speed < now * 0.999);
    if (next) this.setSpeed(next);
  }

  setSeed() {
    const seed = Number(this.seed.value);
    const valid = this.seed.value !== "" && Number.isInteger(seed) && this.seed.validity.valid;
    if (valid) this.send({ command: "seed", seed });
    else if (this.status) this.seed.value = this.status.seed;
  }

  show(status) {
    const before = this.status;
    this.status = status;
    if (document.activeElement !== this.seed && before?.seed !== status.seed) this.seed.value = status.seed;
    if (!this.run) return;
    const running = status.running && !status.trouble;
    this.run.setAttribute("aria-pressed", String(running));
    this.run.querySelector("span").textContent = running ? "Pause" : "Run";
    this.showTime(status.t);
    this.showPace(status);
    // A thumb in motion is not pulled back by what the server said a moment ago.
    if (!(performance.now() - this.chosen < 600)) this.showSpeed(status.speed);
  }

  showTime(t) {
    if (this.clock) this.clock.textContent = t.toFixed(2);
  }

  showPace({ running, trouble, capped, real_time_factor: factor }) {
    const moving = `${capped ? "↓" : ""}${factor.toFixed(2)}×`; // as wide as ever: the row stays one
    const text = trouble ? "stopped" : running ? moving : "paused";
    if (this.pace.textContent !== text) this.pace.textContent = text;
    this.pace.classList.toggle("capped", running && capped);
    this.pace.title = capped
      ? "This machine is too slow for the chosen speed: simulated time slows down, behaviour does not change."
      : "Simulated seconds per second of the wall clock";
  }

  showSpeed(factor) {
    const text = `${+factor.toPrecision(2)}×`;
    this.speedValue.textContent = text;
    this.speed.value = Math.log10(factor);
    this.speed.setAttribute("aria-valuetext", `${+factor.toPrecision(2)} times`);
  }
}
