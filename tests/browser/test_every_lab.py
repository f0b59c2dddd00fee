"""Every lab of the course opens in a browser, every experiment of its article and a slider work."""

import re

import pytest
from playwright.sync_api import Page, expect

from labs.engine.catalog import CatalogEntry, catalog
from labs.params import Knob
from server.articles import render
from tests.browser.conftest import screenshot
from tests.browser.lab_page import LabPage, wait_frames

CUT_FORMULAS = """() => [...document.querySelectorAll(".formula")]
  .filter(formula => formula.scrollWidth > formula.clientWidth + 1)
  .map(formula => formula.textContent)"""
COURSE_LABS = [entry for entry in catalog().values() if entry.package.startswith("labs.")]

DIGITS = ".plot.watched td"
LOWEST = """() => Math.min(1000, ...[...document.querySelectorAll(".plot.watched .canvas")]
  .map(plot => plot.clientHeight))"""
"""[px] How low the lowest drawing is that an experiment watches."""
KNOBS = ".knob.set:not([hidden])"
FIT = """selector => {
  const heights = [...document.querySelectorAll(selector)].map(knob => knob.offsetHeight);
  const room = document.getElementById("knobs").clientHeight - 60; // less a heading, and margins
  return heights.reduce((sum, height) => sum + height) <= room;
}"""
"""Whether the knobs an experiment has set have room in their column, one beneath the other."""


@pytest.mark.parametrize("entry", COURSE_LABS, ids=lambda entry: entry.slug)
def test_every_experiment_and_a_slider_set_what_they_say(page: Page, entry: CatalogEntry) -> None:
    # Pressing is the page's own; drawing every scene in software would take minutes.
    page.set_viewport_size({"width": 1366, "height": 650})  # a laptop's screen, less its bars
    lab = LabPage(page, scene=False).open(entry.slug)
    assert page.evaluate(CUT_FORMULAS) == [], "formulas break where the column is too narrow"
    for number, experiment in enumerate(render(entry).experiments):
        page.locator(".experiment .try").nth(number).click()
        expect(page.locator(".experiment").nth(number)).to_have_class(re.compile("current"))
        wanted = entry.lab.Params().change(experiment.settings).model_dump()
        assert lab.status()["params"] == wanted, experiment.title
        expect(page.locator(".plot.watched")).to_have_count(len(experiment.watch))
        if experiment.watch:
            assert lab.is_in_view(".plot.watched"), experiment.title
            if page.locator(DIGITS).count():
                assert lab.is_in_view(DIGITS), f"{experiment.title}: a matrix is cut"
            assert page.evaluate(LOWEST) > 80, f"{experiment.title}: its legend leaves no room"
            lab.wait_filled(".plot.watched")
        if experiment.highlight:
            # A label may name what was chosen: "Greedy, {first}" reads "Greedy, SARSA".
            label = re.sub(r"\\{\w+\\}", ".+", re.escape(experiment.highlight))
            expect(page.locator(".tile.marked span")).to_have_text(re.compile(f"^{label}$"))
            assert lab.is_in_view(".tile.marked"), experiment.title
        if page.locator(KNOBS).count():
            assert lab.is_in_view(KNOBS, first=not page.evaluate(FIT, KNOBS)), experiment.title
        for part in (".experiment.current .observe", "#view", "#transport"):
            assert lab.is_in_view(part), (experiment.title, part)
        expect(page.locator("#banner")).not_to_contain_text("defect of the lab")
    page.keyboard.press("d")
    lab.next_message(when=lambda s: s["params"] == entry.lab.Params().model_dump())
    lab.load_scene()
    name, knob = next(
        (name, tunable)
        for name, tunable in entry.lab.Params.tunables.items()
        if isinstance(tunable, Knob) and tunable.key and entry.lab.Params().acts(name)
    )
    lab.row(knob.label).get_by_role("slider").press("End")
    expect(lab.value(name)).to_have_value(f"{knob.high:g}")
    lab.next_message()
    lab.next_message()  # what the new value has done is known
    expect(lab.scene.locator("canvas").first).to_be_visible()
    wait_frames(page)
    screenshot(page, f"lab-{entry.slug}")
    expect(page.locator("#banner")).not_to_contain_text("defect of the lab")
