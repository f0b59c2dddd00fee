"""A lab's page as a student uses it."""

import io
import json
import re
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import FrameLocator, Locator, Page, expect


class LabPage:
    """`lab = LabPage(page).open("joint-control", "?kp=500")`."""

    def __init__(self, page: Page) -> None:
        self.page = page

    def open(self, slug: str, query: str = "") -> "LabPage":
        """Opens a lab and waits until it lives."""
        self.page.goto(f"/labs/{slug}{query}")
        self.wait_live()
        return self

    def wait_live(self) -> None:
        expect(self.page.locator("#curtain.open")).to_be_attached(timeout=20_000)

    @property
    def scene(self) -> FrameLocator:
        return self.page.frame_locator("#robot")

    def row(self, label: str) -> Locator:
        """The row of the panel with this label: Viser associates no label with its slider."""
        text = self.scene.get_by_text(label, exact=True)
        expect(text).to_be_visible()
        return text.locator("xpath=ancestor::*[.//input or .//*[@role='slider']][1]")

    def time(self) -> float:
        return float(self.page.locator("#clock span").inner_text())

    def value(self, name: str) -> Locator:
        """The value of a parameter in the article's table."""
        return self.page.locator(f"#value-{name}")

    def status(self) -> dict[str, Any]:
        """The session as the API tells it."""
        addresses = " ".join(frame.url for frame in self.page.frames)
        found = re.search(r"/scene/([^/]+)/", addresses)
        assert found
        answer = self.page.request.get(f"/api/sessions/{found[1]}")
        status: dict[str, Any] = json.loads(answer.text())
        return status

    def pixels(self, selector: str) -> np.ndarray:
        """What a part of the page shows, (height, width, 3)."""
        data = self.page.locator(selector).screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=int)
