"""The pages for people who do not see them: axe-core finds nothing serious, plots say in words what
they show."""

import re
from collections.abc import Mapping
from typing import Any, Literal

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from tests.browser.lab_page import LabPage

SWAGGER = "#docs"  # not ours to mend
SCHEMES: Mapping[Literal["dark", "light"], dict[str, list[str]]] = {
    "dark": {"runOnly": ["color-contrast"]},
    "light": {},
}
SPOKEN_ROLES = {"button", "link", "textbox", "slider", "combobox", "checkbox", "radio", "option"}
SPOKEN_ROLES |= {"heading", "image", "region", "navigation", "toolbar", "dialog", "Iframe"}
SUMMARISED = """() => [...document.querySelectorAll(".plot:not([hidden]) [role=img]")]
  .every((plot) => /[.:]/.test(plot.getAttribute("aria-label")))"""
LEAKED_TEXT = r"undefined|\bnull\b|\[object|NaN|[{}\\]|Invalid"
WAIT_FOR_ANIMATIONS = (
    """() => Promise.all(document.getAnimations().map((one) => one.finished.catch(() => {})))"""
)


def axe_violations(page: Page) -> list[str]:
    """What axe-core calls serious or critical; in the dark only colours are other ones."""
    faults = []
    for scheme, rules in SCHEMES.items():
        page.emulate_media(color_scheme=scheme)
        page.evaluate(WAIT_FOR_ANIMATIONS)
        response = Axe().run(page, {"exclude": [[SWAGGER]]}, rules).response
        faults += [
            f"{scheme}: {fault['id']}: {fault['help']} "
            f"{[node['html'][:120] for node in fault['nodes'][:3]]}"
            for fault in response["violations"]
            if fault["impact"] in ("serious", "critical")
        ]
    return faults


def accessibility_tree(page: Page) -> list[tuple[str, str, int]]:
    """What Chromium tells a screen reader, in its order: role, name, level of a heading."""
    nodes = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
    known = {node["nodeId"]: node for node in nodes}
    told: list[tuple[str, str, int]] = []

    def open_context(node: dict[str, Any]) -> None:
        if not node["ignored"]:
            name = node.get("name", {}).get("value", "").strip()
            level = [p["value"]["value"] for p in node["properties"] if p["name"] == "level"]
            told.append((node["role"]["value"], name, int((level or [0])[0])))
        for child in node.get("childIds", []):
            if child in known:
                open_context(known[child])

    open_context(nodes[0])
    return told


def check_tree(page: Page, title: str) -> None:
    """It reads sensibly: landmarks, headings in order, a name for all that acts and all that is
    seen, in words that are no markup and no slip."""
    page.wait_for_function(SUMMARISED)
    told = accessibility_tree(page)
    roles = [role for role, _, _ in told]
    assert [roles.count(one) for one in ("main", "banner", "article", "complementary")] == [1] * 4
    assert [name for role, name, level in told if (role, level) == ("heading", 1)] == [title]
    named = {name for role, name, _ in told if role in ("region", "toolbar", "navigation")}
    assert {"The simulation", "Plots and read-outs", "Plots", "Where you are"} <= named
    nameless = [role for role, name, _ in told if role in SPOKEN_ROLES and not name]
    assert not nameless, f"{title}: without a name: {nameless}"
    wrong = [
        name for role, name, _ in told if role in SPOKEN_ROLES and re.search(LEAKED_TEXT, name)
    ]
    assert not wrong, f"{title}: {wrong}"
    buttons = [name for role, name, _ in told if role == "button"]
    assert "Show or hide" not in buttons, "an entry of a legend is named by what it shows"
    plots = page.locator(".plot:not([hidden]) h3").all_inner_texts()
    for plot in (re.sub(r" \[.*", "", text.replace("\xa0", " ")).strip() for text in plots):
        assert ("region", plot) in {(role, name) for role, name, _ in told}
        assert f"Save {plot}" in buttons


def test_the_pages(page: Page) -> None:
    page.set_viewport_size({"width": 1366, "height": 650})
    for path in ("/", "/docs"):
        page.goto(path)
        page.wait_for_load_state("networkidle")
        assert axe_violations(page) == [], path
    lab = LabPage(page, scene=False).open("markov")
    bars = lab.pin("Distribution now, and in the long run").get_by_role("img")
    expect(bars).to_have_attribute("aria-label", re.compile(r", bars\. \w+: .*; \w+: .*\."))
    page.locator(".experiment .try").first.click()
    expect(page.locator(".experiment.current")).to_be_visible()
    lab.pause()  # axe-core measures anew after every drawing: while plots run, three times as long
    assert axe_violations(page) == []
    check_tree(page, "Markov chains")
    lab.open("joint-control")
    error = lab.pin("Error").get_by_role("img")
    expect(error).to_have_attribute(
        "aria-label", re.compile(r"^Error over time, .*joint 1: (from|constant) .* rad; .*joint 6")
    )
    lab.pause()
    assert axe_violations(page) == []
    check_tree(page, "Joint motion control")
    page.set_viewport_size({"width": 390, "height": 844})
    page.get_by_role("button", name="Plots").click()
    assert axe_violations(page) == []


def test_what_a_screen_reader_is_told(page: Page) -> None:
    """Of one lab of each further kind: a solver with matrices, a map with a table, a plane."""
    page.set_viewport_size({"width": 1366, "height": 650})
    lab = LabPage(page, scene=False)
    for slug, title, plot in (
        ("collocation", "Collocation", "Jacobian of the constraints"),
        ("dynamic-programming", "Dynamic programming", "Policy"),
        ("lqr", "Linear quadratic regulator", "Gain now"),
    ):
        lab.open(slug)
        lab.pin(plot)
        lab.wait_filled(".plot:not([hidden])")
        check_tree(page, title)
        track = page.locator(".knob.knob:not([hidden]) .track").first
        value = page.locator(".knob.knob:not([hidden]) .value.number").first.input_value()
        expect(track).to_have_attribute("aria-valuetext", re.compile(rf"^{re.escape(value)}( |$)"))
