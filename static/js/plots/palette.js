// The colours of the style sheet as a canvas needs them: resolved for light or dark.

export const SERIES = 8;

let cache = new Map();

export function colour(name) {
  if (!cache.has(name)) {
    const probe = document.createElement("span");
    probe.style.color = `var(--${name})`;
    document.body.append(probe);
    cache.set(name, getComputedStyle(probe).color);
    probe.remove();
  }
  return cache.get(name);
}

export function forgetColours() {
  cache = new Map();
}
