"""Markov chains and Markov decision processes written down as tables, to be typed or pasted.

As CSV (commas, semicolons or tabs), a heading and a row for each state, or for each state and
control where there are controls:

    state, cost, A,   B              state, control, cost, A,   B
    A,     1,    1/2, 1/2            A,     stay,    1,    1,   0
    B,     0,    0,   1              A,     go,      3,    0.2, 0.8
                                     B,     ,        0,    0,   1

or as JSON, a list of rows:

    [{"state": "A", "control": "go", "cost": 3, "to": {"A": 0.2, "B": 0.8}}, ...]

The order of the rows is the order of the states. Costs may be left out (0), and so may
probabilities that are 0. A row without a control, among others that have one, is of all controls.
Rows are counted from 1 below the heading; errors name them.
"""

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP

SUM_TOLERANCE = 1e-6
"""How far a row may be from summing to 1: somebody wrote 0.333333."""
MAX_COST = 1e6
"""Of a cost, either sign."""

MAX_STATES = 1000
"""States of a table."""


@dataclass(frozen=True, eq=False)
class Table:
    """A Markov decision process with names; with a single control, a Markov reward process."""

    states: tuple[str, ...]
    controls: tuple[str, ...]
    """One empty name where the table has no controls."""
    P: np.ndarray
    """(U, X, X) probabilities of the next state."""
    C: np.ndarray
    """(X, U) costs."""

    @property
    def terminal(self) -> np.ndarray:
        """(X,) bool: states that whatever is done lead to themselves, for nothing."""
        stays = np.all(np.diagonal(self.P, axis1=1, axis2=2) == 1.0, axis=0)
        ends: np.ndarray = stays & ~self.C.any(axis=1)
        return ends

    def mdp(self, gamma: float) -> FiniteMDP:
        """As arrays for the algorithms."""
        return FiniteMDP(self.C, gamma, self.terminal, P=self.P)


@dataclass(frozen=True)
class _Row:
    number: int
    state: str
    control: str
    cost: float
    to: Mapping[str, float]

    @property
    def name(self) -> str:
        return _name(self.number, self.state, self.control)


def parse_table(text: str, most: int = MAX_STATES) -> Table:
    """The table of at most `most` states a text holds, CSV or JSON. Raises LabError with the row
    that is wrong, what it says and what is allowed."""
    rows = list(_json_rows(text) if text.lstrip()[:1] in ("[", "{") else _csv_rows(text))
    if not rows:
        raise LabError("the table has no rows: it needs one for each state")
    states = tuple(dict.fromkeys(row.state for row in rows))
    controls = tuple(dict.fromkeys(row.control for row in rows if row.control)) or ("",)
    X, U = len(states), len(controls)
    if len(states) > most:
        raise LabError(f"the table has {X} states: at most {most} are allowed")
    P, C = np.zeros((U, X, X)), np.zeros((X, U))
    known = np.zeros((X, U), bool)
    for row in rows:
        x = states.index(row.state)
        us = list(range(U)) if not row.control else [controls.index(row.control)]
        if known[x, us].any():
            raise LabError(f"{row.name}: there is an earlier row for the same; one goes")
        known[x, us] = True
        C[x, us] = row.cost
        P[us, x] = _probabilities(row, states)
    missing = np.argwhere(~known)
    if len(missing):
        x, u = missing[0]
        raise LabError(f"the table has no row for state {states[x]} under control {controls[u]}")
    return Table(states, controls, P, C)


def _probabilities(row: _Row, states: tuple[str, ...]) -> np.ndarray:
    """(X,) of the next state."""
    p = np.zeros(len(states))
    for name, value in row.to.items():
        if name not in states:
            raise LabError(
                f"{row.name}: it leads to {name!r}, which has no row; "
                f"the states are {', '.join(states)}"
            )
        if not 0.0 <= value <= 1.0:
            raise LabError(f"{row.name}: {value:g} for {name}: a probability is from 0 to 1")
        p[states.index(name)] = value
    if abs(p.sum() - 1.0) > SUM_TOLERANCE:
        raise LabError(
            f"{row.name}: the probabilities sum to {p.sum():.6g}; they must sum to 1 "
            "(fractions such as 1/3 are fine)"
        )
    shares: np.ndarray = p / p.sum()
    return shares


def _csv_rows(text: str) -> Iterator[_Row]:
    heading = next((line for line in text.splitlines() if line.strip()), "")
    mark = next((mark for mark in "\t;" if mark in heading), ",")
    try:
        lines = list(csv.reader(io.StringIO(text), delimiter=mark, skipinitialspace=True))
    except csv.Error as error:
        raise LabError(f"the table cannot be read: {error}") from None
    cells = [[cell.strip() for cell in line] for line in lines if any(map(str.strip, line))]
    columns = cells[0] if cells else []
    if not columns or columns[0].lower() != "state":
        raise LabError(
            "the heading of a table begins with state, then control and cost where there are any, "
            "then the name of each state: state, cost, A, B"
        )
    if len(set(columns)) < len(columns) or "" in columns:
        raise LabError(f"each column has a name of its own; the heading is {', '.join(columns)}")
    columns_lower = [
        name.lower() if name.lower() in ("control", "cost") else name for name in columns
    ]
    for number, line in enumerate(cells[1:], 1):
        if len(line) != len(columns):
            raise LabError(
                f"{_name(number, line[0])}: {len(line)} entries for {len(columns)} columns"
            )
        named = dict(zip(columns_lower[1:], line[1:], strict=True))
        control = named.pop("control", "")
        name = _name(number, line[0], control)
        if mark != ",":  # numbers may then have a decimal comma
            named = {key: entry.replace(",", ".") for key, entry in named.items()}
        yield _row(number, line[0], control, _number(named.pop("cost", ""), name, "cost"), named)


def _json_rows(text: str) -> Iterator[_Row]:
    try:
        rows = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise LabError(f"the table is not sound JSON: {error}") from None
    if not isinstance(rows, list):
        raise LabError('a table in JSON is a list of rows: [{"state": "A", "to": {"A": 1}}]')
    for number, row in enumerate(rows, 1):
        if not isinstance(row, dict) or not isinstance(row.get("to"), dict):
            raise LabError(
                f'row {number}: a row is {{"state": "A", "cost": 1, "to": {{"A": 1}}}}, '
                'with a "control" where there are any'
            )
        strange = set(row) - {"state", "control", "cost", "to"}
        if strange:
            raise LabError(
                f"row {number}: {', '.join(sorted(strange))}? A row has state, control, cost, to"
            )
        state, control = (str(row.get(key, "")).strip() for key in ("state", "control"))
        name = _name(number, state, control)
        cost = _number(row.get("cost", 0), name, "cost")
        yield _row(number, state, control, cost, row["to"])


def _row(number: int, state: str, control: str, cost: float, to: Mapping[str, Any]) -> _Row:
    name = _name(number, state, control)
    if not state:
        raise LabError(f"row {number}: it does not name its state")
    if abs(cost) > MAX_COST:
        raise LabError(f"{name}: the cost {cost:g} is beyond {MAX_COST:g}")
    return _Row(number, state, control, cost, {y: _number(p, name, y) for y, p in to.items()})


def _number(entry: object, name: str, column: str) -> float:
    """A number, or a fraction; an empty entry is 0."""
    try:
        top, _, bottom = str(entry).strip().partition("/")
        value = float(top or "0") / float(bottom or "1")
    except (ValueError, ZeroDivisionError):
        value = math.nan
    if not math.isfinite(value):
        raise LabError(f"{name}: {str(entry)[:20]!r} for {column} is not a number")
    return value


def _name(number: int, state: str, control: str = "") -> str:
    """Of a row, in errors."""
    return f"row {number} ({', '.join(filter(None, (state, control)))})"
