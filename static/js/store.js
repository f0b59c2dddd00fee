// What is kept in this browser, never on a server. Storage may be forbidden or full: what is kept
// then lasts as long as the page.

const kept = new Map(); // what could not be stored

export function stored(key) {
  if (kept.has(key)) return kept.get(key);
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

export function store(key, value) {
  try {
    localStorage.setItem(key, value);
    kept.delete(key);
  } catch {
    kept.set(key, value);
  }
}

// The same, of anything JSON can say; `fallback` for what is not there, or spoilt.
export function storedData(key, fallback) {
  try {
    return JSON.parse(stored(key)) ?? fallback;
  } catch {
    return fallback;
  }
}

export function storeData(key, data) {
  store(key, JSON.stringify(data));
}
