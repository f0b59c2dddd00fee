"""A lab's page as a student uses it."""

import io
import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import FrameLocator, Locator, Page, Route, WebSocket, expect

SCENES = "**/scene/*/**"
FRAMES = """count => new Promise(done => {
  const next = () => (count-- > 0 ? requestAnimationFrame(next) : done());
  next();
})"""

IN_VIEW_SCRIPT = """([selector, first]) => {
  const found = [...document.querySelectorAll(selector)].slice(0, first ? 1 : undefined);
  return found.length > 0 && found.every(element => {
    const box = element.getBoundingClientRect();
    if (!box.width || !box.height) return false;
    if (box.top < -1 || box.bottom > innerHeight + 1) return false;
    if (box.left < -1 || box.right > innerWidth + 1) return false;
    for (let host = element.parentElement; host; host = host.parentElement) {
      if (getComputedStyle(host).overflowY === "visible") continue;
      const frame = host.getBoundingClientRect();
      if (box.top < frame.top - 1 || box.bottom > frame.bottom + 1) return false;
      if (box.left < frame.left - 1 || box.right > frame.right + 1) return false;
    }
    return true;
  });
}"""

FILLED_SCRIPT = """selector => [...document.querySelectorAll(selector)].every(plot => {
  const marks = "td, .note p, .chart :is(.curve, .point, .column)";
  if (plot.querySelector(marks)) return true;
  const canvas = plot.querySelector("canvas");
  if (!canvas) return false;
  // Curves have a hue; axes, their numbers and the grid have hardly any.
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  for (let i = 0; i < data.length; i += 4) {
    const [r, g, b, a] = data.subarray(i, i + 4);
    if (a > 200 && Math.max(r, g, b) - Math.min(r, g, b) > 60) return true;
  }
  return false;
})"""

Message = dict[str, Any]


def block_scene(route: Route) -> None:
    """In place of a scene: drawing it in software is most of the work of a test."""
    route.fulfill(body="<!doctype html>")


def wait_frames(page: Page, count: int = 2) -> None:
    """Waits until a page has been drawn again: twice, what was under way and what is."""
    page.evaluate(FRAMES, count)


class LabPage:
    """`lab = LabPage(page).open("joint-control", "?kp=500")`."""

    def __init__(self, page: Page, scene: bool = True) -> None:
        """`scene=False` leaves the 3D scene out, where a test is about the page alone."""
        self.page = page
        page.on("websocket", self._opened)
        if not scene:
            page.route(SCENES, block_scene)

    def open(self, slug: str, query: str = "") -> "LabPage":
        """Opens a lab and waits until it lives."""
        self.page.goto(f"/labs/{slug}{query}")
        self.wait_live()
        return self

    def wait_live(self) -> None:
        expect(self.page.locator("#loading.done")).to_be_attached()

    @property
    def scene(self) -> FrameLocator:
        return self.page.frame_locator("#robot")

    def load_scene(self) -> None:
        """Loads the 3D scene that was left out."""
        frame = next(frame for frame in self.page.frames if "/scene/" in frame.url)
        self.page.unroute(SCENES)
        frame.goto(frame.url)

    def pin(self, title: str) -> Locator:
        """A plot, pinned in view if it is not yet."""
        tab = self.page.locator("#tabs").get_by_role("button", name=title, exact=True)
        if tab.get_attribute("aria-pressed") == "false":
            tab.click()
        plot = self.page.get_by_role("region", name=title, exact=True)
        expect(plot).to_be_visible()
        return plot

    def is_in_view(self, selector: str, first: bool = False) -> bool:
        """Whether all (or the first) that a selector finds is in view, without scrolling, and
        there is some."""
        found: bool = self.page.evaluate(IN_VIEW_SCRIPT, [selector, first])
        return found

    def wait_filled(self, selector: str) -> None:
        """Waits until every plot that a selector finds shows something."""
        self.page.wait_for_function(FILLED_SCRIPT, arg=selector)

    def unfold_panel(self) -> None:
        """Opens the scene's own panel, which waits as a strip at its side."""
        title = self.page.locator("h1").inner_text()
        self.scene.get_by_text(title, exact=True).first.click()

    def row(self, label: str) -> Locator:
        """The row of the scene's panel with this label, the panel unfolded: Viser associates no
        label with its slider. A slider's goes on with its value."""
        text = self.scene.get_by_text(re.compile(rf"^{re.escape(label)}( =|$)"))
        expect(self.scene.locator("canvas").first).to_be_visible()
        if not text.is_visible():
            self.unfold_panel()
        expect(text).to_be_visible()
        return text.locator("xpath=ancestor::*[.//input or .//*[@role='slider']][1]")

    def pause(self) -> None:
        """Stops the clock, which runs."""
        run = self.page.locator("#run")
        expect(run).to_have_attribute("aria-pressed", "true")
        run.click()
        expect(run).to_have_attribute("aria-pressed", "false")

    def time(self) -> float:
        return float(self.page.locator("#clock span").inner_text())

    def value(self, name: str) -> Locator:
        """The value of a parameter in the column of knobs."""
        return self.page.locator(f"#value-{name}")

    def status(self) -> Message:
        """The session as the API tells it."""
        found = re.search(r"/api/sessions/[^/]+", self._stream.url)
        assert found
        status: Message = json.loads(self.page.request.get(found[0]).text())
        return status

    def next_message(
        self, type: str = "status", when: Callable[[Message], bool] = lambda m: True
    ) -> Message:
        """The next message of a type that the page is told, and that fulfils a condition."""

        def wanted(frame: str | bytes) -> bool:
            message = json.loads(frame)
            return message["type"] == type and when(message)

        return dict(json.loads(self._stream.wait_for_event("framereceived", wanted)))

    def pixels(self, selector: str) -> np.ndarray:
        """What a part of the page shows, (height, width, 3)."""
        data = self.page.locator(selector).screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=int)

    def pixels_when(self, selector: str, true: Callable[[np.ndarray], bool]) -> np.ndarray:
        """What a part of the page shows as soon as it fulfils a condition."""
        for _ in range(200):
            image = self.pixels(selector)
            if true(image):
                return image
            wait_frames(self.page)
        raise AssertionError("it never looked so")

    def _opened(self, socket: WebSocket) -> None:
        if socket.url.endswith("/stream"):
            self._stream = socket
