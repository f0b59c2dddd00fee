// The page's address encodes what is on screen: every parameter that differs from its default,
// and the seed. Opened elsewhere, it shows the same.

const MOST = 100; // texts, and letters of a name, that the server takes
const LONGEST = 64;

// The server knows what the texts mean, and says what is wrong with them.
export function readLink() {
  const texts = [...new URLSearchParams(location.search)].slice(0, MOST);
  return Object.fromEntries(texts.map(([name, text]) => [name.slice(0, LONGEST), text]));
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
