// The page's address encodes what is on screen: every parameter that differs from its default,
// and the seed. Opened elsewhere, it shows the same.

// The server knows what the texts mean, and says what is wrong with them.
export function readLink() {
  const { seed = "", ...link } = Object.fromEntries(new URLSearchParams(location.search));
  const number = Number(seed);
  const valid = Number.isInteger(number) && number >= 0 && number <= 0xffffffff;
  return { link, seed: valid ? number : 0 };
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
