"""The pages for people who do not see them: axe-core finds nothing serious, plots say in words what
they show."""

import re
from collections.abc import Mapping
from typing import Literal

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.browser.lab_page import LabPage

SWAGGER = "#docs"  # not ours to mend
SCHEMES: Mapping[Literal["dark", "light"], dict[str, list[str]]] = {
    "dark": {"runOnly": ["color-contrast"]},
    "light": {},
}
STILL = """() => Promise.all(document.getAnimations().map((one) => one.finished.catch(() => {})))"""


def found(page: Page) -> list[str]:
    """What axe-core calls serious or critical; in the dark only colours are other ones."""
    faults = []
    for scheme, rules in SCHEMES.items():
        page.emulate_media(color_scheme=scheme)
        page.evaluate(STILL)
        response = Axe().run(page, {"exclude": [[SWAGGER]]}, rules).response
        faults += [
            f"{scheme}: {fault['id']}: {fault['help']} "
            f"{[node['html'][:120] for node in fault['nodes'][:3]]}"
            for fault in response["violations"]
            if fault["impact"] in ("serious", "critical")
        ]
    return faults


def test_the_pages(page: Page) -> None:
    page.set_viewport_size({"width": 1366, "height": 650})
    for path in ("/", "/docs"):
        page.goto(path)
        page.wait_for_load_state("networkidle")
        assert found(page) == [], path
    lab = LabPage(page, scene=False).open("markov")
    bars = lab.pin("Distribution now, and in the long run").get_by_role("img")
    expect(bars).to_have_attribute("aria-label", re.compile(r", bars\. \w+: .*; \w+: .*\."))
    page.locator(".experiment .try").first.click()
    expect(page.locator(".experiment.current")).to_be_visible()
    assert found(page) == []
    lab.open("joint-control")
    error = lab.pin("Error").get_by_role("img")
    expect(error).to_have_attribute(
        "aria-label", re.compile(r"^Error over time, .*joint 1: (from|constant) .* rad; .*joint 6")
    )
    assert found(page) == []
    page.set_viewport_size({"width": 390, "height": 844})
    page.get_by_role("button", name="Plots").click()
    assert found(page) == []
