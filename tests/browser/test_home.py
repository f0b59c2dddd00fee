"""The home page in a browser."""

import re

from playwright.sync_api import Page, expect

from tests.browser.conftest import screenshot
from tests.browser.lab_page import LabPage


def test_the_course_lies_open(page: Page) -> None:
    page.goto("/")
    card = page.get_by_role("link", name="Joint motion control")
    expect(card).to_be_visible()
    picture = card.locator("img")
    assert picture.evaluate("img => img.decode().then(() => img.naturalWidth)") >= 400
    expect(page.locator("#go-on")).to_be_hidden()
    card.click()
    expect(page).to_have_url(re.compile("/labs/joint-control"))
    expect(page.get_by_role("heading", level=1)).to_have_text("Joint motion control")
    LabPage(page, scene=False).wait_live()
    page.goto("/")
    expect(page.locator(".step.opened")).to_have_count(1)
    expect(page.locator("#chapter-1 .progress")).to_have_text(re.compile("1 of"))
    screenshot(page, "home")
    go_on = page.get_by_role("link", name="Go on with Joint motion control")
    expect(go_on).to_have_attribute("href", re.compile("/labs/joint-control$"))


def test_search_filters_by_word_as_one_types(page: Page) -> None:
    page.goto("/")
    page.keyboard.press("/")
    page.keyboard.type("payload")
    expect(page.get_by_role("link", name="Joint motion control")).to_be_visible()
    expect(page.get_by_role("link", name="Oscillator")).to_be_hidden()
    page.keyboard.press("Control+A")
    page.keyboard.type("xyzzy")
    expect(page.get_by_role("link", name="Joint motion control")).to_be_hidden()


def test_an_unknown_lab_is_told_kindly(page: Page) -> None:
    answer = page.goto("/labs/no-such-lab")
    assert answer is not None
    assert answer.status == 404
    expect(page.get_by_role("link", name="Joint motion control")).to_be_visible()
