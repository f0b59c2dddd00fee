// Put into the scene's own page, which is Viser's. Its panel waits as a strip inside the lab's page,
// where the knobs are, and is open in full screen and where the scene stands alone. On a phone the
// sheet it is there starts open and would cover the robot; and where drawing is in software a warning
// covers it too, though low graphics are chosen already.

const PATIENCE = 8000; // [ms]
const UNFOLD = '[data-dock-minimize-all][aria-expanded="false"]';
const FOLD = "[data-dock-region-collapse], [data-dock-column-collapse]";
const SHEET_HANDLE = 'div[style*="cursor: pointer"][style*="3.5em"]';

const framed = parent !== window;
const deadline = performance.now() + PATIENCE;
let sheetFolded = !framed;
let panelOpened = framed; // by itself in no frame

const timer = setInterval(() => {
  if (performance.now() > deadline) clearInterval(timer);
  if (!sheetFolded) sheetFolded = press(SHEET_HANDLE); // a second tap would open it again
  if (!panelOpened) panelOpened = press(UNFOLD);
  for (const note of document.querySelectorAll('[role="alert"]')) {
    if (note.textContent.includes("Software WebGL")) note.querySelector("button")?.click();
  }
}, 150);

if (framed) {
  const listen = new AbortController();
  parent.document.addEventListener("fullscreenchange", () => {
    press(parent.document.fullscreenElement?.contains(frameElement) ? UNFOLD : FOLD);
  }, { signal: listen.signal });
  addEventListener("pagehide", () => listen.abort()); // another scene may come into this frame
}

// Presses a control, and leaves the focus where it was: Viser gives it to the panel a frame later.
function press(selector) {
  const control = document.querySelector(selector);
  if (!control) return false;
  const focused = parent.document.activeElement;
  control.click();
  requestAnimationFrame(() => {
    document.activeElement?.blur();
    focused?.focus({ preventScroll: true });
  });
  return true;
}
