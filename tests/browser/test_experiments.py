"""Predictions, and what an experiment shows: the comparison, the hold, guess beside outcome."""

import re

from playwright.sync_api import Locator, Page, expect

from tests.browser.conftest import screenshot
from tests.browser.lab_page import LabPage, wait_frames

NUMBER, CURVE, ROOT, CHOICE = 1, 2, 3, 4
"""The oscillator's experiments."""


def open_lab(page: Page) -> LabPage:
    page.set_viewport_size({"width": 1366, "height": 650})
    return LabPage(page, scene=False).open("oscillator")


def card(page: Page, number: int) -> Locator:
    return page.locator(".experiment").nth(number)


def test_a_number_is_guessed_held_compared_and_remembered(page: Page) -> None:
    lab = open_lab(page)
    asked = card(page, NUMBER)
    field = asked.get_by_role("textbox", name="Place m")
    verdict = asked.get_by_role("status")
    expect(verdict).to_be_hidden()
    field.fill("half a metre")
    field.press("Enter")
    expect(asked.get_by_role("alert")).to_contain_text("Type a number, such as 2.5")
    assert lab.status()["params"]["omega"] == 2.0
    expect(page.locator(".experiment.current")).to_have_count(0)
    field.fill("−0,3")
    field.press("Enter")
    expect(verdict).to_have_text("Your guess: −0.300 m. Outcome: −0.416 m: 0.12 m too high (28 %).")
    expect(asked.get_by_role("alert")).to_be_hidden()
    expect(page.locator("#clock span")).to_have_text("1.00")
    expect(page.locator("#run")).to_have_text(re.compile("Run"))
    expect(page.locator("#speed-value")).to_have_text("4×")
    expect(page.locator("#window")).to_have_value("3")
    expect(page.locator(".tile.marked")).to_have_text(re.compile("Late"))
    expect(page.locator(".plot.watched h3")).to_have_text(["Position [m]", "Bars [m]"])
    expect(asked.locator(".compared")).to_have_text("Faint: ω=4 rad/s".replace("=", " = "))
    screenshot(page, "prediction")
    page.locator("#run").click()
    expect(page.locator("#clock span")).not_to_have_text("1.00")
    expect(verdict).to_contain_text("Outcome: −0.416 m")
    page.reload()
    lab.wait_live()
    expect(verdict).to_contain_text("Your guess: −0.300 m. Outcome: −0.416 m")
    expect(field).to_have_value("-0.3")
    asked.locator(".try").click()  # without another guess: the old one is tried again
    expect(verdict).to_contain_text("The outcome comes at t = 1 s.")
    expect(verdict).to_contain_text("Outcome: −0.416 m")
    field.fill("-0,4")
    asked.locator(".try").click()  # what is typed counts
    expect(verdict).to_contain_text("Your guess: −0.400 m. Outcome: −0.416 m")


def test_a_curve_is_sketched_on_the_empty_plot(page: Page) -> None:
    lab = open_lab(page)
    asked = card(page, CURVE)
    asked.get_by_role("button", name="Sketch").click()
    pad = page.locator(".sketchpad")
    expect(pad).to_be_visible()
    assert lab.is_in_view(".plot.watched")
    page.keyboard.press("Escape")
    expect(pad).to_have_count(0)
    size = page.viewport_size
    assert size
    page.set_viewport_size({"width": 360, "height": 640})  # a phone: the plot comes to its card
    asked.get_by_role("button", name="Sketch").click()
    expect(asked.locator(".sketchpad")).to_be_visible()
    wait_frames(page)
    assert lab.is_in_view(".sketched")
    assert lab.is_in_view(".sketch-buttons button")
    screenshot(page, "sketch-phone")
    page.get_by_role("button", name="Cancel").click()
    expect(asked.locator(".plot")).to_have_count(0)
    page.set_viewport_size(size)
    asked.get_by_role("button", name="Sketch").click()
    box = pad.bounding_box()
    assert box
    zero = pad.locator("line.zero").first.bounding_box()
    assert zero
    page.mouse.move(box["x"] + 30, zero["y"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], zero["y"])
    page.mouse.up()
    expect(pad.locator(".guess")).to_have_attribute("points", re.compile(r"\d"))
    expect(page.locator(".experiment.current")).to_have_count(0)
    asked.locator(".try").click()  # half of it drawn: that half counts
    expect(asked.get_by_role("status")).to_contain_text("Your curve is off by")
    asked.get_by_role("button", name="Sketch").click()
    page.mouse.move(box["x"] + 30, zero["y"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], zero["y"])
    page.mouse.up()
    page.mouse.move(box["x"] + 0.6 * box["width"], zero["y"])
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] + 30, zero["y"], steps=3)
    page.mouse.up()  # beyond the right edge: that finishes it
    expect(pad).to_have_count(0)
    # Of a flat line from cos 3t over two seconds: the root of (1 + sin 12 / 12) / 2 is 0.691.
    off = asked.get_by_role("status")
    expect(off).to_have_text(re.compile(r"Your curve is off by 0\.(68|69|70)\d* m \(root mean"))
    expect(page.locator("#window")).to_have_value("0")
    screenshot(page, "sketch")


def test_choices_and_solvers_answer_and_what_is_left_leaves_nothing(page: Page) -> None:
    lab = open_lab(page)
    root = card(page, ROOT)
    root.get_by_role("textbox").fill("4")
    root.get_by_role("button", name="Guess").click()
    expect(root.get_by_role("status")).to_have_text("Your guess: 4. Outcome: 4: exactly it.")
    assert lab.next_message(when=lambda s: s["solver"]["done"])["solver"]["pace"] == 30
    asked = card(page, CHOICE)
    asked.get_by_role("button", name="A sine.").click()
    expect(asked.get_by_role("status")).to_contain_text("Not so. The answer: A square, ")
    expect(asked.locator(".right")).to_have_count(1)
    expect(asked.get_by_role("button", name="A sine.")).to_have_attribute("aria-pressed", "true")
    told = lab.next_message(when=lambda s: s["params"]["shape"] == "square")
    assert (told["solver"]["pace"], told["speed"]) == (0, 1)
    asked.locator("[data-choice]").nth(1).click()
    expect(asked.get_by_role("status")).to_have_text("Right.")
    card(page, NUMBER).locator(".try").click()  # skipped: no guess, no verdict
    expect(page.locator("#clock span")).to_have_text("1.00")
    expect(card(page, NUMBER).get_by_role("status")).to_be_hidden()
    card(page, 0).locator(".try").click()
    told = lab.next_message(when=lambda s: s["t"] > 1.2)  # no hold is left
    assert told["running"]
    expect(page.locator(".tile.marked")).to_have_count(0)
    expect(page.locator("#window")).to_have_value("10")


def test_a_browser_that_stores_nothing_predicts_all_the_same(page: Page) -> None:
    page.add_init_script(
        "Storage.prototype.getItem = Storage.prototype.setItem = () => { throw new Error(); };"
    )
    open_lab(page)
    asked = card(page, CHOICE)
    asked.locator("[data-choice]").nth(1).click()
    expect(asked.get_by_role("status")).to_have_text("Right.")
