"""The pages from a telephone to a wall, in light and in dark."""

import re
from itertools import product
from typing import Literal

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import OpenContext, screenshot
from tests.browser.lab_page import SCENES, LabPage, block_scene, wait_frames
from tests.server_process import ServerProcess

SIZES = {"phone": (360, 740), "tablet": (820, 1180), "laptop": (1366, 768), "wall": (3840, 2160)}
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")


@pytest.mark.parametrize("path", ["/", "/labs/joint-control"])
def test_nothing_overflows(page: Page, path: str) -> None:
    # The layout is the page's own; drawing the scene 4K wide in software would take minutes.
    lab = LabPage(page, scene=False)
    page.goto(path)
    if path != "/":
        lab.wait_live()
    for size, scheme in product(SIZES, SCHEMES):
        width, height = SIZES[size]
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(color_scheme=scheme)
        wait_frames(page)
        screenshot(page, f"{'home' if path == '/' else 'lab'}-{size}-{scheme}")
        overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert overflow <= 0, (size, scheme)
        assert (lightness(page) < 200) if scheme == "dark" else (lightness(page) > 600)


@pytest.mark.parametrize(("width", "height"), [(1366, 650), (1440, 790)])
def test_knobs_robot_and_plots_are_in_view_together(page: Page, width: int, height: int) -> None:
    page.set_viewport_size({"width": width, "height": height})
    for slug, query, knobs in (
        ("joint-control", "?controller=pid", ("kp", "ki", "kd")),
        ("lqr", "", ("q_slide", "q_turn", "r")),
    ):
        lab = LabPage(page, scene=False).open(slug, query)
        for part in ("#view", "#transport", "#tiles", "#plots > :not([hidden])", "#plot-tabs"):
            assert lab.is_in_view(part), (slug, part)
        scene = page.locator("#view").bounding_box()
        assert scene
        assert scene["width"] >= 0.45 * width
        assert all(lab.is_in_view(f"#param-{name}") for name in knobs)
        screenshot(page, f"{slug}-{width}")


def test_what_the_reader_arranges_is_kept(page: Page) -> None:
    page.set_viewport_size({"width": 1440, "height": 790})
    lab = LabPage(page, scene=False).open("joint-control")
    page.get_by_role("button", name="Four plots").click()
    expect(page.locator("#plots > :not([hidden])")).to_have_count(4)
    lab.pin("Closed-loop eigenvalues")
    border = page.get_by_role("separator", name="Width of the article")
    before = page.locator("#article").bounding_box()
    box = border.bounding_box()
    assert box
    assert before
    page.mouse.move(box["x"] + 4, 300)
    page.mouse.down()
    page.mouse.move(box["x"] + 84, 300, steps=3)
    page.mouse.up()
    page.get_by_role("separator", name="Height of the scene").press("End")
    page.reload()
    lab.wait_live()
    after = page.locator("#article").bounding_box()
    assert after
    assert after["width"] == pytest.approx(before["width"] + 80, abs=3)
    expect(page.locator("#plots > :not([hidden])")).to_have_count(4)
    expect(page.get_by_role("region", name="Closed-loop eigenvalues")).to_be_visible()
    for name in ("article", "knobs"):  # however far they are moved, nothing is lost
        page.locator(f"[data-border={name}]").press("End")
    wait_frames(page)
    for part in ("#view", "#transport", "#tiles", "#plots", "#plot-tabs"):
        assert lab.is_in_view(part), part
    border.dblclick()
    wait_frames(page)
    again = page.locator("#article").bounding_box()
    assert again
    assert again["width"] == pytest.approx(before["width"], abs=1)


@pytest.mark.parametrize(("width", "height"), [(768, 1024), (1024, 768)])
def test_a_tablet_has_all_parts_in_view(page: Page, width: int, height: int) -> None:
    page.set_viewport_size({"width": width, "height": height})
    lab = LabPage(page, scene=False).open("lqr")
    page.locator(".experiment .try").nth(1).click()
    expect(page.locator(".experiment.current")).to_be_visible()
    wait_frames(page)
    for part in ("#view", "#transport", ".plot.watched", ".current .observe", "#param-deviation"):
        assert lab.is_in_view(part), part
    screenshot(page, f"lqr-{width}")


def test_on_a_phone_the_card_holds_its_knobs_and_its_plot(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    lab = LabPage(page, scene=False).open("lqr")
    button = page.locator(".experiment .try").nth(1)
    button.scroll_into_view_if_needed()
    card = page.locator(".experiment").nth(1)
    top = "card => card.getBoundingClientRect().top"
    before = card.evaluate(top)
    button.click()
    own = card.locator(".own")
    expect(own.locator(".knob.set")).to_have_count(2)
    expect(own.get_by_role("region", name="Cost", exact=True)).to_be_visible()
    wait_frames(page)
    assert abs(card.evaluate(top) - before) < 844, "nobody is thrown far"
    buttons = ("#run", "#solve", "[data-sheet=knobs]", ".experiment.current .try")
    for part in ("#view", *buttons, ".experiment.current .question"):
        assert lab.is_in_view(part), part
    solver, sheets = (page.locator(part).bounding_box() for part in ("#solve", ".sheets"))
    assert solver
    assert sheets
    assert solver["x"] + solver["width"] <= sheets["x"], "pause is not beneath the sheets"
    overflow = "own => own.scrollWidth - own.clientWidth"
    assert own.evaluate(overflow) <= 0
    page.get_by_role("button", name="Plots").click()  # each sheet is whole, too
    sheet_plot = page.locator("#plot-board").get_by_role("region", name="Cost", exact=True)
    expect(sheet_plot).to_be_visible()
    page.get_by_role("button", name="Knobs").click()
    expect(page.locator("#knobs .knob.set")).to_have_count(2)
    expect(lab.value("horizon")).to_be_visible()
    scene, sheet = (page.locator(part).bounding_box() for part in ("#view", "#knobs"))
    assert scene
    assert sheet
    assert sheet["y"] >= scene["y"] + scene["height"] - 1, "the robot stays in view"
    screenshot(page, "lqr-phone")
    page.keyboard.press("Escape")
    expect(page.locator("#knobs")).to_be_hidden()
    expect(own.locator(".knob.set")).to_have_count(2)
    page.set_viewport_size({"width": 1366, "height": 650})  # all goes back where it belongs
    expect(page.locator("#knobs .knob.set")).to_have_count(2)
    expect(page.locator("#plots > .watched")).to_be_visible()


IS_TRUNCATED = "says => says.scrollWidth > says.clientWidth + 1"


def test_what_the_slim_row_has_no_room_for_is_a_button_away(page: Page) -> None:
    page.set_viewport_size({"width": 1366, "height": 650})
    lab = LabPage(page, scene=False).open("lyapunov")
    tiles, says, more = (
        ".tile:not([hidden])",
        page.locator("#solver-says"),
        page.locator("#more-numbers"),
    )
    expect(says).to_have_text(re.compile("of the window"))
    expect(more).to_have_text(re.compile(r"^\+\d+$"))
    assert not lab.is_in_view(tiles)
    assert says.evaluate(IS_TRUNCATED)
    plots = page.locator("#plots").bounding_box()
    more.press("Enter")
    expect(more).to_have_attribute("aria-expanded", "true")
    wait_frames(page)
    assert lab.is_in_view(tiles)
    assert lab.is_in_view("#solver-says")
    assert not says.evaluate(IS_TRUNCATED)
    assert page.locator("#plots").bounding_box() == plots, "nothing else moves"
    screenshot(page, "numbers-unfolded")
    page.keyboard.press("Escape")
    expect(more).to_have_attribute("aria-expanded", "false")
    page.set_viewport_size({"width": 3840, "height": 1200})
    expect(more).to_be_hidden()
    assert lab.is_in_view(tiles)


def test_a_moved_knob_stays_in_hand(page: Page) -> None:
    """An experiment gathers its knobs, and is over when one is moved: that goes home later."""
    page.set_viewport_size({"width": 1366, "height": 650})
    lab = LabPage(page, scene=False).open("dqn")
    for place, width in (("#knobs .gathered", 1366), (".experiment .own", 390)):
        page.set_viewport_size({"width": width, "height": 844 if width < 400 else 650})
        page.locator(".experiment .try").nth(7).click()
        expect(page.locator(f"{place} .knob.set:not([hidden])")).to_have_count(8)
        if width < 400:
            expect(page.locator(f"{place} .tile.marked")).to_be_visible()
        track = page.locator(f"{place} #track-gamma")
        track.press("ArrowLeft")
        lab.next_message(when=lambda status: status["params"]["gamma"] < 0.95)
        expect(page.locator(".experiment.current")).to_have_count(0)
        wait_frames(page)
        expect(track).to_be_focused()
        track.blur()
        expect(page.locator(f"{place} .knob")).to_have_count(0)
        expect(
            page.locator("#knobs details #param-gamma, #knobs .first #param-gamma")
        ).to_have_count(1)


def lightness(page: Page) -> int:
    """Of the page's background: red + green + blue."""
    color = page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
    return sum(map(int, re.findall(r"\d+", color)[:3]))


def test_the_article_reads_before_anything_is_pressed(page: Page) -> None:
    """Mathematics is text set in the mathematics font, and there without scripts."""
    page.route(SCENES, block_scene)
    page.goto("/labs/joint-control")
    formula = page.locator("article math").first
    expect(formula).to_be_visible()
    assert "STIX" in formula.evaluate("m => getComputedStyle(m).fontFamily")
    page.evaluate("document.fonts.ready")
    assert page.evaluate("document.fonts.check('16px \"STIX Two Math\"')")


def test_the_article_reads_without_scripts(
    open_context: OpenContext, shared_server: ServerProcess
) -> None:
    page = open_context(shared_server, java_script_enabled=False).new_page()
    page.goto("/labs/joint-control")
    expect(page.locator("article math").first).to_be_visible()
    expect(page.get_by_role("heading", level=1)).to_be_visible()


def test_nothing_jumps_while_the_lab_starts(page: Page) -> None:
    """No element of the page moves between first paint and the living lab."""
    page.goto("/labs/joint-control", wait_until="commit")
    page.evaluate(
        """() => { window.shift = 0; new PerformanceObserver(list => {
            for (const e of list.getEntries()) window.shift += e.value;
        }).observe({type: 'layout-shift', buffered: true}); }"""
    )
    expect(page.locator("#loading.done")).to_be_attached()
    page.wait_for_load_state("networkidle")  # all has come: scene, curves, fonts
    wait_frames(page)
    assert page.evaluate("window.shift") < 0.02


def test_the_theme_is_switched_and_kept(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control")
    page.get_by_role("button", name="Appearance").click()
    page.check("#view-menu input[value=dark]")
    assert lightness(page) < 200
    page.reload()
    lab.wait_live()
    assert lightness(page) < 200


def test_no_address_outside_is_asked(
    open_context: OpenContext, shared_server: ServerProcess
) -> None:
    page = open_context(shared_server).new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    lab = LabPage(page).open("oscillator")
    lab.pin("Field")
    lab.wait_filled("#plots .plot:not([hidden])")
    expect(lab.scene.locator("canvas").first).to_be_visible()
    page.wait_for_load_state("networkidle")
    foreign = [
        url
        for url in asked
        if not url.startswith((shared_server.address, "data:", "blob:", "ws://127."))
    ]
    assert not foreign
