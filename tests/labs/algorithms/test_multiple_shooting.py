"""Multiple shooting: derivatives, single shooting as its special case, closed forms, infeasible
problems."""

from typing import Any

import numpy as np
import pytest

from labs.algorithms import riccati, sqp
from labs.algorithms.multiple_shooting import MultipleShooting
from labs.algorithms.shooting_steps import SHOOTING_METHODS
from labs.algorithms.single_shooting import SingleShooting
from labs.algorithms.sqp import SqpIterate, SqpOptions
from labs.errors import LabError
from labs.problems.continuous_control import ContinuousProblem
from labs.problems.linear_quadratic import LqrProblem
from labs.resumable import run_to_completion
from labs.tasks.motion.continuous import MotionLimits, continuous_motion
from labs.tasks.motion.tip_constraints import Ball
from tests.labs.algorithms.collocation_oracle import ipopt
from tests.labs.algorithms.transcriptions import (
    REACH_TARGET,
    check_derivatives,
    limited_reach,
    minimum_energy,
    minimum_time,
    regulated_mass,
    straight_guess,
)
from tests.labs.problems.continuous_problems import Circle, Disc, nonlinear

BALL = Ball(np.array([0.35, -0.1, 0.4]), 0.1)


def solved(
    problem: ContinuousProblem, N: int, segments: int, M: int = 1, **options: Any
) -> tuple[MultipleShooting, SqpIterate]:
    program, guess = MultipleShooting(problem, N, segments, M), straight_guess(problem, N)
    return program, sqp.solve(program, program.variables(guess.X, guess.U), SqpOptions(**options))


def fully_constrained(name: str, rng: np.random.Generator) -> ContinuousProblem:
    """With all a problem may have, and a cost that is neither quadratic nor separable."""
    n = 4 if name == "cart-pole" else 2
    lower, upper, goal = np.full(n, -np.inf), np.full(n, np.inf), np.full(n, np.nan)
    lower[0], upper[0], upper[-1], goal[1:] = -1.0, 1.0, 2.0, 0.3
    given = {"x_lower": lower, "x_upper": upper, "x_final": goal, "path": Disc(), "end": Circle()}
    return nonlinear(rng, name, T_limits=(0.1, 3.0), **given)


@pytest.mark.parametrize("segments", [1, 2, 3, 5])
@pytest.mark.parametrize(("name", "method"), [("pendulum", "midpoint"), ("cart-pole", "rk4")])
def test_derivatives_are_those_of_finite_differences(name: str, method: str, segments: int) -> None:
    rng = np.random.default_rng(1)
    for problem in (fully_constrained(name, rng), nonlinear(rng, name)):
        program = MultipleShooting(problem, 5, segments, 2, method)
        z = 0.5 * rng.normal(size=program.n)
        z[-1] = 0.7 if program.free_time else z[-1]
        check_derivatives(program, z)


def test_so_are_those_of_a_reach_around_a_ball() -> None:
    limits = MotionLimits(velocity=4.0, control=0.8, obstacles=(BALL,))
    problem = continuous_motion(
        "ur5", "least-energy", 1.0, limits=limits, target=REACH_TARGET, T_limits=(0.5, 2.0)
    )
    program = MultipleShooting(problem, 3, 2)
    z = 0.5 * np.random.default_rng(1).normal(size=program.n)
    z[-1] = 0.4
    check_derivatives(program, z)


@pytest.mark.parametrize("form", ["augmented", "sum"])
def test_one_segment_is_single_shooting(form: Any) -> None:
    rng = np.random.default_rng(2)
    problem = fully_constrained("cart-pole", rng)
    multiple = MultipleShooting(problem, 6, 1, 2, "rk4", form)
    single = SingleShooting(problem, 6, 2, "rk4", form)
    y = single.pack(rng.normal(size=(6, 1)), 0.9)
    z = multiple.pack(problem.x0[None], single.controls(y), 0.9)
    np.testing.assert_array_equal(multiple.arcs(z).X, single.rollout(y).X[:-1])
    mine, theirs = multiple.values(z), single.values(y)
    assert mine.f == pytest.approx(theirs.f, rel=1e-14)
    np.testing.assert_array_equal(mine.c, np.concatenate([np.zeros(4), theirs.c]))
    np.testing.assert_array_equal(mine.g, theirs.g)
    at, wanted = multiple.derivatives(z), single.derivatives(y)
    np.testing.assert_allclose(at.f_y[4:], wanted.f_y, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(at.c_y.toarray()[4:, 4:], wanted.c_y.toarray(), atol=1e-12)
    np.testing.assert_allclose(at.g_y.toarray()[:, 4:], wanted.g_y.toarray(), atol=1e-12)
    assert at.g_y[:, 4:].nnz == wanted.g_y.nnz
    lam, mu = rng.normal(size=len(theirs.c)), rng.uniform(size=len(theirs.g))
    for exact in (True, False):
        H = run_to_completion(multiple.hessian(z, np.concatenate([np.ones(4), lam]), mu, exact))
        expected = run_to_completion(single.hessian(y, lam, mu, exact)).toarray()
        np.testing.assert_allclose(H.toarray()[4:, 4:], expected, rtol=1e-9, atol=1e-9)


def test_the_pattern_is_sparse_and_the_same_everywhere() -> None:
    """One segment is full, one a piece grows like N; in between it is between."""
    problem, counts = continuous_motion("cart-pole", "least-energy", 2.0), {}
    for N, segments in ((20, 1), (20, 4), (20, 20), (40, 40), (80, 80)):
        program = MultipleShooting(problem, N, segments)
        rng = np.random.default_rng(0)
        first, second = (program.derivatives(0.1 * rng.normal(size=program.n)) for _ in range(2))
        np.testing.assert_array_equal(first.c_y.indices, second.c_y.indices)
        z = np.zeros(program.n)
        hessian = run_to_completion(program.hessian(z, np.zeros(len(first.c_y.indices)), z, False))
        counts[N, segments] = hessian.nnz
    assert counts[20, 1] == 24**2
    assert counts[20, 4] == 4 * 9**2
    assert counts[20, 20] == 20 * 5**2
    assert counts[80, 80] == 2 * counts[40, 40] == 4 * counts[20, 20]


def test_segments_do_not_change_the_optimum() -> None:
    """From a straight line for one segment a piece; for fewer from near the optimum found, from
    where a Newton step of single shooting leads nowhere either."""
    limits = MotionLimits(velocity=5.0)
    problem = continuous_motion("pendulum", "weighted", 2.0, limits=limits)
    program, wanted = solved(problem, 20, 20, 2, tolerance=1e-11)
    assert wanted.converged, wanted.stopped
    np.testing.assert_allclose(program.gaps(wanted.y), 0.0, atol=1e-7)
    assert (wanted.active_bounds != 0.0).any()
    U, arcs = program.controls(wanted.y), program.arcs(wanted.y)
    X = np.concatenate([arcs.X[::2], arcs.Y[-1:]])
    guess = U + 0.02 * np.random.default_rng(5).normal(size=U.shape)
    for m in (2, 3, 7):
        fewer = MultipleShooting(problem, 20, m, 2)
        at = sqp.solve(fewer, fewer.variables(X, guess))
        assert at.converged, at.stopped
        assert at.values.f == pytest.approx(wanted.values.f, rel=1e-7)
        np.testing.assert_allclose(fewer.controls(at.y), U, atol=1e-4)
    single = SingleShooting(problem, 20, 2)
    y = single.pack(U)
    d, mu = single.derivatives(y), np.zeros((20, 2))
    nu = wanted.nu[program.segments.starts[1:, 1]]
    mu[:-1], mu[-1] = np.maximum(np.column_stack([nu, -nu]), 0.0), wanted.mu
    assert single.values(y).f == pytest.approx(wanted.values.f, rel=1e-7)
    gradient = d.f_y + d.g_y.T @ mu.ravel()
    H = run_to_completion(single.hessian(y, np.zeros(0), mu.ravel(), exact=False))
    np.testing.assert_allclose(np.linalg.solve(H.toarray(), gradient), 0.0, atol=1e-7)


LIMITED: dict[str, tuple[str, str, float, MotionLimits, tuple[float, float] | None]] = {
    "pendulum": ("pendulum", "weighted", 2.0, MotionLimits(velocity=5.0, control=0.9), None),
    "cart-pole": ("cart-pole", "weighted", 2.0, MotionLimits((-0.3, -9.0), (0.3, 9.0), 6.0), None),
    "mass": ("mass", "least-time", 3.0, MotionLimits(velocity=0.8, control=1.0), (0.5, 6.0)),
}


@pytest.mark.parametrize("case", LIMITED)
def test_costs_equal_ipopts_on_the_same_discretised_problem(case: str) -> None:
    """With limits of q, v and u that are active, and with a free final time."""
    name, objective, T, limits, T_limits = LIMITED[case]
    problem = continuous_motion(name, objective, T, limits=limits, T_limits=T_limits)
    for segments in (10, 30) if name != "cart-pole" else (30,):
        program, at = solved(problem, 30, segments)
        assert at.converged, at.stopped
        arcs = program.arcs(at.y)
        X = np.concatenate([arcs.X, arcs.Y[-1:]])
        wanted = ipopt(problem, 30, "rk4", X, program.controls(at.y), warm=True)
        assert wanted.success
        assert at.values.f == pytest.approx(wanted.cost, rel=1e-6)
        assert program.horizon(at.y) == pytest.approx(wanted.T, rel=1e-5)
        assert (at.active_bounds != 0.0).any() or at.active_inequalities.any()


def test_so_does_that_of_the_ur5_with_limits_of_every_kind_active() -> None:
    problem = limited_reach(0.18)
    program, at = solved(problem, 10, 10)
    assert at.converged, at.stopped
    arcs, U = program.arcs(at.y), program.controls(at.y)
    wanted = ipopt(problem, 10, "rk4", np.concatenate([arcs.X, arcs.Y[-1:]]), U, warm=True)
    assert wanted.success
    assert at.values.f == pytest.approx(wanted.cost, rel=1e-6)
    active = at.active_bounds != 0.0
    assert active[program.segments.starts[:, 6:]].any(), "velocities"
    assert active[program.segments.controls].any(), "controls"
    named = [program.inequality_name(int(i)) for i in np.nonzero(at.active_inequalities)[0]]
    assert any("the tip's distance from obstacle 1" in name for name in named)
    assert any("bound of q_1 at the end" in name for name in named), "a position"


@pytest.mark.parametrize("segments", [1, 4, 10])
@pytest.mark.parametrize("method", SHOOTING_METHODS)
def test_a_linear_quadratic_problem_takes_one_step_and_is_riccatis(
    method: str, segments: int
) -> None:
    problem = regulated_mass()
    cost: Any = problem.cost
    program, guess = MultipleShooting(problem, 10, segments, 1, method), straight_guess(problem, 10)
    at = sqp.solve(program, program.variables(guess.X, guess.U))
    assert (at.converged, at.iteration) == (True, 1)
    step = program.sensitivities(at.y).at
    half = 0.5 * step.L_zz[0]
    policy = riccati.solve(
        LqrProblem(
            10, step.A[0], step.B[0, :, :1], half[:2, :2], half[2:3, 2:3], cost.Q_f, half[:2, 2:3]
        )
    )
    X = program.arcs(at.y).X - cost.x_ref
    U = [K @ x for K, x in zip(policy.gains, X, strict=True)]
    np.testing.assert_allclose(program.controls(at.y), U, atol=1e-7)
    costates = 2.0 * np.einsum("kij,kj->ki", policy.values[program.segments.pieces[:-1]],
                               X[program.segments.first_steps])  # fmt: skip
    lam = at.lam.reshape(-1, 2)
    np.testing.assert_allclose(-lam[1:], costates[1:], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("segments", [1, 6, 40])
def test_double_integrators_have_their_closed_forms(segments: int) -> None:
    """Least energy over a metre in 2 s costs 3/2 (1 - 1/N^2)^-1; the least time is 2 s."""
    _, at = solved(minimum_energy(), 40, segments)
    assert (at.converged, at.iteration) == (True, 1)
    assert at.values.f == pytest.approx(1.5 / (1.0 - 1.0 / 1600.0), rel=1e-9)
    program, at = solved(minimum_time(), 40, segments)
    assert at.converged, at.stopped
    assert program.horizon(at.y) == pytest.approx(2.0, abs=1e-6)
    np.testing.assert_allclose(program.controls(at.y)[:20], 1.0, atol=1e-6)
    np.testing.assert_allclose(program.controls(at.y)[20:], -1.0, atol=1e-6)


def test_what_cannot_be_reached_is_infeasible_and_says_why() -> None:
    limits = MotionLimits(control=0.3)
    hurried = continuous_motion("pendulum", "least-energy", 0.5, limits=limits)
    beyond = continuous_motion("mass", "least-energy", 1.0, limits=MotionLimits((), (0.5,)))
    for problem in (hurried, beyond):
        for segments in (1, 4, 10):
            _, at = solved(problem, 10, segments)
            assert at.infeasible, at.stopped
            assert not at.converged


def test_a_guess_that_diverges_has_no_value() -> None:
    program = MultipleShooting(continuous_motion("cart-pole", "least-energy", 2.0), 8, 4)
    z = np.zeros(program.n)
    assert np.isfinite(program.values(z).f)
    z[program.segments.controls[3]] = 1e12
    assert program.values(z).f == np.inf
    assert sqp.init(program, z, SqpOptions()).stopped.startswith("Failed: the first guess diverges")


def test_uneven_segments_are_split_with_the_longer_ones_first_and_named() -> None:
    problem = fully_constrained("cart-pole", np.random.default_rng(3))
    program = MultipleShooting(problem, 7, 3)
    np.testing.assert_array_equal(program.segments.lengths, [3, 2, 2])
    np.testing.assert_array_equal(program.segments.pieces, [0, 3, 5, 7])
    assert program.n == 3 * 4 + 7 + 1
    assert program.equality_name(1) == "the start of x_2"
    assert program.equality_name(4 + 2) == "the gap of x_3 between segments 1 and 2"
    assert program.equality_name(12) == "x_2 at the end"
    assert program.variable_name(4) == "u_1 in piece 1 of 7"
    assert program.variable_name(4 + 3) == "x_1 at the start of segment 2 of 3"
    assert program.variable_name(program.n - 1) == "the horizon T"
    assert program.inequality_name(0) == "the upper bound of x_1 at the end of piece 1 of 7"
    X, U = np.random.default_rng(4).normal(size=(8, 4)), np.ones((7, 1))
    z = program.variables(X, U, 1.7)
    np.testing.assert_array_equal(z[program.segments.starts], X[[0, 3, 5]])
    assert program.horizon(z) == 1.7


def test_wrong_use_is_said() -> None:
    with pytest.raises(LabError, match="from 1 to as many as pieces, N = 4"):
        MultipleShooting(minimum_energy(), 4, 5)
    with pytest.raises(LabError, match="no method is named 'rk5'"):
        MultipleShooting(minimum_energy(), 4, 2, method="rk5")
    with pytest.raises(LabError, match="at least one piece"):
        MultipleShooting(minimum_energy(), 0, 1)
