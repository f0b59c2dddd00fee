"""Tables in the scene: a click on a cell of a board changes what the map says."""

import re
from typing import Any
from urllib.parse import parse_qs, quote, urlsplit

import numpy as np
from playwright.sync_api import Page, expect

from tests.browser.conftest import screenshot
from tests.browser.lab_page import LabPage

ONE_WALL = "........\n........\n....#...\n........\n........\n........"


def find_wall(lab: LabPage) -> tuple[float, float]:
    """Where on the page the map's only wall is drawn: dark grey, unlike all else that is."""
    image = lab.pixels("#robot")
    height, width, _ = image.shape
    drawn = image[: int(0.85 * height), : int(0.9 * width)]  # without buttons and panel
    light = drawn.mean(axis=2)
    rows, columns = np.nonzero((np.ptp(drawn, axis=2) < 25) & (light > 40) & (light < 130))
    box: Any = lab.page.locator("#robot").bounding_box()
    return box["x"] + float(np.median(columns)), box["y"] + float(np.median(rows))


def colored(image: np.ndarray) -> float:
    """The part of a picture that is neither white nor grey nor black."""
    return float((np.ptp(image, axis=2) > 30).mean())


def is_drawn(image: np.ndarray) -> bool:
    """Whether the board and the surface over it are there; a floor alone has no colours."""
    return colored(image) > 0.05


def test_a_click_on_a_cell_changes_the_map(page: Page) -> None:
    lab = LabPage(page).open("board", f"?map={quote(ONE_WALL)}")
    lab.pixels_when("#robot", is_drawn)
    place = find_wall(lab)
    before = lab.status()["params"]["map"].split("\n")
    assert before[2][4] == "#"
    page.mouse.click(*place)
    freed = [*before[:2], before[2][:4] + "." + before[2][5:], *before[3:]]
    expect(lab.value("map")).to_have_value("\n".join(freed))
    page.wait_for_url(lambda url: parse_qs(urlsplit(url).query)["map"] == ["\n".join(freed)])
    screenshot(page, "board")
    page.mouse.click(*place)
    expect(lab.value("map")).to_have_value("\n".join(before))


def test_a_board_waves_and_a_surface_over_it(page: Page) -> None:
    lab = LabPage(page).open("board", "?rate=5")
    seen = [lab.pixels_when("#robot", is_drawn)]
    for _ in range(8):
        lab.next_message("telemetry", when=lambda m: m["rows"] != [])
        seen.append(lab.pixels("#robot"))
    lab.pixels_when("#robot", lambda now: np.abs(now - seen[0]).max() > 60)  # the colours move
    parts = [colored(image) for image in seen]
    assert min(parts) > 0.7 * max(parts), "the surface never blinks while it is replaced"


def test_a_long_text_is_a_link(page: Page) -> None:
    """3999 characters: about as many as a text may have."""
    rows = "\n".join(["." * 39] * 99 + ["#" * 39])
    lab = LabPage(page, scene=False).open("board")
    lab.value("map").fill(rows)
    lab.value("map").blur()
    expect(page).to_have_url(re.compile("map=.{3999}"))
    page.reload()
    lab.wait_live()
    expect(lab.value("map")).to_have_value(rows)
    assert lab.status()["params"]["map"] == rows
