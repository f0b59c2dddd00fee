// The home page: how far the reader has come, and labs found by word as one types.

import { wireMenus } from "./menus.js";
import { wirePreferences } from "./preferences.js";
import { visits } from "./visits.js";

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

// Marks the labs that were opened, counts them by chapter, and offers to go on with the last.
function showProgress() {
  const opened = visits();
  const steps = [...document.querySelectorAll(".step")];
  const visited = steps.filter((step) => step.dataset.slug in opened);
  const last = visited.sort((a, b) => opened[b.dataset.slug] - opened[a.dataset.slug])[0];
  for (const step of steps) {
    step.classList.toggle("opened", step.dataset.slug in opened);
    step.classList.toggle("last", step === last);
    const state = step === last ? "opened last" : step.dataset.slug in opened ? "opened" : "";
    step.querySelector(".state").textContent = state;
  }
  for (const chapter of document.querySelectorAll(".chapter")) {
    const inside = chapter.querySelectorAll(".step");
    const done = chapter.querySelectorAll(".step.opened").length;
    chapter.querySelector(".progress").textContent = done ? `${done} of ${inside.length} opened` : "";
  }
  const goOn = document.getElementById("go-on");
  if (!goOn || !last) return;
  goOn.hidden = false;
  goOn.href = last.querySelector("a").href;
  goOn.querySelector("span").textContent = last.querySelector("strong").textContent;
}

wirePreferences();
wireMenus();
showProgress();
addEventListener("pageshow", showProgress); // back from a lab
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
