"""The page's knobs: what acts, what folds, the tracks, and the symbols of the article."""

import math

import pytest
from playwright.sync_api import Page, expect

from labs.engine.catalog import catalog
from labs.params import Knob
from tests.browser.lab_page import LabPage

POSITIONS = [0.0, 0.001, 0.1, 1 / 3, 0.5, 0.77, 0.999, 1.0]


def test_tracks_mean_the_same_on_the_page_and_in_python(page: Page) -> None:
    page.goto("/")
    knobs = {
        (slug, name): tunable
        for slug, entry in catalog().items()
        for name, tunable in entry.lab.Params.tunables.items()
        if isinstance(tunable, Knob)
    }
    defaults = {slug: entry.lab.Params().model_dump() for slug, entry in catalog().items()}
    found = page.evaluate(
        """async ([knobs, positions]) => {
          const { positionOf, valueAt } = await import("/static/js/scales.js");
          return knobs.map(([knob, value]) => [
            positionOf(knob, value), ...positions.map((position) => valueAt(knob, position)),
          ]);
        }""",
        [
            [
                [knob.describe(name, default := defaults[slug][name]), default]
                for (slug, name), knob in knobs.items()
            ],
            POSITIONS,
        ],
    )
    assert len(found) == len(knobs) > 100
    for ((slug, name), knob), (position, *values) in zip(knobs.items(), found, strict=True):
        assert position == pytest.approx(knob.position(defaults[slug][name])), (slug, name)
        assert values == [knob.at(p) for p in POSITIONS], (slug, name)
        assert all(math.copysign(1.0, value) > 0.0 for value in values if value == 0.0)


def test_only_what_acts_is_shown_and_what_was_folded_stays_folded(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control", "?ki=40&controller=open-loop")
    gains = [page.locator(f"#param-{name}") for name in ("kp", "ki", "kd")]
    for row in gains:
        expect(row).to_be_hidden()
    top = page.locator("#param-controller").bounding_box()
    lab.value("controller").select_option(label="PID")
    for row in gains:
        expect(row).to_be_visible()
    assert lab.is_in_view("#param-kp"), "all three gains are in view"
    assert lab.is_in_view("#param-ki")
    assert lab.is_in_view("#param-kd")
    assert page.locator("#param-controller").bounding_box() == top, "what stays does not move"
    expect(lab.value("ki")).to_have_value("40")  # kept while it was hidden
    lab.value("controller").select_option(label="PD + gravity compensation")
    expect(page.locator("#param-ki")).to_be_hidden()
    assert lab.status()["params"]["ki"] == 40

    world = page.locator("#knobs summary", has_text="World")
    world.click()
    expect(page.locator("#param-payload")).to_be_hidden()
    page.reload()
    lab.wait_live()
    expect(page.locator("#param-payload")).to_be_hidden()
    expect(page.locator("#param-control_period")).to_be_visible()
    world.click()
    page.goto("/labs/dynamic-programming?world=pendulum")
    lab.wait_live()
    expect(page.locator("#knobs summary", has_text="Grid world")).to_be_hidden()
    expect(page.locator("#knobs summary", has_text="Pendulum")).to_be_visible()


def test_a_symbol_in_the_article_is_its_knob(page: Page) -> None:
    lab = LabPage(page, scene=False).open("joint-control", "?controller=pid")
    entries = page.evaluate("history.length")
    symbol = page.locator("#article span.symbol[data-param=kp]").first
    beside, article = page.locator("#symbol-knob"), page.locator("#article")
    symbol.scroll_into_view_if_needed()
    scrolled = article.evaluate("element => element.scrollTop")

    symbol.hover()
    field = beside.get_by_role("textbox")
    expect(field).to_have_value("200")
    field.fill("99999")
    field.press("Enter")
    expect(beside).to_contain_text("kp takes a number from 0 to 2000")
    field.fill("2,5")
    field.press("Enter")
    lab.next_message(when=lambda s: s["params"]["kp"] == 2.5)
    expect(lab.value("kp")).to_have_value("2.5")
    page.mouse.click(640, 5)
    expect(beside).to_be_hidden()

    box = symbol.bounding_box()
    assert box
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(1, 7):
        page.mouse.move(x + 10 * k, y)
    page.mouse.up()
    dragged = lab.next_message(when=lambda s: s["params"]["kp"] > 10.0)["params"]["kp"]
    expect(beside).to_be_visible()  # it stays for the hand that let go
    assert dragged < 100.0
    page.keyboard.press("Escape")
    page.mouse.click(640, 5)
    expect(beside).to_be_hidden()

    symbol.focus()
    symbol.press("Enter")
    expect(beside.get_by_role("slider")).to_be_focused()
    beside.get_by_role("slider").press("End")
    lab.next_message(when=lambda s: s["params"]["kp"] == 2000.0)
    page.keyboard.press("Escape")
    expect(beside).to_be_hidden()
    expect(symbol).to_be_focused()
    assert article.evaluate("element => element.scrollTop") == scrolled
    assert page.evaluate("history.length") == entries

    page.get_by_role("button", name="Appearance").click()
    page.get_by_label("Numbers in formulas").check()
    expect(symbol).to_contain_text("= 2000")
    formula = page.locator(".formula .symbol[data-param=kp]").first
    expect(formula.locator("mn")).to_have_text("2000")
    expect(formula.locator("msub")).to_be_hidden()
    lab.value("kp").fill("321")
    lab.value("kp").blur()
    expect(formula.locator("mn")).to_have_text("321")
