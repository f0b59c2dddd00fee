"""Every lab of the course opens in a browser, and every experiment of its article works."""

import re

import pytest
from playwright.sync_api import Page, expect

from labs.engine.catalog import catalog
from server.articles import render
from tests.browser.conftest import screenshot
from tests.browser.lab_page import LabPage

SHIPPED = [slug for slug, entry in catalog().items() if entry.package.startswith("labs.")]


@pytest.mark.parametrize("slug", SHIPPED)
def test_every_experiment_sets_what_it_says(page: Page, slug: str) -> None:
    entry = catalog()[slug]
    # Pressing is the page's own; drawing every scene in software would take minutes.
    page.route("**/scene/*/**", lambda route: route.fulfill(body="<!doctype html>"))
    lab = LabPage(page).open(slug)
    for number, experiment in enumerate(render(entry).experiments):
        page.locator(".experiment .try").nth(number).click()
        expect(page.locator(".experiment").nth(number)).to_have_class(re.compile("current"))
        wanted = entry.lab.Params().change(experiment.settings).model_dump()
        assert lab.status()["params"] == wanted, experiment.title
        expect(page.locator("#banner")).not_to_contain_text("defect of the lab")


@pytest.mark.parametrize("slug", SHIPPED)
def test_a_slider_of_every_lab_moves_its_parameter(page: Page, slug: str) -> None:
    lab = LabPage(page).open(slug)
    knob = next(
        tunable
        for tunable in catalog()[slug].lab.Params.describe()
        if tunable["kind"] == "knob" and tunable["scale"] == "linear"
    )
    unit = f" [{knob['unit']}]" if knob["unit"] else ""
    value = 0.75 * (knob["high"] - knob["low"])
    value = knob["low"] + (round(value / knob["step"]) * knob["step"] if knob["step"] else value)
    box = lab.row(f"{knob['label']}{unit}").get_by_role("textbox")
    box.fill(f"{value:.2f}")
    box.press("Enter")
    expect(lab.value(knob["name"])).to_have_value(f"{float(f'{value:.2f}'):g}")
    page.wait_for_timeout(3000)
    screenshot(page, f"lab-{slug}")
    expect(page.locator("#banner")).not_to_contain_text("defect of the lab")
