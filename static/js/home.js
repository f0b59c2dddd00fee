// The home page: finds labs by word as one types.

import { wireMenus } from "./menus.js";
import { wirePreferences } from "./preferences.js";

const search = document.getElementById("search");
const empty = document.getElementById("empty");

function filter() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  let found = 0;
  for (const chapter of document.querySelectorAll(".chapter")) {
    const items = [...chapter.querySelectorAll("li")];
    for (const item of items) {
      item.hidden = !words.every((word) => item.dataset.words.includes(word));
    }
    const shown = items.filter((item) => !item.hidden).length;
    chapter.hidden = shown === 0;
    found += shown;
  }
  empty.hidden = found > 0;
  empty.textContent = found ? "" : `No lab has “${search.value.trim()}”. Try a single word, such as “control”.`;
}

wirePreferences();
wireMenus();
if (search) {
  search.addEventListener("input", filter);
  search.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    search.value = "";
    filter();
  });
  addEventListener("keydown", (event) => {
    if (event.key !== "/" || event.target.matches("input, textarea, select")) return;
    event.preventDefault();
    search.focus();
  });
  // A browser may restore what was typed before a reload.
  filter();
}
