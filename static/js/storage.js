// What this browser remembers. Storage may be forbidden or full: then it lasts as long as the page.

export function stored(key) {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

export function store(key, value) {
  try {
    localStorage.setItem(key, value);
  } catch {
    // Nothing depends on it.
  }
}

// Anything that JSON can hold; null where there is nothing, or nothing that can be read.
export function recall(key) {
  try {
    return JSON.parse(stored(key));
  } catch {
    return null;
  }
}
