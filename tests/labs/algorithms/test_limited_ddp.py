"""DDP within bounds: where it says that it has converged, Ipopt finds nothing better nearby."""

from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms import ddp
from labs.algorithms.ddp import DdpIterate, DdpOptions
from labs.problems.optimal_control import OptimalControlProblem
from labs.tasks.motion.cost import MotionCost
from labs.tasks.motion.motions import MOTIONS, MotionWeights, initial_controls, motion_problem
from tests.labs.algorithms.ipopt_oracle import optimum

NOTICEABLE = 1e-4
"""Of the cost."""
NEARBY = 1.0
"""Of the bound: what a control differs by in a neighbouring solution; the bounds are 2 apart."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def limited_problem(seed: int) -> tuple[OptimalControlProblem, np.ndarray, DdpOptions]:
    """A random one, its first guess and options; six in a row are of all systems."""
    rng = np.random.default_rng(seed)
    name = tuple(MOTIONS)[seed % len(MOTIONS)]
    ranges = ((1.0, 1e4), (0.01, 1e3), (0.01, 10.0), (1e-3, 1.0), (1e-3, 10.0))
    weights = MotionWeights(*(log_uniform(rng, *ends) for ends in ranges))
    h = float(rng.choice([0.02, 0.04]))
    problem = motion_problem(
        name,
        weights,
        round(rng.uniform(0.5, 1.5) / h),
        h,
        method=str(rng.choice(["rk4", "semi-implicit-euler", "explicit-euler"])),
        target=None if MOTIONS[name].goal else np.array([0.4, -0.35, 0.25]),
        limit=rng.uniform(0.2, 1.5),
    )
    guess = initial_controls(
        problem, np.array(MOTIONS[name].control_scale), rng.uniform(-1, 1), rng.uniform(0, 2)
    )
    options = DdpOptions(second_order=bool(rng.integers(2)), tolerance=1e-8, iterations=300)
    return problem, guess, options


def check_against_ipopt(problem: OptimalControlProblem, found: DdpIterate) -> None:
    wanted = optimum(problem, found.X, found.U, warm=True)
    assert problem.bound is not None
    if np.abs((wanted.U - found.U) / problem.bound).max() < NEARBY:
        assert found.cost <= wanted.cost * (1.0 + NOTICEABLE)


@pytest.mark.parametrize("seed", range(6))
def test_nothing_nearby_is_better(seed: int) -> None:
    problem, guess, options = limited_problem(seed)
    found = ddp.solve(problem, guess, replace(options, iterations=80))
    if found.converged:
        check_against_ipopt(problem, found)
    else:
        assert found.stopped


@pytest.mark.study
@pytest.mark.timeout(3600)
def test_nothing_nearby_is_better_of_five_hundred() -> None:
    converged = 0
    for seed in range(500):
        problem, guess, options = limited_problem(seed)
        found = ddp.solve(problem, guess, options)
        if found.converged:
            converged += 1
            check_against_ipopt(problem, found)
    assert converged > 400


def swing_up() -> tuple[OptimalControlProblem, np.ndarray]:
    """Of the double pendulum, within narrow bounds."""
    weights = MotionWeights(goal=10.0, rest=1.0, posture=3.0, velocity=0.01, control=0.01)
    problem = motion_problem("double-pendulum", weights, 25, 0.04, limit=0.7)
    return problem, initial_controls(
        problem, np.array(MOTIONS["double-pendulum"].control_scale), 0.1, 1.0
    )


def test_a_control_a_rounding_within_its_bound_does_not_end_the_search() -> None:
    problem, guess = swing_up()
    found = ddp.solve(problem, guess, DdpOptions(tolerance=1e-8))
    assert found.converged
    assert found.cost == pytest.approx(23.607182, rel=1e-6), "as Ipopt finds"
    check_against_ipopt(problem, found)


def in_other_units(problem: OptimalControlProblem, scale: float) -> OptimalControlProblem:
    c = problem.cost
    assert isinstance(c, MotionCost)
    return replace(problem, cost=replace(c, Q=scale * c.Q, R=scale * c.R, Q_f=scale * c.Q_f))


@pytest.mark.parametrize("second_order", [False, True])
@pytest.mark.parametrize("limited", [False, True])
def test_the_unit_of_the_cost_does_not_matter(second_order: bool, limited: bool) -> None:
    """By powers of two to the last bit, and else but for rounding."""
    problem, guess = swing_up()
    if not limited:
        problem = replace(problem, bound=None)
    options = DdpOptions(second_order=second_order, iterations=300)
    found = ddp.solve(problem, guess, options)
    assert found.converged
    for scale in (2.0**-50, 2.0**40):
        scaled = ddp.solve(in_other_units(problem, scale), guess, options)
        np.testing.assert_array_equal(scaled.U, found.U)
        assert scaled.iteration == found.iteration
        assert scaled.converged
    begun = DdpOptions(second_order=second_order, iterations=8)
    few = ddp.solve(problem, guess, begun)
    for scale in (1e-15, 1e12):
        scaled = ddp.solve(in_other_units(problem, scale), guess, begun)
        np.testing.assert_allclose(scaled.U, few.U, atol=1e-6)
        assert scaled.cost == pytest.approx(scale * few.cost, rel=1e-8)


def test_a_corner_that_bounds_hold_is_a_minimum_however_the_cost_curves() -> None:
    """All controls are at their bounds, some a rounding within."""
    problem, guess = swing_up()
    assert problem.bound is not None
    narrow = replace(problem, bound=0.01 * problem.bound)
    at_bound = ddp.solve(narrow, 0.01 * guess, DdpOptions(second_order=True)).U
    inside = at_bound * (1.0 - 2.0**-52)
    again = ddp.solve(narrow, inside, DdpOptions(second_order=True))
    assert again.converged
    assert again.iteration == 1
