// What the reader prefers for looks: theme and graphics.

import { store, stored } from "./store.js";

const systemDark = matchMedia("(prefers-color-scheme: dark)");
const listeners = new Set();

// Drawing in software (no graphics card) is slow with shadows and environment light.
function drawsInSoftware() {
  try {
    const gl = document.createElement("canvas").getContext("webgl");
    const info = gl?.getExtension("WEBGL_debug_renderer_info");
    const name = gl?.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? "";
    gl?.getExtension("WEBGL_lose_context")?.loseContext();
    return !gl || /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
  } catch {
    return true;
  }
}

let graphics = stored("graphics");

export function theme() {
  return document.documentElement.dataset.theme;
}

// What the 3D scene is asked for.
export function view() {
  graphics ??= navigator.connection?.saveData || drawsInSoftware() ? "low" : "high";
  const dark = theme() === "dark" || (theme() === "system" && systemDark.matches);
  return { dark, graphics };
}

export function onViewChange(listener) {
  listeners.add(listener);
}

function changed() {
  for (const listener of listeners) listener(view());
}

// Wires the radio buttons of the appearance menu.
export function wirePreferences() {
  for (const radio of document.querySelectorAll("input[name=theme]")) {
    radio.checked = radio.value === theme();
    radio.addEventListener("change", () => {
      document.documentElement.dataset.theme = radio.value;
      store("theme", radio.value);
      changed();
    });
  }
  for (const radio of document.querySelectorAll("input[name=graphics]")) {
    radio.checked = radio.value === view().graphics;
    radio.addEventListener("change", () => {
      graphics = radio.value;
      store("graphics", graphics);
      changed();
    });
  }
  systemDark.addEventListener("change", changed);
}
