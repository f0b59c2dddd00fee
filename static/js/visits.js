// Which labs the reader has opened, and when last.

import { storeData, storedData } from "./store.js";

const KEY = "visits";

// By slug, when it was opened last [ms since 1970].
export function visits() {
  const found = storedData(KEY, {});
  return found && typeof found === "object" ? found : {};
}

export function noteVisit(slug) {
  storeData(KEY, { ...visits(), [slug]: Date.now() });
}
