// Runs before the first paint: the chosen theme stands at once, without a flash of the other one.
try {
  document.documentElement.dataset.theme = localStorage.getItem("theme") || "system";
} catch {
  // Storage may be forbidden; the page then follows the system.
}

// Mathematics makes the height of lines: an article is shown when its font is there, or late.
const LATE = 3000; // [ms]
const show = () => document.documentElement.classList.remove("font-awaited");
document.documentElement.classList.add("font-awaited");
document.fonts.load('1em "STIX Two Math"').then(show, show);
setTimeout(show, LATE);
