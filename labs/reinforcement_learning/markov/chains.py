"""Markov chains to look at, as tables, and what it takes to edit one.

The student of the notes (3.3.1) lives here a week of our own making; costs are minimised, so what
pays off has a negative one."""

from collections.abc import Mapping
from functools import cache

import numpy as np

from labs.errors import LabError
from labs.number_texts import parse_number, strip_comments
from labs.tasks.mdp_table.table import MdpTable, parse_table

STUDENT = """state,    cost, Lecture, Exercise, Code, Café, Phone, Sleep
Lecture,  -1,   0,       0.6,      0,    0.1,  0.3,   0
Exercise, -2,   0,       0.2,      0.5,  0.2,  0,     0.1
Code,     -3,   0,       0,        0.5,  0.2,  0,     0.3
Café,     1,    0,       0.4,      0.4,  0,    0.2,   0
Phone,    2,    0.1,     0,        0,    0.1,  0.8,   0
"""
CHAINS: Mapping[str, str] = {
    # The last row closes the week, or ends the term.
    "student": STUDENT + "Sleep,    0,    0.7,     0,        0,    0,    0,     0.3",
    "term": STUDENT + "Sleep,    0,    0,       0,        0,    0,    0,     1",
    "lights": """state,     cost, Red, Get ready, Green, Amber
Red,       3,    0,   1,         0,     0
Get ready, 1,    0,   0,         1,     0
Green,     0,    0,   0,         0,     1
Amber,     2,    1,   0,         0,     0""",
    "doors": """state, cost, Hall, Desk, Sofa, Tick, Tock
Hall,  0,    0.5,  0.3,  0,    0.2,  0
Desk,  -1,   0,    0.6,  0.4,  0,    0
Sofa,  2,    0,    0.8,  0.2,  0,    0
Tick,  1,    0,    0,    0,    0,    1
Tock,  -1,   0,    0,    0,    1,    0""",
    "gambler": """state, cost, 2 coins, 3 coins, Rich, Broke, 1 coin
2 coins, 1, 0,   1/2, 0,   0,   1/2
3 coins, 1, 1/2, 0,   1/2, 0,   0
Rich,    0, 0,   0,   1,   0,   0
Broke,   0, 0,   0,   0,   1,   0
1 coin,  1, 1/2, 0,   0,   1/2, 0""",
    "machine": """state,  control, cost, New, Worn, Broken
New,    run,     0,    0.7, 0.3,  0
New,    mend,    4,    1,   0,    0
Worn,   run,     1,    0,   0.6,  0.4
Worn,   mend,    4,    0.9, 0.1,  0
Broken, run,     6,    0,   0,    1
Broken, mend,    8,    0.5, 0.5,  0""",
}
TITLES: Mapping[str, str] = {
    "student": "A student's weeks",
    "term": "A student's last week",
    "lights": "Traffic lights",
    "doors": "One-way doors",
    "gambler": "A gambler's ruin",
    "machine": "A machine that wears",
    "random": "A random chain",
    "table": "Your table",
}
RANDOM_STATES = 6
"""States of a random chain."""
MAX_WEIGHT = 1e6
"""Weight in an edited row."""
ROW_DECIMALS = 4
"""Decimals of an edited row."""


def chain_table(name: str, number: int, own: str) -> MdpTable:
    """The chain of a name in TITLES: the random one of this number, or the text `own`."""
    if name == "random":
        return random_chain(RANDOM_STATES, number)
    return parse_table(own if name == "table" else CHAINS[name])


@cache
def random_chain(states: int, number: int) -> MdpTable:
    """The chain of this number: from each state to the next one and to two more at random, so
    that it is irreducible; costs from -3 to 3."""
    rng = np.random.default_rng([states, number])
    P, here = np.zeros((states, states)), np.arange(states)
    P[here, (here + 1) % states] = rng.uniform(0.2, 1.0, states)
    for x in range(states):
        P[x, rng.choice(states, 2, replace=False)] += rng.uniform(0.0, 1.0, 2)
    P /= P.sum(axis=1, keepdims=True)
    costs = rng.integers(-3, 4, size=(states, 1)).astype(float)
    return MdpTable(
        tuple(f"S{x + 1}" for x in here), ("",), P[None], costs, np.zeros_like(costs, int)
    )


def parse_rows(text: str) -> dict[int, np.ndarray]:
    """Rows to put in the place of a chain's own, "2: 0 0.5 0.5" a line, by the number of the
    state from 0; weights are scaled to sum to 1. Raises LabError."""
    rows: dict[int, np.ndarray] = {}
    for line in filter(str.strip, strip_comments(text).splitlines()):
        number, colon, entries = line.partition(":")
        try:
            x, weights = int(number) - 1, np.array(list(map(parse_number, entries.split())))
        except ValueError:
            x, weights = -1, np.zeros(0)
        sound = weights.any() and ((weights >= 0.0) & (weights <= MAX_WEIGHT)).all()
        if not (colon and x >= 0 and sound):
            raise LabError(
                f"{line.strip()!r}: a changed row is the number of a state, a colon and a weight "
                "from 0 for each state, as in 2: 0 0.5 0.5"
            )
        if x in rows:
            raise LabError(f"{line.strip()!r}: there is an earlier row of state {x + 1}; one goes")
        rows[x] = weights / weights.sum()
    return rows


def format_rows(rows: Mapping[int, np.ndarray]) -> str:
    """The text that says them."""
    lines = (
        f"{x + 1}: " + " ".join(f"{round(float(p), ROW_DECIMALS):g}" for p in rows[x])
        for x in sorted(rows)
    )
    return "\n".join(lines)


def replace_rows(P: np.ndarray, rows: Mapping[int, np.ndarray]) -> np.ndarray:
    """A copy of P (X, X) with those rows in it that fit."""
    new = P.copy()
    for x, row in rows.items():
        if x < len(P) and len(row) == len(P):
            new[x] = row
    return new


def set_probability(row: np.ndarray, y: int, p: float, own: np.ndarray) -> np.ndarray:
    """A copy of a row (X,) of probabilities in which state y has the probability p. The others
    keep their proportions; where y had all, they have those of `own` (X,), or share alike."""
    if len(row) == 1:
        return np.ones(1)
    choices = (np.delete(row, y), np.delete(own, y), np.ones(len(row) - 1))
    rest = next(weights for weights in choices if weights.any())
    return np.insert(rest * ((1.0 - p) / rest.sum()), y, p)


def shift_probability(p: float, shift: float) -> float:
    """A probability moved towards 0 (shift down to -1: never) or 1 (up to 1: always)."""
    return p + shift * (1.0 - p) if shift > 0.0 else p * (1.0 + shift)
