"""Renders the pictures the project shows of itself, from the real scene:
`python -m tests.pictures LAB [name=value ...] [--seconds T]` makes the lab's card (NAME.webp beside
its article); with `--page`, docs/LAB.webp of its page."""

import argparse
import io
from pathlib import Path
from urllib.parse import urlencode

from PIL import Image
from playwright.sync_api import Page, ViewportSize, sync_playwright

from labs.engine.catalog import find_lab
from tests import chromium
from tests.server_process import ServerProcess

CARD, PANEL = (640, 400), 40
"""[px] size of a card's picture; width of the strip beside the scene."""
WINDOW: ViewportSize = {"width": 1440, "height": 900}
CARD_WINDOW: ViewportSize = {"width": 840, "height": 500}
"""[px] Of the page; for a card small, so that lines and labels are large in it."""

FOLD = "[data-dock-region-collapse], [data-dock-column-collapse]"
"""Of the scene's panel, as in static/js/scene.js."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.pictures", description=__doc__)
    parser.add_argument("lab")
    parser.add_argument("params", nargs="*", metavar="name=value")
    parser.add_argument("--seconds", type=float, default=3.0, help="simulated time shown")
    parser.add_argument("--page", action="store_true", help="the whole page, for the README")
    options = parser.parse_args()
    query = dict(text.split("=", 1) for text in options.params)
    with ServerProcess() as server, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium.find_browser(), args=chromium.ARGUMENTS
        )
        page = browser.new_page(viewport=WINDOW if options.page else CARD_WINDOW)
        page.add_init_script("localStorage.setItem('graphics', 'high')")
        page.goto(f"{server.address}/labs/{options.lab}?{urlencode(query)}")
        page.wait_for_selector("#loading.done", state="attached", timeout=60_000)
        page.wait_for_timeout(20_000)  # software rendering takes its time over the first meshes
        _run_to(page, options.seconds)
        if options.page:
            target = Path("docs") / f"{options.lab}.webp"
            image = _screenshot(page).resize((1152, 720), Image.Resampling.LANCZOS)
        else:
            target = _beside_article(options.lab)
            page.evaluate("document.querySelector('#robot').requestFullscreen()")
            page.wait_for_timeout(4000)
            scene = next(frame for frame in page.frames if "/scene/" in frame.url)
            scene.locator(FOLD).first.dispatch_event("click")  # open in full screen
            page.wait_for_timeout(4000)
            image = _card_picture(_screenshot(page))
        image.save(target, quality=72, method=6)
        print(f"{target}: {target.stat().st_size / 1024:.0f} KB")
        browser.close()


def _run_to(page: Page, seconds: float) -> None:
    """Starts anew and pauses once the clock shows this time."""
    page.keyboard.press("r")
    page.wait_for_function(
        "s => { const t = parseFloat(document.querySelector('#clock span').textContent);"
        " return t > s && t < s + 1; }",
        arg=seconds,
        timeout=60_000,
    )
    page.keyboard.press("Space")
    page.wait_for_timeout(3000)


def _screenshot(page: Page) -> Image.Image:
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def _card_picture(shot: Image.Image) -> Image.Image:
    """The scene without its panel, in a card's proportions."""
    width, height = shot.width - PANEL, shot.height
    scale = min(width / CARD[0], height / CARD[1])
    w, h = CARD[0] * scale, CARD[1] * scale
    left, top = (width - w) / 2, (height - h) / 2
    box = (left, top, left + w, top + h)
    return shot.crop(box).resize(CARD, Image.Resampling.LANCZOS)


def _beside_article(slug: str) -> Path:
    return find_lab(slug).folder / "card.webp"


if __name__ == "__main__":
    main()
