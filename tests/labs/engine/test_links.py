"""Links keep what they can (labs/engine/links.py)."""

from collections.abc import Mapping

import pytest

from labs.engine.catalog import find_lab
from labs.engine.links import read_link
from labs.params import Value

CASES: Mapping[str, tuple[dict[str, str], dict[str, Value], int | None, list[str]]] = {
    "all holds": (
        {"omega": "3", "noisy": "true", "seed": "7"},
        {"omega": 3.0, "noisy": True},
        7,
        [],
    ),
    "unknown": (
        {"gain": "500", "fbclid": "x"},
        {"gain": 500.0},
        None,
        ["fbclid is no parameter of this lab, and was left out"],
    ),
    "beyond": (
        {"gain": "1e9", "omega": "3"},
        {"gain": 1000.0, "omega": 3.0},
        None,
        ["gain = 1e9 became 1000, the most it takes"],
    ),
    "below": ({"gain": "-inf"}, {"gain": 0.0}, None, ["gain = -inf became 0, the least it takes"]),
    "no number": (
        {"gain": "much", "omega": "3", "shape": "round"},
        {"omega": 3.0},
        None,
        [
            "gain = much: gain takes a number from 0 to 1000 1/s; it was left out",
            "shape = round: shape takes one of sine, square; it was left out",
        ],
    ),
    "not a number": (
        {"gain": "nan"},
        {},
        None,
        ["gain = nan: gain takes a number from 0 to 1000 1/s; it was left out"],
    ),
    "seed": ({"seed": "-1"}, {}, None, ["seed = -1: it takes a whole number from 0 to 4294967295"]),
    "long": (
        {"utm" * 20: "x"},
        {},
        None,
        [f"{('utm' * 20)[:40]}… is no parameter of this lab, and was left out"],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_link_keeps_what_it_can(name: str) -> None:
    texts, changed, seed, remarks = CASES[name]
    defaults = find_lab("oscillator").lab.Params()
    params, found, said = read_link(defaults, texts)
    assert params.changed_from(defaults) == changed
    assert (found, said) == (seed, remarks)


def test_a_text_that_means_nothing_takes_nothing_else_with_it() -> None:
    defaults = find_lab("markov").lab.Params()
    params, _, remarks = read_link(defaults, {"gamma": "0.5", "table": "1,0\n0,2"})
    assert params.changed_from(defaults) == {"gamma": 0.5}
    assert len(remarks) == 1
    assert remarks[0].startswith("table: ")
    assert remarks[0].endswith("; it was left out")
