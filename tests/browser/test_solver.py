"""The solver's row of a lab's page: run, step, look back, pace, save and load."""

import re
from itertools import product
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import OpenContext, screenshot
from tests.browser.lab_page import LabPage, wait_frames
from tests.browser.test_layout import SCHEMES
from tests.server_process import ServerProcess

DONE = re.compile("steps done")
WIDTHS = (360, 820, 1100, 1500)


def iteration(page: Page) -> int:
    return int(page.locator("#iterations").inner_text().split()[0])


def test_it_runs_is_held_and_goes_step_by_step(page: Page) -> None:
    LabPage(page, scene=False).open("descent")
    expect(page.locator("#solver-says")).to_have_text(DONE)
    expect(page.locator("#iterations")).to_have_text("200")
    page.keyboard.press("o")
    expect(page.locator("#solve")).to_have_attribute("aria-pressed", "false")
    page.keyboard.press("r")
    expect(page.locator("#iterations")).to_have_text("0")
    expect(page.locator("#solver-says")).to_have_text("Paused before the first iteration")
    page.keyboard.press("i")
    page.keyboard.press("i")
    expect(page.locator("#iterations")).to_have_text("2")
    page.get_by_role("button", name="One iteration").click()
    expect(page.locator("#iterations")).to_have_text("3")
    page.get_by_role("button", name="Run the solver").click()
    expect(page.locator("#iterations")).to_have_text("200")
    # A lab without a world: its one clock has the usual keys too.
    page.locator("h1").click()
    page.keyboard.press("Space")
    expect(page.locator("#solve")).to_have_attribute("aria-pressed", "false")


NEEDED = """menu => {
  const shown = menu.offsetWidth;
  menu.style.cssText = "width: max-content; max-width: none";
  const needed = menu.offsetWidth;
  menu.style.cssText = "";
  return needed - shown;
}"""


def test_a_pace_shows_progress_and_the_time_left(page: Page) -> None:
    LabPage(page, scene=False).open("descent")
    assert page.locator("#solver-pace").evaluate(NEEDED) <= 0, "every pace is read whole"
    page.select_option("#solver-pace", "10")
    page.locator("h1").click()
    page.keyboard.press("r")
    expect(page.locator("#solver-says")).to_have_text(re.compile(r"^\d+ %, \d+ s left$"))
    now = iteration(page)
    assert 0 < now < 200
    screenshot(page, "solver")
    page.select_option("#solver-pace", "0")
    expect(page.locator("#solver-says")).to_have_text(DONE)


def test_dragging_back_shows_what_was_and_its_end_the_latest(page: Page) -> None:
    LabPage(page, scene=False).open("descent")
    expect(page.locator("#iterations")).to_have_text("200")
    slider = page.locator("#iteration")
    box = slider.bounding_box()
    assert box
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] - 8, y)
    page.mouse.down()
    for part in (0.8, 0.6, 0.4):
        page.mouse.move(box["x"] + part * box["width"], y)
        wait_frames(page)
    page.mouse.up()
    expect(page.locator("#iterations")).to_have_text(re.compile(r"^[6-9]\d of 200$"))
    expect(page.locator("#solver-says")).to_have_text("Looking back")
    expect(page.locator("#solve")).to_have_attribute("aria-pressed", "false")
    slider.press("End")
    expect(page.locator("#iterations")).to_have_text("200")
    slider.press("Home")
    expect(page.locator("#iterations")).to_have_text("1 of 200")
    expect(page.get_by_label("Cost")).to_have_text("1.70")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#iterations")).to_have_text("2 of 200")


@pytest.mark.parametrize("form", ["npz", "json"])
def test_a_solution_is_taken_home_and_brought_back(page: Page, tmp_path: Path, form: str) -> None:
    lab = LabPage(page, scene=False).open("descent", "?rate=0.03&many=40")
    expect(page.locator("#iterations")).to_have_text("40")
    page.get_by_role("button", name="Export").click()
    with page.expect_download() as download:
        page.locator(f"[data-solution={form}]").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    lab.open("descent")
    expect(page.locator("#iterations")).to_have_text("200")
    page.get_by_role("button", name="Export").click()
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Load solution").click()
    chooser.value.set_files(path)
    expect(page.locator("#toasts")).to_contain_text("Solution loaded")
    expect(page.locator("#iterations")).to_have_text("40")
    expect(lab.value("rate")).to_have_value("0.03")
    expect(page).to_have_url(re.compile("rate=0.03"))
    page.get_by_role("button", name="Run the solver").click()
    expect(page.locator("#iterations")).to_have_text("80")


def test_a_wrong_file_is_refused_in_a_sentence(page: Page, tmp_path: Path) -> None:
    LabPage(page, scene=False).open("descent")
    expect(page.locator("#iterations")).to_have_text("200")
    (tmp_path / "wrong.json").write_text("[]")
    page.set_input_files("#solution-file", tmp_path / "wrong.json")
    expect(page.locator("#toasts")).to_contain_text(
        "wrong.json was not loaded: this is no solution"
    )
    expect(page.locator("#iterations")).to_have_text("200")


def test_a_lab_without_a_solver_has_no_such_row(page: Page) -> None:
    LabPage(page, scene=False).open("troublesome")
    expect(page.locator("#solver")).to_have_count(0)
    page.keyboard.press("o")
    page.keyboard.press("i")
    expect(page.locator("#toasts")).to_be_empty()


def test_nothing_overflows_and_nothing_jumps(page: Page) -> None:
    LabPage(page, scene=False).open("descent")
    row, says = page.locator("#solver"), page.locator("#solver-says")
    for width, scheme in product(WIDTHS, SCHEMES):
        page.set_viewport_size({"width": width, "height": 800})
        page.emulate_media(color_scheme=scheme)
        expect(says).to_have_text(DONE)
        heights = [row.evaluate("row => row.offsetHeight")]
        page.select_option("#solver-pace", "30")
        page.get_by_role("button", name="Start again").click()
        expect(says).to_have_text(re.compile("left"))
        heights.append(row.evaluate("row => row.offsetHeight"))
        page.locator("#iteration").press("Home")
        expect(says).to_have_text("Looking back")
        heights.append(row.evaluate("row => row.offsetHeight"))
        screenshot(page, f"solver-{width}-{scheme}")
        assert len(set(heights)) == 1, (width, scheme, heights)
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
        page.select_option("#solver-pace", "0")
        page.get_by_role("button", name="Run the solver").click()


def test_a_page_opened_at_the_first_start_says_what_goes_on(
    open_context: OpenContext, tmp_path: Path
) -> None:
    prepared = tmp_path / "prepared"
    with ServerProcess(wait=False, PREPARED_BY=str(prepared)) as server:
        page = open_context(server).new_page()
        LabPage(page, scene=False)
        page.goto("/labs/descent")
        expect(page.locator("#loading")).to_contain_text("it compiles the solvers, once")
        expect(page.locator("#loading .once")).to_be_visible()
        screenshot(page, "first-start")
        prepared.touch()
        expect(page.locator("#loading.done")).to_be_attached()
