"""Dynamic programming on the continuous problem (notes, 2.2.2): time, states and controls are
discretised, and what remains is a finite MDP, solved exactly by backward recursion.

From each node, for each level of u, the motion is integrated for a step dt, and its end moved to
the nearest node, or where it leaves the grid, to the nearest at its edge.
"""

import numpy as np

from labs.algorithms.hjb import StateGrid
from labs.problems.continuous_control import ContinuousProblem
from labs.problems.finite_mdp import FiniteMDP
from labs.resumable import Resumable

SUBSTEP = 0.025
"""[s] the longest step of integration."""


def integrate(
    problem: ContinuousProblem, X: np.ndarray, U: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """States (k, nx) after dt [s] under held controls U (k, nu), and the cost (k,) on the way: the
    classical Runge-Kutta method, and Simpson's rule in its stages."""
    steps = int(np.ceil(dt / SUBSTEP - 1e-9))
    h = dt / steps
    f, rate = problem.dynamics.derivatives, problem.cost.running
    cost = np.zeros(len(X))
    for _ in range(steps):
        k1 = f(X, U)[0]
        X2 = X + 0.5 * h * k1
        k2 = f(X2, U)[0]
        X3 = X + 0.5 * h * k2
        k3 = f(X3, U)[0]
        X4 = X + h * k3
        k4 = f(X4, U)[0]
        cost += h / 6.0 * (rate(X, U) + 2.0 * (rate(X2, U) + rate(X3, U)) + rate(X4, U))
        X = X + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return X, cost


def nearest_node(grid: StateGrid, X: np.ndarray) -> np.ndarray:
    """(k,) numbers of the nodes nearest to X (k, 2)."""
    places = np.rint(grid.cells(X)).astype(np.int64)
    i, j = (np.clip(places[:, k], 0, grid.shape[k] - 1) for k in (0, 1))
    return np.asarray(i * grid.shape[1] + j, dtype=np.int32)


def discretize_to_mdp(
    problem: ContinuousProblem, grid: StateGrid, dt: float, levels: np.ndarray
) -> Resumable[FiniteMDP]:
    """The MDP of steps of dt and these controls (U,). Pauses after each of them."""
    columns = []
    for u in levels:
        ends, cost = integrate(problem, grid.nodes, np.full((len(grid.nodes), 1), u), dt)
        columns.append((nearest_node(grid, ends), cost))
        yield
    successor = np.stack([column[0] for column in columns], axis=1)
    C = np.stack([column[1] for column in columns], axis=1)
    return FiniteMDP(C, 1.0, np.zeros(len(grid.nodes), bool), successor=successor)
