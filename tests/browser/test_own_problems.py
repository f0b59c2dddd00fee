"""A problem of one's own on the page: from a file that is dropped or chosen to its policy."""

import json
import re
from pathlib import Path

import gymnasium
from playwright.sync_api import Page, expect

from labs.tasks.mdp_table.params import TAXICAB
from tests.browser.lab_page import LabPage

DROP = """([id, name, text]) => {
  const data = new DataTransfer();
  data.items.add(new File([text], name));
  const row = document.getElementById(id);
  for (const type of ["dragover", "drop"])
    row.dispatchEvent(new DragEvent(type, { dataTransfer: data, bubbles: true, cancelable: true }));
}"""


def test_a_table_is_dropped_and_a_map_is_chosen_as_a_file(page: Page, tmp_path: Path) -> None:
    lab = LabPage(page, scene=False).open("dynamic-programming", "?world=table&gamma=0.9")
    field, wrong = lab.value("table"), page.locator("#param-table .wrong")

    # What is wrong stays to be put right, and says where it is.
    page.evaluate(DROP, ["param-table", "taxi.csv", TAXICAB.replace("1/16, 8\nA", "1/8, 8\nA")])
    expect(wrong).to_have_text("table: from A under stand: the probabilities sum to 1.0625; "
        "they must sum to 1 (fractions such as 1/3 are fine)")  # fmt: skip
    expect(field).to_have_attribute("aria-invalid", "true")
    page.evaluate(DROP, ["param-table", "long.csv", "x" * 2_000_000])
    expect(wrong).to_contain_text("long.csv has 1.9 MiB: a text of at most 1 MiB is read")

    excel = "\ufeffsep=;\r\n" + TAXICAB.replace(", ", ";").replace("\n", ";\r\n")
    page.evaluate(DROP, ["param-table", "taxi.csv", excel])
    expect(wrong).to_be_hidden()
    note = lab.pin("Policy by state")
    expect(note).to_contain_text("A: stand, V = −121.653")
    expect(note).to_contain_text("B: stand, V = −135.306")

    # A link leaves out what is too long for it, and says so; the page has it all the same.
    expect(page).to_have_url(re.compile("&table="))
    lake = gymnasium.make("FrozenLake-v1", map_name="8x8").unwrapped.P  # type: ignore[attr-defined]
    page.evaluate(DROP, ["param-table", "lake.json", json.dumps(lake)])
    expect(lab.pin("The world")).to_contain_text("64 states")
    expect(page).not_to_have_url(re.compile("&table="))
    page.locator("[data-do=share]").click()
    expect(page.locator(".toast").last).to_contain_text("Without Your table, too long for a link")
    page.reload()
    lab.wait_live()
    expect(lab.pin("The world")).to_contain_text("64 states")
    expect(page).to_have_url(re.compile("gamma=0.9"))

    lab.value("world").select_option(label="Grid world")
    file = tmp_path / "lake.txt"
    file.write_text("SFFF\nFHFH\nFFFH\nHFFG\nG = reward 1\nH = cost 0\n")
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Map from a file").click()
    chooser.value.set_files(file)
    expect(lab.pin("The world")).to_contain_text("16 states")
    expect(lab.pin("The world")).to_contain_text("Read F as . (free).")


def test_pasted_maps_have_their_published_values(page: Page) -> None:
    """FrozenLake, and the 4 x 3 world of Russell and Norvig, from their text to the start's V."""
    lake = "?gamma=0.99&slip=0.6666666666666666&sideways=true&living=0"
    lab = LabPage(page, scene=False).open("dynamic-programming", lake)
    start = page.locator(".tile", has_text="V of the start")
    paste(lab, "SFFF\nFHFH\nFFFH\nHFFG\nG = reward 1\nH = cost 0")
    expect(start).to_contain_text("−0.542")
    lab.open("dynamic-programming", "?gamma=1&slip=0.2&sideways=true&living=0.04")
    paste(lab, "...+\n.#.-\nS...")
    expect(start).to_contain_text("−0.705")


def paste(lab: LabPage, text: str) -> None:
    """Into the map, which takes it with Ctrl+Enter."""
    lab.value("map").fill(text)
    lab.value("map").press("Control+Enter")
