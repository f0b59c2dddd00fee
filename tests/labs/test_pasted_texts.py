"""Texts that people paste, damaged at random: read, or refused in a sentence, and soon."""

import contextlib
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labs.algorithms.butcher_tableau import parse_tableau
from labs.appendix.integration.params import DORMAND_PRINCE
from labs.errors import LabError
from labs.optimal_control.lqr.own_system import EXAMPLE_SYSTEM, parse_own_system
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.mdp_table.params import TAXICAB
from labs.tasks.mdp_table.table import parse_table

READERS: dict[str, tuple[Callable[[str], object], list[str]]] = {
    "map": (
        lambda text: GridWorld.parse(text).mdp(0.9, 0.3, sideways=True),
        [*MAPS.values(), '["SF", "HG"]', "m.\nSG\nm = cost 3\nG = reward 1, end"],
    ),
    "table": (
        lambda text: parse_table(text).mdp(0.9),
        [
            "\n".join(TAXICAB.splitlines()[:7]),
            "state,cost,A,B\nA,1,1/2,1/2\nB,,,",
            '[{"from": "A", "to": "B", "p": 1}]',
            '{"0": {"0": [[1.0, 0, 0.0, false]]}}',
        ],
    ),
    "tableau": (parse_tableau, [DORMAND_PRINCE, "0 & \\\\ \\frac{1}{2} & 1/2 \\\\ & 0 & 1"]),
    "matrices": (
        parse_own_system,
        [EXAMPLE_SYSTEM, '{"A": [[1]], "B": 1, "Q": 1, "R": 1, "x0": [1]}'],
    ),
}
INVALID_TEXTS = [
    "",
    " ",
    "\n",
    "\t",
    ";",
    ",",
    "|",
    "=",
    "[",
    "]",
    "{",
    '"',
    "\\",
    "&",
    "%",
    "/0",
    "1e9999",
]
INVALID_TEXTS += [
    "nan",
    "null",
    "true",
    "9" * 70,
    "\ufeff",
    "\x00",
    "٣",
    "-",
    "#" * 400,
    "\n" * 900,
]


@pytest.mark.parametrize("kind", READERS)
@given(
    chosen=st.integers(0, 99),
    cuts=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 3), st.sampled_from(INVALID_TEXTS)), max_size=5
    ),
)
@settings(deadline=None, max_examples=150)
def test_a_damaged_text_is_read_or_refused(
    kind: str, chosen: int, cuts: list[tuple[float, int, str]]
) -> None:
    read, sound = READERS[kind]
    text = sound[chosen % len(sound)]
    if not cuts:
        read(text)
    for part, gone, new in cuts:
        place = round(part * len(text))
        text = text[:place] + new + text[place + gone :]
    with contextlib.suppress(LabError):
        read(text)
