// What stands over the scene: the loading overlay while a session starts, and the banner in trouble.

const STEPS = ["worker", "robot", "live"];

export class Stage {
  constructor() {
    this.loading = document.getElementById("loading");
    this.steps = [...document.querySelectorAll("#steps li")];
    this.banner = document.getElementById("banner");
    this.said = "";
  }

  // Shows how far the start has come.
  progress(phase) {
    const at = STEPS.indexOf(phase);
    this.steps.forEach((step, i) => {
      step.className = i < at || phase === "live" ? "done" : i === at ? "now" : "";
    });
    this.loading.classList.toggle("done", phase === "live");
    this.loading.querySelector(".once").hidden = true;
    this.hold(false);
  }

  // The first start takes longer than any other.
  prepare() {
    this.loading.querySelector(".once").hidden = false;
  }

  // The start has to wait: nothing turns that is not under way.
  hold(yes) {
    this.loading.querySelector(".progress").classList.toggle("held", yes);
  }

  // The scene with its controls and one plot on the whole screen, and back.
  fullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.getElementById("stage").requestFullscreen?.();
  }

  // A sentence with buttons {label: action}. Saying nothing takes the banner away.
  say(text, { warn = false, buttons = {} } = {}) {
    if (text === this.said) return;
    this.said = text;
    this.banner.hidden = !text;
    this.banner.classList.toggle("warn", warn);
    this.banner.querySelector("p").textContent = text;
    this.banner.querySelector(".buttons").replaceChildren(
      ...Object.entries(buttons).map(([label, action]) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = label;
        button.addEventListener("click", action);
        return button;
      }),
    );
  }
}
