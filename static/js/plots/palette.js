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

// A diverging scale for a level in [-1, 1]: one tone for negative values, another for positive
// ones, nothing at zero; pale enough that ink stays readable on it in light and dark.
export function diverging(level) {
  const share = Math.round(50 * Math.min(1, Math.abs(level)));
  if (!share) return "transparent";
  return `color-mix(in srgb, var(--${level < 0 ? "negative" : "positive"}) ${share}%, transparent)`;
}

export function clearColourCache() {
  cache = new Map();
}
