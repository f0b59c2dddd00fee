"""The two global families: tables of the whole plane, backward in time, and the motions that follow
from them. They are asked only for the start's motion; the tables would serve any other start.

A table once made is kept for the same problem and grid: a start or a moment that changes needs
nothing new of it. What is found does not depend on that, only how soon.
"""

from collections import OrderedDict
from collections.abc import Generator, Hashable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from time import perf_counter
from typing import NamedTuple

import numpy as np

from labs.algorithms import backward_recursion, hjb
from labs.algorithms.hjb import StateGrid, ValueFunction
from labs.algorithms.indirect import hamiltonian_minimiser
from labs.optimal_control.families.cost import SwingCost
from labs.optimal_control.families.motion import MethodMotion, no_motion
from labs.optimal_control.families.params import FamiliesParams
from labs.optimal_control.families.tables import discretize_to_mdp, integrate, nearest_node
from labs.problems.continuous_control import ContinuousProblem
from labs.resumable import Resumable, timed

TABLE_PARTS = 8
"""Parts in which a table is made, each of which is seen."""
CACHE_BYTES = 64 * 2**20
"""[bytes] Of tables, as far as there are more than one of each kind."""
SLOPE_INTERVALS = 15
"""The slope of a table with steps is taken over one of so many parts of an axis."""
HJB_LEVELS = 5
"""Of u among which HJB's minimum is looked for before it is refined."""


@dataclass(frozen=True, eq=False)
class CostToGoTable:
    """Cost-to-go at the nodes and instants, and of dynamic programming the first controls."""

    grid: StateGrid
    T: float
    V: np.ndarray
    """(N + 1, n, n), from t = 0 to T."""
    seconds: float
    """It took."""
    policy: np.ndarray | None = None
    """(N, n^2) numbers of controls."""

    @property
    def function(self) -> ValueFunction:
        """V anywhere."""
        return ValueFunction(self.T, self.grid, self.V)

    def slice_at(self, t: float) -> np.ndarray:
        """V (n, n) at the instant nearest to t [s]."""
        N = len(self.V) - 1
        found: np.ndarray = self.V[min(max(round(t / self.T * N), 0), N)]
        return found

    def gradients(self, X: np.ndarray, t: np.ndarray) -> np.ndarray:
        """(k, 2) of V at states X (k, 2) and times t (k,): of dynamic programming's steps, over
        several cells."""
        V = self.function
        reach = 1 if self.policy is None else max(1, len(self.grid.axes[0]) // SLOPE_INTERVALS)
        return np.array([V.gradient(x, at, 0.5 * reach) for x, at in zip(X, t, strict=True)])


class PartialTable(NamedTuple):
    """Of a table on its way: how far, V (n, n) there, and the table once it is complete."""

    progress: float
    V: np.ndarray
    table: CostToGoTable | None


_table_cache: OrderedDict[Hashable, CostToGoTable] = OrderedDict()


@lru_cache(maxsize=8)
def final_values(cost: SwingCost, grid: StateGrid) -> np.ndarray:
    """l_f at the nodes (n, n), not to be written into."""
    values = np.array([cost.final(x) for x in grid.nodes]).reshape(grid.shape)
    values.flags.writeable = False
    return values


def compute_table(params: FamiliesParams, method: str, nodes: int) -> Iterator[PartialTable | None]:
    """By "hjb" or "dp", in TABLE_PARTS parts, the last with the table; None where it may pause
    within one."""
    numbers = (params.hjb_steps, 0.0) if method == "hjb" else (params.dp_steps, params.levels)
    problem = (params.system, params.cost, params.u_max, params.horizon)
    key = (method, nodes, numbers, problem)
    table = _table_cache.get(key)
    if table:
        for share in range(1, TABLE_PARTS):
            yield PartialTable(
                share / TABLE_PARTS, table.V[-1 - _steps_done(len(table.V) - 1, share)], None
            )
    else:
        table = yield from {"hjb": _compute_hjb, "dp": _compute_dp}[method](params, nodes)
        _table_cache[key] = table
        while (
            len(_table_cache) > 2
            and sum(each.V.nbytes for each in _table_cache.values()) > CACHE_BYTES
        ):
            _table_cache.popitem(last=False)
    yield PartialTable(1.0, table.V[0], table)


def _compute_hjb(
    params: FamiliesParams, nodes: int
) -> Generator[PartialTable | None, None, CostToGoTable]:
    N, spent = round(params.hjb_steps), {"all": 0.0}
    problem, grid = params.problem(np.zeros(2), params.horizon), params.grid(nodes)
    V = np.empty((N + 1, *grid.shape))
    V[N] = final_values(params.cost, grid)
    begun = perf_counter()
    way = hjb.characteristics(problem, grid, problem.T / N)
    tried = hjb.control_levels(problem, HJB_LEVELS)
    spent["all"] += perf_counter() - begun
    for share in range(1, TABLE_PARTS + 1):
        for k in range(_steps_done(N, share - 1), _steps_done(N, share)):
            V[N - k - 1] = yield from timed(hjb.step(V[N - k], way, tried), spent, "all")
        if share < TABLE_PARTS:
            yield PartialTable(share / TABLE_PARTS, V[N - _steps_done(N, share)], None)
    return CostToGoTable(grid, problem.T, V, spent["all"])


def _compute_dp(
    params: FamiliesParams, nodes: int
) -> Generator[PartialTable | None, None, CostToGoTable]:
    N, spent = round(params.dp_steps), {"all": 0.0}
    problem, grid = params.problem(np.zeros(2), params.horizon), params.grid(nodes)
    levels = hjb.control_levels(problem, round(params.levels))
    mdp = yield from timed(discretize_to_mdp(problem, grid, problem.T / N, levels), spent, "all")
    stage = backward_recursion.init(final_values(params.cost, grid).ravel())
    V, policy = np.empty((N + 1, *grid.shape)), np.empty((N, len(grid.nodes)), np.int16)
    V[N] = stage.V.reshape(grid.shape)
    for share in range(1, TABLE_PARTS + 1):
        begun = perf_counter()
        for k in range(_steps_done(N, share - 1), _steps_done(N, share)):
            stage = backward_recursion.step(mdp, stage)
            V[N - k - 1], policy[N - k - 1] = stage.V.reshape(grid.shape), stage.policy
        spent["all"] += perf_counter() - begun
        if share < TABLE_PARTS:
            yield PartialTable(share / TABLE_PARTS, V[N - _steps_done(N, share)], None)
    return CostToGoTable(grid, problem.T, V, spent["all"], policy)


def _steps_done(N: int, share: int) -> int:
    """Steps of N that are done after so many shares."""
    return N * share // TABLE_PARTS


# Motions --------------------------------------------------------------------------------------


def follow_gradient(problem: ContinuousProblem, table: CostToGoTable) -> Resumable[MethodMotion]:
    """From x_0 under u = argmin of H(x, u, V_x(x, t)), held from one sample to the next."""
    motion = no_motion(problem)
    t, X, U, P = motion.t, motion.X.copy(), motion.U.copy(), motion.P.copy()
    V, cost, x = table.function, 0.0, problem.x0
    for k in range(len(t)):
        X[k], P[k] = x, V.gradient(x, t[k])
        u = hamiltonian_minimiser(problem, X[k : k + 1], P[k : k + 1])
        U[k] = u[0, 0]
        if k < len(t) - 1:
            ends, paid = integrate(problem, X[k : k + 1], u, t[k + 1] - t[k])
            x, cost = ends[0], cost + float(paid[0])
        if k % 10 == 0:
            yield
    N = len(table.V) - 1
    return replace(
        motion,
        X=X,
        U=U,
        P=P,
        cost=cost + problem.cost.final(X[-1]),
        promised=V.value(problem.x0, 0.0),
        iterations=N,
        known=True,
        converged=True,
        message=f"Exact up to its grid of {table.grid.shape[0]}² nodes and its {N} steps.",
    )


def follow_table(
    problem: ContinuousProblem, table: CostToGoTable, levels: np.ndarray
) -> Resumable[MethodMotion]:
    """From x_0 under the control that the table has at the nearest node, held for a step."""
    assert table.policy is not None
    motion, N = no_motion(problem), len(table.policy)
    times, states, controls = [0.0], [problem.x0], []
    cost, pieces = 0.0, -(-len(motion.t) // N)
    dt = problem.T / N / pieces
    for k in range(N):
        x = states[-1]
        u = levels[table.policy[k, nearest_node(table.grid, x[None])[0]]]
        for piece in range(pieces):
            ends, paid = integrate(problem, states[-1][None], np.array([[u]]), dt)
            states.append(ends[0])
            times.append(problem.T * (k + (piece + 1) / pieces) / N)
            controls.append(u)
            cost += float(paid[0])
        yield
    place = np.minimum((motion.t / dt + 1e-9).astype(int), len(controls) - 1)
    X = np.stack([np.interp(motion.t, times, column) for column in np.array(states).T], axis=1)
    start = int(nearest_node(table.grid, problem.x0[None])[0])
    return replace(
        motion,
        X=X,
        U=np.array(controls)[place],
        P=table.gradients(X, motion.t),
        cost=cost + problem.cost.final(states[-1]),
        promised=float(table.V[0].ravel()[start]),
        iterations=N,
        known=True,
        converged=True,
        message=(
            f"Exact for {table.grid.shape[0]}² states, {len(levels)} controls and {N} steps, and "
            "for no others."
        ),
    )
