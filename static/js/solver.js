// The solver's own controls. What they show is what the server says, never what was wished.

const EVERY = 60; // [ms] between two looks back while the thumb is dragged
const SLIDER_HOLD = 700; // [ms] a thumb let go is not yet moved by what the server said a moment ago

export class SolverRow {
  constructor(send, load) {
    this.send = send; // (command) => Promise, never throws
    this.row = document.getElementById("solver");
    if (!this.row) return;
    this.button = document.getElementById("solve");
    this.one = document.getElementById("iterate");
    this.slider = document.getElementById("iteration");
    this.count = document.getElementById("iterations");
    this.pace = document.getElementById("solver-pace");
    this.says = document.getElementById("solver-says");
    this.bar = document.querySelector("#solver-progress i");
    this.file = document.getElementById("solution-file");
    this.enabled = false;
    this.status = null;
    this.slider.addEventListener("input", () => this.showIteration());
    this.pace.addEventListener("change", () => this.send({ command: "solver_pace", pace: Number(this.pace.value) }));
    this.file.addEventListener("change", () => {
      const [file] = this.file.files;
      if (file) load(file);
      this.file.value = ""; // the same file may be chosen again
    });
  }

  enable(yes) {
    this.enabled = yes;
    if (this.row) this.showControls();
  }

  toggle() {
    if (this.row) this.send({ command: (this.status?.running ?? true) ? "solver_pause" : "solver_run" });
  }

  step() {
    if (this.row && !this.one.disabled) this.send({ command: "solver_step" });
  }

  choose() {
    this.file.click();
  }

  // While the thumb moves: the latest place wins, a few times a second.
  showIteration() {
    this.moved = performance.now();
    this.count.textContent = this.slider.value;
    this.timer ??= setTimeout(() => {
      this.timer = undefined;
      this.send({ command: "solver_show", iteration: Number(this.slider.value) });
    }, EVERY);
  }

  show(status) {
    if (!this.row || !status) return;
    this.status = status;
    const { iteration, latest, kept, running, pace } = status;
    if (!(performance.now() - this.moved < SLIDER_HOLD)) {
      this.slider.min = kept ? kept[0] : 0;
      this.slider.max = kept ? kept[1] : 0;
      this.slider.value = iteration;
      this.count.textContent = iteration === latest ? String(iteration) : `${iteration} of ${latest}`;
    }
    this.button.setAttribute("aria-pressed", String(running));
    this.button.setAttribute("aria-label", running ? "Pause the solver" : "Run the solver");
    if (document.activeElement !== this.pace) this.showPace(pace);
    const text = this.sentence(status);
    if (this.says.textContent !== text) this.says.textContent = text;
    this.bar.parentElement.classList.toggle("over", Boolean(status.done));
    this.bar.style.width = `${100 * (status.progress ?? 0)}%`;
    this.showControls();
  }

  sentence({ iteration, latest, running, done, progress, seconds_left: left }) {
    if (iteration < latest) return "Looking back";
    if (done) return done;
    if (!running) return latest ? "Paused" : "Paused before the first iteration";
    const part = progress === null ? "" : `${Math.round(100 * progress)} %`;
    return left === null ? part : `${part}, ${duration(left)} left`;
  }

  showPace(pace) {
    const known = [...this.pace.options].some((option) => Number(option.value) === pace);
    if (!known) this.pace.add(new Option(`${pace} / s`, pace)); // set through the API
    this.pace.value = pace;
  }

  showControls() {
    this.slider.disabled = !this.enabled || !this.status?.kept;
    this.one.disabled = !this.enabled || Boolean(this.status?.done);
  }
}

function duration(seconds) {
  if (seconds < 1.5) return "1 s";
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return `${Math.round(seconds / 60)} min`;
}
