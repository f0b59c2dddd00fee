// The page's address encodes what is on screen: every parameter that differs from its default,
// and the seed. Opened elsewhere, it shows the same.

export function readLink(tunables) {
  const params = {};
  let seed = 0;
  for (const [name, text] of new URLSearchParams(location.search)) {
    if (name === "seed") {
      seed = Number(text);
      continue;
    }
    params[name] = fromText(text, tunables.find((tunable) => tunable.name === name));
  }
  const valid = Number.isInteger(seed) && seed >= 0 && seed <= 0xffffffff;
  return { params, seed: valid ? seed : 0 };
}

export function linkOf(tunables, params, seed) {
  const query = new URLSearchParams();
  for (const { name, default: standard } of tunables) {
    if (name in params && params[name] !== standard) query.set(name, String(params[name]));
  }
  if (seed) query.set("seed", String(seed));
  const text = query.toString();
  return location.pathname + (text ? `?${text}` : "");
}

// Browsers refuse too many changes of the address a second: one at rest is enough.
let timer = 0;
export function writeLink(link) {
  clearTimeout(timer);
  timer = setTimeout(() => {
    if (link !== location.pathname + location.search) history.replaceState(null, "", link + location.hash);
  }, 200);
}

function fromText(text, tunable) {
  if (tunable?.kind === "choice") {
    const option = tunable.options.find(({ value }) => String(value) === text);
    if (option) return option.value;
  }
  if (tunable?.kind === "toggle") {
    return { true: true, 1: true, on: true, false: false, 0: false, off: false }[text.toLowerCase()] ?? text;
  }
  if (tunable?.kind === "text") return text;
  const value = Number(text);
  return text.trim() !== "" && Number.isFinite(value) ? value : text;
}
