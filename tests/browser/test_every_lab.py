"""Every lab of the course opens in a browser, every experiment of its article and a slider work."""

import re

import pytest
from playwright.sync_api import Page, expect

from labs.engine.catalog import Entry, catalog
from server.articles import render
from tests.browser.conftest import screenshot
from tests.browser.lab_page import LabPage, wait_frames

CUT = """() => [...document.querySelectorAll(".formula")]
  .filter(formula => formula.scrollWidth > formula.clientWidth + 1)
  .map(formula => formula.textContent)"""
SHIPPED = [entry for entry in catalog().values() if entry.package.startswith("labs.")]


@pytest.mark.parametrize("entry", SHIPPED, ids=lambda entry: entry.slug)
def test_every_experiment_and_a_slider_set_what_they_say(page: Page, entry: Entry) -> None:
    # Pressing is the page's own; drawing every scene in software would take minutes.
    page.set_viewport_size({"width": 1366, "height": 650})  # a laptop's screen, less its bars
    lab = LabPage(page, scene=False).open(entry.slug)
    assert page.evaluate(CUT) == [], "formulas break where the column is too narrow"
    for number, experiment in enumerate(render(entry).experiments):
        page.locator(".experiment .try").nth(number).click()
        expect(page.locator(".experiment").nth(number)).to_have_class(re.compile("current"))
        wanted = entry.lab.Params().change(experiment.settings).model_dump()
        assert lab.status()["params"] == wanted, experiment.title
        if experiment.watch:
            assert lab.whole(".plot.watched"), experiment.title
        for part in (".experiment.current .observe", "#view", "#transport"):
            assert lab.whole(part), (experiment.title, part)
        expect(page.locator("#banner")).not_to_contain_text("defect of the lab")
    page.keyboard.press("d")
    lab.told(when=lambda s: s["params"] == entry.lab.Params().model_dump())
    lab.load_scene()
    knob = next(
        tunable
        for tunable in entry.lab.Params.describe()
        if tunable["kind"] == "knob" and tunable["scale"] == "linear"
    )
    unit = f" [{knob['unit']}]" if knob["unit"] else ""
    value = 0.75 * (knob["high"] - knob["low"])
    value = knob["low"] + (round(value / knob["step"]) * knob["step"] if knob["step"] else value)
    box = lab.row(f"{knob['label']}{unit}").get_by_role("textbox")
    box.fill(f"{value:.2f}")
    box.press("Enter")
    expect(lab.value(knob["name"])).to_have_value(f"{float(f'{value:.2f}'):g}")
    lab.told()
    lab.told()  # what the new value has done is known
    expect(lab.scene.locator("canvas").first).to_be_visible()
    wait_frames(page)
    screenshot(page, f"lab-{entry.slug}")
    expect(page.locator("#banner")).not_to_contain_text("defect of the lab")
