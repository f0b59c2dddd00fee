"""What the direct method's multipliers are: the gradient of the optimal cost, exactly of its own
programme, and of the problem in continuous time to the error of its rule."""

from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms import sqp
from labs.algorithms.collocation import Collocation
from labs.optimal_control.families.closed_form import closed_form
from labs.optimal_control.families.local_methods import (
    OPTIONS,
    motion_of_iterate,
    solve_direct,
)
from labs.optimal_control.families.motion import MethodMotion, first_guess
from labs.optimal_control.families.params import FamiliesParams
from labs.problems.continuous_control import ContinuousProblem

PARAMS = FamiliesParams(system="mass", horizon=2.0)
OPTIMUM = replace(OPTIONS, tolerance=1e-11)


def optimum(problem: ContinuousProblem, N: int) -> tuple[MethodMotion, Collocation, sqp.SqpIterate]:
    program = Collocation(problem, N, "trapezoidal")
    start = program.variables(np.tile(problem.x0, (N + 1, 1)), np.zeros((N, 1)))
    at = sqp.solve(program, start, OPTIMUM)
    assert at.converged
    return motion_of_iterate(problem, program, at), program, at


def test_multipliers_of_a_linear_quadratic_problem_are_its_gradient() -> None:
    """From states along the optimum, on what is left of its grid. The cost is quadratic in the
    start: central differences are exact."""
    N, T = 30, 2.0
    _, program, at = optimum(PARAMS.problem(PARAMS.x0, T), N)
    X = program.trajectory(at.y).X
    for k in (0, 10, 20):
        steps, rest = N - k, T * (N - k) / N

        def cost(x: np.ndarray, steps: int = steps, rest: float = rest) -> float:
            return optimum(PARAMS.problem(x, rest), steps)[0].cost

        found = optimum(PARAMS.problem(X[k], rest), steps)[0].P[0]
        for i, step in enumerate(0.1 * np.eye(2)):
            slope = (cost(X[k] + step) - cost(X[k] - step)) / 0.2
            assert found[i] == pytest.approx(slope, abs=1e-8)


def test_multipliers_approach_the_costate_with_order_two() -> None:
    exact = closed_form(PARAMS, PARAMS.x0, 2.0)
    assert exact is not None
    gaps = []
    for N in (20, 40, 80):
        # Off the kinks that interpolation between the middles of steps makes.
        motion = optimum(PARAMS.problem(PARAMS.x0, 2.0), N)[0]
        gaps.append(abs(motion.P[0] - exact.P[0]).max())
    orders = np.log2(np.array(gaps[:-1]) / gaps[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_what_has_not_converged_is_no_motion() -> None:
    """While it is on its way it is shown, and once it has stopped short it is not."""
    problem = FamiliesParams().problem(np.array([np.pi, 0.0]), 1.5)
    seen = [m for m in solve_direct(problem, first_guess(problem, 0.5), 30) if m]
    assert all(motion.known and not motion.converged for motion in seen[:-1])
    assert seen[-1].converged
    program = Collocation(problem, 30, "trapezoidal")
    start = program.variables(np.tile(problem.x0, (31, 1)), np.zeros((30, 1)))
    short = sqp.solve(program, start, replace(OPTIONS, iterations=1))
    motion = motion_of_iterate(problem, program, short)
    assert not motion.known
    assert motion.message == short.stopped
