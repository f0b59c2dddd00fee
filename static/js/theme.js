// Runs before the first paint: the chosen theme stands at once, without a flash of the other one.
try {
  document.documentElement.dataset.theme = localStorage.getItem("theme") || "system";
} catch {
  // Storage may be forbidden; the page then follows the system.
}
