// The page's address encodes what is on screen: every parameter that differs from its default,
// and the seed. Opened elsewhere, it shows the same.

const MOST = 100; // texts, and letters of a name, that the server takes
const MAX_NAME_LENGTH = 64;

const LONGEST_LINK = 8000; // characters that every server and proxy takes

// The server knows what the texts mean, and says what is wrong with them.
export function readLink() {
  const texts = [...new URLSearchParams(location.search)].slice(0, MOST);
  const said = Object.fromEntries(texts.map(([name, text]) => [name.slice(0, MAX_NAME_LENGTH), text]));
  return { ...said, ...history.state?.left };
}

// The link, and by name what it leaves out: the longest texts, where they do not fit.
export function buildLink(tunables, params, seed) {
  const said = {}, left = {};
  for (const { name, default: standard } of tunables) {
    if (name in params && params[name] !== standard) said[name] = String(params[name]);
  }
  if (seed) said.seed = String(seed);
  const query = () => new URLSearchParams(said).toString();
  while (query().length > LONGEST_LINK) {
    const longest = Object.keys(said).reduce((a, b) => (said[b].length > said[a].length ? b : a));
    left[longest] = said[longest];
    delete said[longest];
  }
  const text = query();
  return { link: location.pathname + (text ? `?${text}` : ""), left };
}

// Browsers refuse too many changes of the address a second: one at rest is enough. What the address
// leaves out stands beside it, so that a page that is loaded again still has it.
let timer = 0;
export function writeLink(link, left) {
  clearTimeout(timer);
  timer = setTimeout(() => {
    const kept = JSON.stringify(history.state?.left ?? {}) === JSON.stringify(left);
    if (kept && link === location.pathname + location.search) return;
    history.replaceState({ left }, "", link + location.hash);
  }, 200);
}
