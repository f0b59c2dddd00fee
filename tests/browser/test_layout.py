"""The pages from a telephone to a wall, in light and in dark."""

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import screenshot
from tests.browser.lab_page import LabPage
from tests.served import Served

SIZES = {"phone": (360, 740), "tablet": (820, 1180), "laptop": (1366, 768), "wall": (3840, 2160)}


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("path", ["/", "/labs/joint-control"])
def test_nothing_overflows(
    chromium: Browser, served: Served, path: str, size: str, scheme: str
) -> None:
    width, height = SIZES[size]
    context = chromium.new_context(
        base_url=served.address,
        viewport={"width": width, "height": height},
        color_scheme="dark" if scheme == "dark" else "light",
    )
    page = context.new_page()
    page.goto(path)
    if path != "/":
        LabPage(page).wait_live()
    page.wait_for_timeout(1500)
    screenshot(page, f"{'home' if path == '/' else 'lab'}-{size}-{scheme}")
    overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert overflow <= 0
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    lightness = sum(int(c) for c in background.removeprefix("rgb(").rstrip(")").split(",")[:3])
    assert (lightness < 200) if scheme == "dark" else (lightness > 600)
    context.close()


def test_the_article_reads_before_anything_is_pressed(page: Page) -> None:
    """Mathematics is text set in the mathematics font, and there without scripts."""
    page.goto("/labs/joint-control")
    formula = page.locator("article math").first
    expect(formula).to_be_visible()
    assert "STIX" in formula.evaluate("m => getComputedStyle(m).fontFamily")
    page.evaluate("document.fonts.ready")
    assert page.evaluate("document.fonts.check('16px \"STIX Two Math\"')")


def test_the_article_reads_without_scripts(chromium: Browser, served: Served) -> None:
    context = chromium.new_context(base_url=served.address, java_script_enabled=False)
    page = context.new_page()
    page.goto("/labs/joint-control")
    expect(page.locator("article math").first).to_be_visible()
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    context.close()


def test_nothing_jumps_while_the_lab_starts(page: Page) -> None:
    """No element of the page moves between first paint and the living lab."""
    page.goto("/labs/joint-control", wait_until="commit")
    page.evaluate(
        """() => { window.shift = 0; new PerformanceObserver(list => {
            for (const e of list.getEntries()) window.shift += e.value;
        }).observe({type: 'layout-shift', buffered: true}); }"""
    )
    LabPage(page).wait_live()
    page.wait_for_timeout(2000)
    assert page.evaluate("window.shift") < 0.02


def test_the_theme_is_switched_and_kept(page: Page) -> None:
    lab = LabPage(page).open("joint-control")
    page.get_by_role("button", name="Appearance").click()
    page.check("#view-menu input[value=dark]")
    background = "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(background)
    page.reload()
    lab.wait_live()
    assert page.evaluate(background) == dark


def test_no_address_outside_is_asked(chromium: Browser, served: Served) -> None:
    context = chromium.new_context(base_url=served.address)
    page = context.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    LabPage(page).open("oscillator")
    page.wait_for_timeout(2000)
    foreign = [
        url for url in asked if not url.startswith((served.address, "data:", "blob:", "ws://127."))
    ]
    assert not foreign
    context.close()
