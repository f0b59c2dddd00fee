"""Plots that leave the page: pictures of every kind, read back; their data; the page on paper."""

import csv
import io
import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from PIL import Image
from playwright.sync_api import Page, expect

from tests.browser.conftest import SCREENSHOTS
from tests.browser.lab_page import LabPage

SVG = "{http://www.w3.org/2000/svg}"
DRAWN = {
    "Position": {"polyline": 3, "path": 2},
    "Waves": {"polyline": 2, "path": 8},
    "Field": {"rect": 400},
    "Matrix": {"rect": 4, "line": 2},
    "Bars": {"rect": 2, "line": 6},
    "Note": {"text": 3},
}
"""Of each kind of plot what is at least in its picture."""
ALL = "Save all plots"


def save(page: Page, name: str, form: str) -> tuple[str, bytes]:
    """The name and the content of a file from the menu that a button of this name opens."""
    page.get_by_role("button", name=name, exact=True).click()
    with page.expect_download() as download:
        page.locator(f"[data-save={form}]").click()
    return download.value.suggested_filename, Path(download.value.path()).read_bytes()


def count(root: ElementTree.Element, name: str) -> int:
    return len(root.findall(f".//{SVG}{name}"))


def picture_texts(root: ElementTree.Element) -> str:
    """All texts of a picture, one a line."""
    return "\n".join("".join(text.itertext()) for text in root.iter(f"{SVG}text"))


def save_for_review(name: str, content: bytes) -> None:
    """For people to look at."""
    SCREENSHOTS.mkdir(exist_ok=True)
    (SCREENSHOTS / name).write_bytes(content)


def check_picture(root: ElementTree.Element, png: bytes) -> None:
    """Vectors that stand alone, and the same in double size and in colours."""
    assert not {one.tag for one in root.iter()} & {f"{SVG}{n}" for n in ("image", "foreignObject")}
    assert not [one.attrib for one in root.iter() if one.attrib.keys() & {"class", "style"}]
    assert "var(" not in ElementTree.tostring(root, encoding="unicode")
    image = Image.open(io.BytesIO(png)).convert("RGB")
    wide, high = (2 * float(root.attrib[side]) for side in ("width", "height"))
    assert abs(image.width - wide) <= 2
    assert abs(image.height - high) <= 2
    pixels = np.asarray(image, int)
    assert (pixels[0] == 255).all(), "on white, in the dark as well"
    assert (pixels.min(axis=2) < 128).mean() > 0.002, "something is drawn"


def test_every_kind_of_plot_leaves_the_page(page: Page) -> None:
    page.emulate_media(color_scheme="dark")
    lab = LabPage(page, scene=False).open("oscillator", "?gain=25&noisy=true&seed=3")
    lab.pause()
    for title, least in DRAWN.items():
        lab.pin(title)
        lab.wait_filled(".plot:not([hidden])")
        name, svg = save(page, f"Save {title}", "svg")
        assert name == f"oscillator-{title.lower()}.svg"
        root = ElementTree.fromstring(svg)
        for kind, most in least.items():
            assert count(root, kind) >= most, (title, kind)
        said = picture_texts(root)
        assert said.startswith(title)
        for part in ("Oscillator, notes T.1", "seed 3", "= 25 1/s", "Noise = on"):
            assert part in said, title
        png = save(page, f"Save {title}", "png")[1]
        save_for_review(f"figure-{title.lower()}.png", png)
        check_picture(root, png)
        table = save(page, f"Save {title}", "csv")[1].decode()
        data = json.loads(save(page, f"Save {title}", "json")[1])["plots"][0]
        assert data["title"] == title
        header, *rows = csv.reader(io.StringIO(table))
        assert len(rows) > 1
        if title == "Field":
            cells = np.array([float(row[2]) for row in rows])
            np.testing.assert_array_equal(cells, np.ravel(data["data"][data["z"]]))
        if title == "Position":
            assert [float(row[header.index("x")]) for row in rows] == data["data"]["x"]
    check_menu(page, lab)
    svg = save(page, ALL, "svg")[1]
    said = picture_texts(ElementTree.fromstring(svg))
    assert all(title in said for title in [*DRAWN, "Phase"]), "those behind tabs, too"
    png = save(page, ALL, "png")[1]
    save_for_review("figures.png", png)
    check_picture(ElementTree.fromstring(svg), png)
    assert save(page, ALL, "csv")[0] == "oscillator-plots.zip"
    assert len(json.loads(save(page, ALL, "json")[1])["plots"]) == len(DRAWN) + 1
    check_paper(page, lab)


def check_menu(page: Page, lab: LabPage) -> None:
    """Open at one plot, it goes to the other whose button is pressed."""
    lab.pin("Bars")
    lab.pin("Note")
    bars, note = (page.get_by_role("button", name=f"Save {name}") for name in ("Bars", "Note"))
    bars.click()
    expect(bars).to_have_attribute("aria-expanded", "true")
    note.click()
    expect(note).to_have_attribute("aria-expanded", "true")
    expect(bars).to_have_attribute("aria-expanded", "false")
    expect(page.locator("#save-menu .hint")).to_have_text("Save “Note” as")
    note.click()
    expect(page.locator("#save-menu")).to_be_hidden()


def check_paper(page: Page, lab: LabPage) -> None:
    """The article, and the pinned plots as figures; nothing that only a screen can use."""
    lab.pin("Position")
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    figure = page.locator("#printed svg")
    expect(figure).to_be_visible()
    expect(figure).to_contain_text("Position")
    expect(page.locator("#article h1")).to_be_visible()
    for gone in ("#plot-board", "#robot", "#transport", "#knobs", ".bar"):
        expect(page.locator(gone)).to_be_hidden()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    expect(figure).to_have_count(0)


AXES = """async ([height, yLabel, range, logY]) => {
  const { Chart } = await import("/static/js/plots/chart.js");
  const body = document.body.appendChild(document.createElement("div"));
  body.style.cssText = `position: fixed; inset: 0 auto auto 0; width: 300px; height: ${height}px`;
  const chart = new Chart(body);
  chart.svg.style.cssText = "position: absolute; width: 100%; height: 100%; font: 12px system-ui";
  chart.begin([0, 30000], range, { yLabel, logY });
  const frame = body.getBoundingClientRect();
  const texts = [...body.querySelectorAll("text")];
  const whole = texts.every((text) => {
    const box = text.getBoundingClientRect();
    return box.left >= -1 && box.top >= -1 && box.right <= 301 && box.bottom <= height + 1;
  });
  body.remove();
  const upright = texts.filter((text) => text.hasAttribute("transform"));
  const beside = texts.filter((text) => text.getAttribute("text-anchor") === "end");
  const words = (found) => found.map((text) => text.textContent);
  return { whole, label: words(upright), numbers: words(beside) };
}"""


def test_axes_carry_two_numbers_and_their_whole_label(page: Page) -> None:
    page.goto("/")
    for height, label, shown in (
        (200, "beyond the wall [cm]", ["beyond the wall [cm]"]),
        (130, "beyond the wall [cm]", ["beyond the wall [cm]"]),  # longer than the axis alone
        (90, "beyond the wall [cm]", ["beyond the", "wall [cm]"]),
        (60, "distance beyond the farther wall [cm]", ["…", "[cm]"]),
    ):
        axes = page.evaluate(AXES, [height, label, [0, 1], False])
        assert [re.sub(".*…", "…", line) for line in axes["label"]] == shown
        assert axes["whole"], "nothing is cut, the last number of the other axis neither"
    for decades, numbers in (
        ([-2.46, -1.05], ["0.01", "0.03"]),
        ([2.3, 3.9], ["300", "1000", "3000"]),
        ([-3.5, -1.1], ["0.001", "0.01"]),
        ([0.31, 0.69], ["3", "4"]),
        ([-8, 0], ["10⁻⁵", "1"]),
    ):
        assert page.evaluate(AXES, [90, "", decades, True])["numbers"] == numbers
