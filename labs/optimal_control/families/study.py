"""What the global methods owe to the grid, and the local ones to the first guess: the same problem
solved again and again."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from labs.optimal_control.families.global_methods import CostToGoTable, compute_table
from labs.optimal_control.families.local_methods import solve_direct, solve_pontryagin
from labs.optimal_control.families.motion import MethodMotion, first_guess
from labs.optimal_control.families.params import FamiliesParams
from labs.optimal_control.families.tables import nearest_node
from labs.resumable import Resumable

GRID_NODES = (21, 31, 41, 61, 81, 121, 161)
GUESS_SWINGS = np.linspace(-4.0, 4.0, 17)
ROUGH_TOLERANCE = 1e-3
"""The tolerance that is enough to tell minima apart."""


@dataclass(frozen=True, eq=False)
class MethodComparison:
    """A result of two methods at places of the x axis."""

    x: np.ndarray
    """(17,) nodes, or swings of the first guess [rad; m]."""
    y: np.ndarray
    """(17, 2) errors of V(x_0) of HJB and DP, or costs of Pontryagin's and the direct method."""
    found: np.ndarray
    """(17, 2) bool: whether there is one."""
    count: int = 0
    """Places that are done."""

    def progress(self, study: str) -> float:
        """The part of a study that is done."""
        return self.count / len(GRID_NODES if study == "grid" else GUESS_SWINGS)


def no_study() -> MethodComparison:
    """Before the first result."""
    shape = (len(GUESS_SWINGS), 2)
    return MethodComparison(np.zeros(shape[0]), np.zeros(shape), np.zeros(shape, bool))


def run_study(params: FamiliesParams, optimal: MethodMotion) -> Iterator[MethodComparison | None]:
    """The one that is wanted, a point further each time; None in the midst of one. Errors are
    counted from the cost of the `optimal` motion."""
    at = no_study()
    if params.study == "grid":
        for i, nodes in enumerate(GRID_NODES):
            errors = yield from _errors_of_grids(params, nodes, optimal)
            at = _with_point(at, i, nodes, errors, np.array([True, True]))
            yield at
    if params.study == "guess":
        for i, swing in enumerate(GUESS_SWINGS):
            costs, found = yield from _costs_of_guess(params, swing)
            at = _with_point(at, i, swing, costs, found)
            yield at


def _with_point(
    at: MethodComparison, i: int, x: float, y: np.ndarray, found: np.ndarray
) -> MethodComparison:
    new = replace(at, x=at.x.copy(), y=at.y.copy(), found=at.found.copy(), count=i + 1)
    new.x[i], new.y[i], new.found[i] = x, y, found
    return new


def _errors_of_grids(
    params: FamiliesParams, nodes: int, optimal: MethodMotion
) -> Resumable[np.ndarray]:
    promised = []
    for method in ("hjb", "dp"):
        table: CostToGoTable | None = None
        for part in compute_table(params, method, nodes):
            yield None
            table = part.table if part else table
        assert table is not None
        promised.append(value_at(table, params.x0))
    return np.abs(np.array(promised) - optimal.cost)


def value_at(table: CostToGoTable, x: np.ndarray) -> float:
    """V(x, 0) of a table: of dynamic programming at the nearest node."""
    if table.policy is None:
        return table.function.value(x, 0.0)
    return float(table.V[0].ravel()[nearest_node(table.grid, x[None])[0]])


def _costs_of_guess(
    params: FamiliesParams, swing: float
) -> Resumable[tuple[np.ndarray, np.ndarray]]:
    problem = params.problem(params.x0, params.horizon)
    guess = first_guess(problem, swing)
    motion = yield from solve_pontryagin(problem, guess, "collocation", ROUGH_TOLERANCE)
    motions = [motion]
    for found in solve_direct(problem, guess, round(params.intervals)):
        if found:
            motion = found
        yield None
    motions.append(motion)
    return np.array([m.cost for m in motions]), np.array([m.converged for m in motions])
