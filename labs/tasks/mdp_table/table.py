"""Finite Markov decision processes written down as tables (how: `table_parser.py`), with the names
of their states and controls.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP
from labs.tasks.mdp_table.table_parser import TableRow, read_rows

SUM_TOLERANCE = 1e-6
"""How far a row may be from summing to 1: somebody wrote 0.333333."""
MAX_STATES, MAX_CONTROLS = 100, 20
"""Of a table."""
MAX_NAMED_STATES = 12
"""States at most that a message lists."""


@dataclass(frozen=True, eq=False)
class MdpTable:
    """A Markov decision process with names; with a single control, a Markov reward process."""

    states: tuple[str, ...]
    controls: tuple[str, ...]
    """One empty name where the table has no controls."""
    P: np.ndarray
    """(U, X, X) probabilities of the next state."""
    C: np.ndarray
    """(X, U) costs."""
    control_index: np.ndarray
    """(X, U) int: the control itself, or where a state does not have it the one in its place."""
    notes: tuple[str, ...] = ()
    """What was understood otherwise than written, in sentences."""

    @property
    def terminal(self) -> np.ndarray:
        """(X,) bool: states that whatever is done lead to themselves, for nothing."""
        stays = np.all(np.diagonal(self.P, axis1=1, axis2=2) == 1.0, axis=0)
        ends: np.ndarray = stays & ~self.C.any(axis=1)
        return ends

    @property
    def available(self) -> np.ndarray:
        """(X, U) bool: which controls a state has."""
        return np.asarray(self.control_index == np.arange(len(self.controls)))

    def mdp(self, gamma: float) -> FiniteMDP:
        """As arrays for the algorithms."""
        available = None if self.available.all() else self.available
        return FiniteMDP(self.C, gamma, self.terminal, P=self.P, available=available)

    def control(self, x: int, u: int) -> str:
        """The name of what control u of state x does."""
        return self.controls[int(self.control_index[x, u])]


@lru_cache(maxsize=16)
def parse_table(text: str, most: int = MAX_STATES) -> MdpTable:
    """The table of at most `most` states a text holds, CSV or JSON. Raises LabError with the row
    that is wrong, what it says and what is allowed."""
    entries, notes = read_rows(text)
    if not entries:
        raise LabError("the table has no rows: it needs one for each state")
    named = dict.fromkeys(entry.state for entry in entries)
    ends = dict.fromkeys(y for entry in entries if entry.long for y in entry.to if y not in named)
    states = tuple(dict.fromkeys([*named, *ends]))
    controls = tuple(dict.fromkeys(e.control for e in entries if e.control)) or ("",)
    for things, count, allowed in (("states", states, most), ("controls", controls, MAX_CONTROLS)):
        if len(count) > allowed:
            raise LabError(f"the table has {len(count)} {things}: at most {allowed} are allowed")
    if ends:
        have, which = ("has", "it") if len(ends) == 1 else ("have", "them")
        notes += (f"{', '.join(ends)} {have} no row: an episode ends in {which}, at no cost.",)
    P, C, known = _assemble_matrices(entries, states, controls)
    over = {y for entry in entries for y in entry.terminal_states}
    x = [k for k, name in enumerate(states) if name in ends or name in over]
    P[:, x], C[x], known[x] = np.eye(len(states))[x], 0.0, True
    return MdpTable(states, controls, *_fill_missing_controls(P, C, known), notes)


def _assemble_matrices(
    entries: Iterable[TableRow], states: Sequence[str], controls: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """P, C, and which (X, U) there are rows for."""
    X, U = len(states), len(controls)
    P, C, known = np.zeros((U, X, X)), np.zeros((X, U)), np.zeros((X, U), bool)
    long: dict[tuple[int, int], TableRow] = {}
    place = {name: k for k, name in enumerate(states)}
    for entry in entries:
        x = place[entry.state]
        us = list(range(U)) if not entry.control else [controls.index(entry.control)]
        p = np.zeros(X)
        for name, value in entry.to.items():
            if name not in place:
                known_names = ", ".join(states[:MAX_NAMED_STATES])
                more = ", ..." * (len(states) > MAX_NAMED_STATES)
                raise LabError(
                    f"{entry.name}: it leads to {name!r}, which has no row; "
                    f"the states are {known_names}{more}"
                )
            p[place[name]] += value
        if not entry.long:
            if known[x, us].any():
                raise LabError(f"{entry.name}: there is an earlier row for the same; one goes")
            _check_sum(entry.name, float(p.sum()))
            P[us, x], C[x, us] = p / p.sum(), entry.cost
        else:
            P[us, x] += p
            C[x, us] += p.sum() * entry.cost
            long |= {(x, u): entry for u in us}
        known[x, us] = True
    for (x, u), entry in long.items():
        total = float(P[u, x].sum())
        _check_sum(f"from {entry.state}{f' under {entry.control}' * bool(entry.control)}", total)
        P[u, x], C[x, u] = P[u, x] / total, C[x, u] / total
    return P, C, known


def _check_sum(name: str, total: float) -> None:
    if not abs(total - 1.0) <= SUM_TOLERANCE:
        raise LabError(
            f"{name}: the probabilities sum to {total:.10g}; they must sum to 1 "
            "(fractions such as 1/3 are fine)"
        )


def _fill_missing_controls(
    P: np.ndarray, C: np.ndarray, known: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """P and C with a control of its own, one after the other, where a state lacks one; and which
    that is, (X, U)."""
    X, U = known.shape
    has = np.tile(np.arange(U), (X, 1))
    for x in range(X):
        own = np.flatnonzero(known[x])
        lacks = np.flatnonzero(~known[x])
        has[x, lacks] = own[np.arange(len(lacks)) % len(own)]
        P[:, x], C[x] = P[has[x], x], C[x, has[x]]
    return P, C, has
