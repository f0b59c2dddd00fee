"""Pontryagin's conditions: the minimiser of H, both ways to solve them, and what costates mean."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.linalg import expm

from labs.algorithms import indirect, indirect_shooting
from labs.algorithms.indirect import Extremal
from labs.errors import LabError
from labs.optimal_control.families.cost import SwingCost
from labs.optimal_control.families.motion import first_guess
from labs.optimal_control.families.systems import BLOCK_ON_A_LINE, PENDULUM, UprightBody
from labs.problems.continuous_control import ContinuousProblem, StateConstraint
from labs.resumable import run_to_completion

COST = SwingCost(w_q=1.0, w_v=0.05, w_u=0.2, w_f=10.0, w_vf=1.0)
ENDLESS = np.full(2, np.inf)


def problem(
    body: UprightBody,
    x0: tuple[float, float],
    T: float,
    u_max: float = np.inf,
    cost: SwingCost = COST,
) -> ContinuousProblem:
    bound = np.array([u_max])
    return ContinuousProblem(body, cost, np.array(x0), T, -ENDLESS, ENDLESS, -bound, bound)


def solve_by_collocation(
    of: ContinuousProblem, swing: float = 0.5, tolerance: float = 1e-8
) -> Extremal:
    guess = first_guess(of, swing)
    some = slice(None, None, 3)
    t, X, P = guess.t[some], guess.X[some], guess.P[some]
    return run_to_completion(indirect.solve(of, t, X, P, tolerance, 5000))


def solve_by_shooting(of: ContinuousProblem, swing: float = 0.5) -> Extremal:
    return run_to_completion(indirect_shooting.shoot(of, first_guess(of, swing).P[0], steps=400))


def riccati(T: float, cost: SwingCost = COST) -> np.ndarray:
    """P(0) of the mass of 1 kg, from the Hamiltonian matrix."""
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    H = np.block([[A, -B @ B.T / cost.w_u], [-np.diag([cost.w_q, cost.w_v]), -A.T]])
    XY = expm(-H * T) @ np.vstack([np.eye(2), np.diag([cost.w_f, cost.w_vf])])
    return np.asarray(XY[2:] @ np.linalg.inv(XY[:2]))


# The minimiser of H ---------------------------------------------------------------------------


def test_the_minimiser_is_the_least_of_all_controls() -> None:
    rng = np.random.default_rng(1)
    of = problem(PENDULUM, (1.0, 0.0), 1.0, 2.0)
    X, P = rng.normal(size=(30, 2)), rng.normal(size=(30, 2))
    tried = np.linspace(-2.0, 2.0, 4001)
    H = np.stack([indirect.hamiltonian(of, X, np.full((30, 1), u), P) for u in tried])
    best = tried[H.argmin(axis=0)]
    u = indirect.hamiltonian_minimiser(of, X, P)[:, 0]
    np.testing.assert_allclose(u, best, atol=1e-3)
    assert (np.abs(u) == 2.0).any()
    assert (np.abs(u) < 2.0).any()


def test_a_free_control_has_no_minimiser() -> None:
    of = problem(PENDULUM, (1.0, 0.0), 1.0, 2.0, replace(COST, w_u=0.0))
    with pytest.raises(LabError, match="weight above zero"):
        indirect.hamiltonian_minimiser(of, np.zeros((1, 2)), np.zeros((1, 2)))


def test_a_free_time_is_refused() -> None:
    of = replace(problem(PENDULUM, (1.0, 0.0), 1.0), T_limits=(0.5, 2.0))
    with pytest.raises(LabError, match="fixed T"):
        solve_by_collocation(of)


# Known solutions ------------------------------------------------------------------------------


@pytest.mark.parametrize("way", [solve_by_collocation, solve_by_shooting])
def test_a_linear_quadratic_problem_is_riccatis(way) -> None:  # type: ignore[no-untyped-def]
    x = np.array([1.0, -0.5])
    found = way(problem(BLOCK_ON_A_LINE, (1.0, -0.5), 2.0))
    P = riccati(2.0)
    assert found.converged
    assert found.cost == pytest.approx(x @ P @ x, abs=1e-9)
    np.testing.assert_allclose(found.P[0], 2.0 * P @ x, atol=1e-8)
    for t in (0.5, 1.0, 1.7):
        there = indirect.resample_extremal(
            found, problem(BLOCK_ON_A_LINE, (1.0, -0.5), 2.0), np.array([t])
        )
        np.testing.assert_allclose(there.P[0], 2.0 * riccati(2.0 - t) @ there.X[0], atol=1e-8)


@pytest.mark.parametrize("way", [solve_by_collocation, solve_by_shooting])
def test_least_energy_to_a_given_end(way) -> None:  # type: ignore[no-untyped-def]
    """From (1, 0) to rest at 0 in 1 s: u = 12 t - 6, at a cost of 12."""
    free = SwingCost(0.0, 0.0, 1.0, 0.0, 0.0)
    of = problem(BLOCK_ON_A_LINE, (1.0, 0.0), 1.0, cost=free)
    found = way(replace(of, x_final=np.zeros(2)))
    assert found.converged
    assert found.cost == pytest.approx(12.0, abs=1e-7)
    np.testing.assert_allclose(found.U[:, 0], 12.0 * found.t - 6.0, atol=1e-6)
    np.testing.assert_allclose(found.X[-1], 0.0, atol=1e-8)


def test_both_ways_meet_at_the_pendulum() -> None:
    of = problem(PENDULUM, (np.pi, 0.0), 0.6, 4.0)
    one, other = solve_by_collocation(of, tolerance=1e-6), solve_by_shooting(of)
    assert one.converged
    assert other.converged
    assert one.cost == pytest.approx(other.cost, rel=1e-6)
    np.testing.assert_allclose(one.P[0], other.P[0], rtol=1e-4)
    H = indirect.hamiltonian(of, one.X, one.U, one.P)
    np.testing.assert_allclose(H, H[0], rtol=1e-4)


def test_the_costate_is_the_gradient_of_the_optimal_cost() -> None:
    """By finite differences of the cost over the start."""

    def cost(q: float, v: float) -> float:
        found = solve_by_collocation(problem(PENDULUM, (q, v), 0.8))
        assert found.converged
        return found.cost

    p = solve_by_collocation(problem(PENDULUM, (2.5, -0.5), 0.8)).P[0]
    e = 1e-4
    by_q = (cost(2.5 + e, -0.5) - cost(2.5 - e, -0.5)) / (2.0 * e)
    by_v = (cost(2.5, -0.5 + e) - cost(2.5, -0.5 - e)) / (2.0 * e)
    np.testing.assert_allclose(p, [by_q, by_v], rtol=1e-5)


# Why it ends ----------------------------------------------------------------------------------


def test_a_limit_on_the_state_that_is_broken_is_not_converged() -> None:
    of = problem(BLOCK_ON_A_LINE, (1.0, 0.0), 2.0)
    found = solve_by_collocation(replace(of, x_lower=np.array([-np.inf, -0.5])))
    assert not found.converged
    assert found.stopped.startswith("Infeasible: ")
    assert "the limit on x_2 is exceeded" in found.stopped
    assert solve_by_collocation(replace(of, x_lower=np.array([-np.inf, -5.0]))).converged


def test_a_path_constraint_that_is_broken_is_named() -> None:
    @dataclass(frozen=True)
    class Post(StateConstraint):
        size: int = 1

        def values(self, X: np.ndarray) -> np.ndarray:
            return np.asarray(0.5 - X[:, :1])

        def jacobians(self, X: np.ndarray) -> np.ndarray:
            return np.tile([[[-1.0, 0.0]]], (len(X), 1, 1))

        def name(self, i: int) -> str:
            return "the distance from the post"

    found = solve_by_collocation(replace(problem(BLOCK_ON_A_LINE, (1.0, 0.0), 2.0), path=Post()))
    assert not found.converged
    assert "the distance from the post is exceeded" in found.stopped


def test_shooting_says_what_is_in_its_way() -> None:
    far = solve_by_shooting(problem(PENDULUM, (np.pi, 0.0), 1.5, 4.0))
    assert not far.converged
    assert far.stopped.startswith("The line search ends")
    of = problem(PENDULUM, (1.0, 0.0), 3.0)
    wild = run_to_completion(indirect_shooting.shoot(of, np.array([1e7, 1e7])))
    assert not wild.converged
    assert "diverges" in wild.stopped
    short = problem(PENDULUM, (np.pi, 0.0), 0.6, 4.0)
    p0 = first_guess(short, 0.5).P[0]
    cut = run_to_completion(indirect_shooting.shoot(short, p0, iterations=1))
    assert cut.stopped.startswith("Stopped short after 1 Newton")


def test_collocation_says_how_far_it_has_come() -> None:
    of = problem(PENDULUM, (np.pi, 0.0), 1.5, 4.0)
    guess = first_guess(of, 0.5)
    found = run_to_completion(indirect.solve(of, guess.t, guess.X, guess.P, 1e-9, 200))
    assert not found.converged
    assert found.stopped.startswith("Stopped short: on ")
    assert found.residual > 1e-9
