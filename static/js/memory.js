// What the reader arranged, kept in this browser and never on a server. Storage may be forbidden,
// full, or hold what another version wrote: then nothing is remembered, and nothing breaks.

export function recall(key) {
  try {
    return JSON.parse(localStorage.getItem(key));
  } catch {
    return null;
  }
}

export function remember(key, value) {
  try {
    if (value === null) localStorage.removeItem(key);
    else localStorage.setItem(key, JSON.stringify(value));
  } catch {
    // The arrangement lasts as long as the page.
  }
}
