// The scene is a page of its own in a frame. Two things of it are put right from here, as a tap
// would: on a phone the sheet of sliders starts open and covers the robot, and where drawing is in
// software a warning covers it too, though low graphics are chosen already.

const PATIENCE = 8000; // [ms]
const SHEET_HANDLE = 'div[style*="cursor: pointer"][style*="3.5em"]';

export function tidyFrame(frame) {
  const until = performance.now() + PATIENCE;
  const timer = setInterval(() => {
    const page = frame.contentDocument;
    if (!page || performance.now() > until) return clearInterval(timer);
    const handle = page.querySelector(SHEET_HANDLE);
    if (handle && !handle.dataset.folded) {
      handle.dataset.folded = "once"; // a second tap would open it again
      handle.click();
    }
    for (const note of page.querySelectorAll('[role="alert"]')) {
      if (note.textContent.includes("Software WebGL")) note.querySelector("button")?.click();
    }
  }, 150);
}
