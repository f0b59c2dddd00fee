"""The theorems of MPC (notes, 2.5.2 and 2.5.3), tried at many states: with terminal set and cost
it stays feasible and its value falls by at least the cost of a stage; without, neither holds."""

from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms.admissible_set import closed_loop_limits, maximal_output_admissible_set
from labs.algorithms.invariant_sets import feasible_sets
from labs.algorithms.linear_mpc import LinearPlanner
from labs.algorithms.polygons import vertices
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import box
from labs.resumable import run_to_completion
from tests.labs.algorithms.linear_mpc_problems import DOUBLE_INTEGRATOR, riccati

UNSTABLE = LinearMpcProblem(
    N=5,
    A=np.array([[1.15, 0.105], [3.1, 1.15]]),
    B=np.array([[0.031], [0.63]]),
    Q=np.diag([1.0, 0.1]),
    R=np.array([[1.0]]),
    Q_f=np.zeros((2, 2)),
    state_set=box([-0.5, -3.0], [0.5, 3.0]),
    control_set=box([-2.0], [2.0]),
)
"""An inverted pendulum, every 0.1 s."""


def stabilising(problem: LinearMpcProblem) -> LinearMpcProblem:
    """With Riccati's P and the maximal set in which its gain meets all limits for ever."""
    P, K = riccati(problem)
    limits = closed_loop_limits(K, problem.state_set, problem.control_set)
    found = maximal_output_admissible_set(problem.A + problem.B @ K, limits)
    assert found.found
    return replace(problem, Q_f=P, terminal_set=found.set)


def feasible_starts(problem: LinearMpcProblem, count: int, rng: np.random.Generator) -> np.ndarray:
    """Evenly over X_0."""
    X_0 = feasible_sets(problem)[0]
    corners = vertices(X_0)
    X = rng.uniform(corners.min(axis=0), corners.max(axis=0), (20 * count, 2))
    X = X[X_0.contains(X)][:count]
    assert len(X) == count
    return np.asarray(X)


def excesses(problem: LinearMpcProblem, X: np.ndarray, periods: int) -> np.ndarray:
    """V*(x+) - V*(x) + l(x, u*_0) over the closed loop from each of X: (periods, len(X)), NaN from
    where it is infeasible on."""
    planner, found = LinearPlanner(problem), []
    V, u = run_to_completion(planner.values(X))
    for _ in range(periods):
        paid = ((X @ problem.Q) * X).sum(axis=1) / 2 + ((u @ problem.R) * u).sum(axis=1) / 2
        X = X @ problem.A.T + u @ problem.B.T
        after, u = run_to_completion(planner.values(np.nan_to_num(X, nan=1e3)))
        found.append(after - V + paid)
        V = after
    return np.array(found)


def check(problem: LinearMpcProblem, count: int) -> None:
    with_both = stabilising(problem)
    X = feasible_starts(with_both, count, np.random.default_rng(0))
    found = excesses(with_both, X, 12)
    assert np.isfinite(found).all(), "stays feasible"
    assert found.max() < 1e-8, "falls by at least l"


@pytest.mark.parametrize("problem", [DOUBLE_INTEGRATOR, UNSTABLE], ids=["cart", "pendulum"])
def test_terminal_set_and_cost_make_it_stable(problem: LinearMpcProblem) -> None:
    check(problem, 300)


@pytest.mark.study
@pytest.mark.parametrize("problem", [DOUBLE_INTEGRATOR, UNSTABLE], ids=["cart", "pendulum"])
def test_at_ten_thousand_states(problem: LinearMpcProblem) -> None:
    check(problem, 10_000)


@pytest.mark.parametrize("problem", [DOUBLE_INTEGRATOR, UNSTABLE], ids=["cart", "pendulum"])
def test_without_them_there_are_counterexamples(problem: LinearMpcProblem) -> None:
    """Three steps ahead, among feasible states some lead out of the feasible ones, at some the
    value rises, and the pendulum falls even without limits, each plan optimal."""
    problem, falls, rng = replace(problem, N=3), problem is UNSTABLE, np.random.default_rng(0)
    X = feasible_starts(problem, 300, rng)
    found = excesses(problem, X, 12)
    assert np.isnan(found).any()
    assert np.nanmax(found) > 0.01
    free = replace(problem, state_set=box([-np.inf] * 2, [np.inf] * 2))
    planner, x, rises = LinearPlanner(free), np.array([0.01, 0.0]), []
    for _ in range(12):
        plan = run_to_completion(planner.plan(x, None))
        assert plan.found
        rises.append(plan.cost)
        x = plan.X[1]
    assert (np.diff(rises) > 0.0).all() == falls
