"""Collocation: derivatives, measured orders, closed forms, and Ipopt on the same discretisation."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from labs.algorithms import sqp
from labs.algorithms.collocation import Collocation
from labs.algorithms.collocation_schemes import SCHEMES
from labs.algorithms.curvature import weighted_curvature
from labs.algorithms.sqp import SqpIterate, SqpOptions
from labs.errors import LabError
from labs.problems.continuous_control import ContinuousProblem
from labs.resumable import run_to_completion
from labs.tasks.motion.continuous import MotionLimits, continuous_motion
from labs.tasks.motion.motions import MotionWeights
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

BALL = Ball(np.array([0.35, -0.1, 0.4]), 0.1)


def solved(problem: ContinuousProblem, N: int, scheme: str, **options: Any) -> SqpIterate:
    program, guess = Collocation(problem, N, scheme), straight_guess(problem, N)
    return sqp.solve(program, program.variables(guess.X, guess.U), SqpOptions(**options))


def fully_constrained(name: str) -> ContinuousProblem:
    """A problem with every kind of constraint."""
    limits = MotionLimits(velocity=4.0, control=0.8, obstacles=(BALL,))
    if name == "ur5":
        return continuous_motion(
            "ur5", "least-energy", 1.0, limits=limits, target=REACH_TARGET, T_limits=(0.5, 2.0)
        )
    return continuous_motion(name, "least-time", 1.5, limits=limits, T_limits=(0.5, 3.0))


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", ["cart-pole", "ur5"])
def test_derivatives_are_those_of_finite_differences(name: str, scheme: str) -> None:
    weighted = continuous_motion(name, "weighted", 1.0, target=REACH_TARGET)
    for problem in (fully_constrained(name), weighted):
        program = Collocation(problem, 3, scheme)
        y = np.random.default_rng(1).normal(size=program.n)
        y[-1] = 1.3 if program.free_time else y[-1]
        check_derivatives(program, y)


def test_soft_limits_have_the_derivatives_of_their_cost() -> None:
    limits = MotionLimits((-0.5, -0.5), (0.5, 0.5), 0.5, obstacles=(BALL,), soft_weight=30.0)
    problem = continuous_motion("double-pendulum", "weighted", 1.0, limits=limits)
    assert np.isinf(problem.x_upper).all()
    X, U = np.random.default_rng(0).normal(size=(5, 4)), np.zeros((5, 2))
    found, eps = problem.cost.running_derivatives(X, U, exact=True), 1e-6
    for i, e in enumerate(eps * np.eye(4)):
        ahead, behind = problem.cost.running(X + e, U), problem.cost.running(X - e, U)
        np.testing.assert_allclose(found.l_x[:, i], (ahead - behind) / (2 * eps), atol=1e-6)
    assert (problem.cost.running(np.zeros((1, 4)), U[:1]) < problem.cost.running(X, U)).all()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_pattern_is_sparse_and_the_same_everywhere(scheme: str) -> None:
    """Nonzeros grow like N, where dense matrices grow like N^2."""
    counts = []
    for N in (10, 20, 40):
        program = Collocation(fully_constrained("cart-pole"), N, scheme)
        rng = np.random.default_rng(0)
        first, second = (program.derivatives(rng.normal(size=program.n)) for _ in range(2))
        np.testing.assert_array_equal(first.c_y.indices, second.c_y.indices)
        counts.append(first.c_y.nnz)
    assert counts[2] - counts[1] == 2 * (counts[1] - counts[0])


@pytest.mark.parametrize(("scheme", "order"), [(name, s.order) for name, s in SCHEMES.items()])
def test_the_order_is_as_said(scheme: str, order: int) -> None:
    """Of the cost of a swing-up with a given end, against a fine solution."""
    problem = continuous_motion("pendulum", "least-energy", 1.5)
    exact = solved(problem, 160, "hermite-simpson", tolerance=1e-11).values.f
    steps = (20, 40) if order == 4 else (40, 80)
    errors = [abs(solved(problem, N, scheme, tolerance=1e-11).values.f - exact) for N in steps]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_least_energy_of_the_double_integrator_is_its_closed_form(scheme: str) -> None:
    at = solved(minimum_energy(), 40, scheme)
    assert (at.converged, at.iteration) == (True, 1)
    assert at.values.f == pytest.approx(1.5, rel=3e-3)
    program = Collocation(minimum_energy(), 40, scheme)
    _, X, U = program.trajectory(at.y)
    t = np.linspace(0.0, 2.0, 41)
    np.testing.assert_allclose(X[:, 0], 0.75 * t**2 - 0.25 * t**3, atol=1e-3)
    times = program.grid.block_times[: len(U)] * 2.0 + (0.025 if len(U) == 40 else 0.0)
    np.testing.assert_allclose(U[1:-1, 0], 1.5 - 1.5 * times[1:-1], atol=5e-3)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_least_time_of_the_double_integrator_switches_halfway(scheme: str) -> None:
    problem = minimum_time()
    program = Collocation(problem, 40, scheme)
    guess = straight_guess(problem, 40)
    at = sqp.solve(program, program.variables(guess.X, guess.U))
    assert at.converged, at.stopped
    horizon, _, U = program.trajectory(at.y)
    assert horizon == pytest.approx(2.0, abs=2e-3)
    middle = len(U) // 2
    np.testing.assert_allclose(U[: middle - 2], 1.0, atol=1e-6)
    np.testing.assert_allclose(U[middle + 2 :], -1.0, atol=1e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_linear_quadratic_problem_takes_one_step_and_is_riccatis(scheme: str) -> None:
    """With x' = A x + B u from the continuous Riccati equation, integrated finely."""
    problem = regulated_mass()
    at = solved(problem, 80, scheme)
    assert (at.converged, at.iteration) == (True, 1)
    near = 1e-6 if SCHEMES[scheme].order == 4 else 2e-3
    assert at.values.f == pytest.approx(riccati_cost(problem), rel=near)


def test_by_the_midpoint_rule_it_is_exactly_the_discrete_riccati_recursions() -> None:
    """s+ = F s + G y, and the cost of a step at the middle, M s + G y / 2."""
    problem, N = regulated_mass(), 30
    at, h = solved(problem, N, "midpoint"), problem.T / N
    cost: Any = problem.cost
    _, A, B = (a[0] for a in problem.dynamics.derivatives(np.zeros((1, 2)), np.zeros((1, 1))))
    implicit = np.linalg.inv(np.eye(2) - h / 2 * A)
    F, G = implicit @ (np.eye(2) + h / 2 * A), implicit @ (h * B)
    M, P = (np.eye(2) + F) / 2, cost.Q_f
    for _ in range(N):
        uu = h * cost.R + h * G.T @ cost.Q @ G / 4 + G.T @ P @ G
        ux = h * G.T @ cost.Q @ M / 2 + G.T @ P @ F
        P = h * M.T @ cost.Q @ M + F.T @ P @ F - ux.T @ np.linalg.solve(uu, ux)
    dx = problem.x0 - cost.x_ref
    assert at.values.f == pytest.approx(dx @ P @ dx, rel=1e-9)


def riccati_cost(problem: ContinuousProblem, steps: int = 4000) -> float:
    cost: Any = problem.cost
    _, A, B = problem.dynamics.derivatives(np.zeros((1, 2)), np.zeros((1, 1)))
    P, h = cost.Q_f, problem.T / steps

    def rate(P: np.ndarray) -> np.ndarray:
        PB = P @ B[0]
        return np.asarray(A[0].T @ P + P @ A[0] - PB @ np.linalg.solve(cost.R, PB.T) + cost.Q)

    for _ in range(steps):
        k_1 = rate(P)
        k_2 = rate(P + 0.5 * h * k_1)
        k_3 = rate(P + 0.5 * h * k_2)
        P = P + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + rate(P + h * k_3))
    dx = problem.x0 - cost.x_ref
    return float(dx @ P @ dx)


def reach(target: np.ndarray = REACH_TARGET, T: float = 1.0, **limits: Any) -> ContinuousProblem:
    return continuous_motion("ur5", "least-energy", T, limits=MotionLimits(**limits), target=target)


def short_time_reach() -> ContinuousProblem:
    return reach(T=0.6, velocity=1.6, control=0.4, obstacles=(BALL,))


def limited(
    name: str, objective: str, T: float, *limits: Any, T_limits: tuple[float, float] | None = None
) -> Callable[[], ContinuousProblem]:
    at = MotionLimits(*limits)
    return partial(continuous_motion, name, objective, T, limits=at, T_limits=T_limits)


LIMITED: dict[str, tuple[str, Callable[[], ContinuousProblem]]] = {
    "pendulum": ("vu", limited("pendulum", "weighted", 2.0, (-0.3,), (3.2,), 5.0, 0.9)),
    "pendulum, energy": ("vu", limited("pendulum", "least-energy", 2.0, (), (), 5.0, 0.9)),
    "pendulum, narrow": ("qu", limited("pendulum", "least-energy", 2.0, (-0.1,), (3.2,), 5.0, 0.7)),
    "double pendulum": ("vu", limited("double-pendulum", "weighted", 2.0, (), (), 6.0, 0.7)),
    "double pendulum, time": (
        "qvu",
        limited(
            "double-pendulum", "least-time", 1.5, (-0.2, -1.0), (3.2, 1.0), 5.0, 0.8,
            T_limits=(0.5, 3.0),
        ),
    ),
    "cart-pole": ("qv", limited("cart-pole", "weighted", 2.0, (-0.3, -9.0), (0.3, 9.0), 6.0)),
    "cart-pole, time": (
        "vuT",
        limited("cart-pole", "least-energy", 1.3, (), (), 7.0, 1.0, T_limits=(0.5, 1.4)),
    ),
    "mass, time": ("vu", limited("mass", "least-time", 3.0, (), (), 0.8, 1.0, T_limits=(0.5, 6.0))),
    "ur5": ("qvug", partial(limited_reach, 0.2)),
    "ur5, hasty": ("v", short_time_reach),
    "ur5, time": ("vu", partial(limited_reach, 0.2, "least-time", (0.4, 1.5))),
}  # fmt: skip
"""A problem, and of which kinds limits are active: of q, v and u, of the distance from an obstacle
g, and of the final time T."""


def active_kinds(program: Collocation, at: SqpIterate) -> str:
    states, active = program.grid.states, at.active_bounds != 0.0
    n = states.shape[1] // 2
    kinds = {
        "q": active[states[:, :n]],
        "v": active[states[:, n:]],
        "u": active[program.grid.controls],
        "g": at.active_inequalities,
        "T": active[-1:] if program.free_time else np.zeros(0),
    }
    return "".join(kind for kind, rows in kinds.items() if rows.any())


@pytest.mark.parametrize("case", LIMITED)
def test_costs_equal_ipopts_on_the_same_discretised_problem(case: str) -> None:
    """With limits of q, v and u that are active, each of them in some case of the pendulums and in
    one of the UR5, and with a final time that is free and not at its limits."""
    kinds, made = LIMITED[case]
    problem, N = made(), 12 if case.startswith("ur5") else 40
    program, guess = Collocation(problem, N, "trapezoidal"), straight_guess(problem, N)
    at = sqp.solve(program, program.variables(guess.X, guess.U))
    assert at.converged, at.stopped
    found, X, U = program.trajectory(at.y)
    wanted = ipopt(problem, N, "trapezoidal", X, U, warm=True)
    assert wanted.success
    assert at.values.f == pytest.approx(wanted.cost, rel=1e-6)
    assert found == pytest.approx(wanted.T, rel=1e-5)
    assert active_kinds(program, at) == kinds


@pytest.mark.parametrize("scheme", ["midpoint", "hermite-simpson"])
def test_so_do_those_of_the_other_rules(scheme: str) -> None:
    limits = MotionLimits((), (), 5.0, 0.9)
    problem = continuous_motion("pendulum", "weighted", 2.0, limits=limits)
    program, guess = Collocation(problem, 20, scheme), straight_guess(problem, 20)
    at = sqp.solve(program, program.variables(guess.X, guess.U))
    _, X, U = program.trajectory(at.y)
    wanted = ipopt(problem, 20, scheme, X, U, warm=True)
    assert at.converged
    assert at.values.f == pytest.approx(wanted.cost, rel=1e-6)


def test_what_cannot_be_reached_is_infeasible_and_says_why() -> None:
    at = solved(reach(np.array([1.6, 0.0, 0.3])), 8, "trapezoidal")
    assert at.infeasible, at.stopped
    assert not at.converged
    limits = MotionLimits(control=0.3)
    hurried = continuous_motion("pendulum", "least-energy", 0.5, limits=limits)
    at = solved(hurried, 20, "midpoint")
    assert at.infeasible, at.stopped
    assert "at t = " in at.stopped or " at the end is off" in at.stopped
    beyond = continuous_motion("mass", "least-energy", 1.0, limits=MotionLimits((), (0.5,)))
    at = solved(beyond, 10, "trapezoidal")
    assert at.infeasible, at.stopped


def test_names_say_what_and_when() -> None:
    program = Collocation(fully_constrained("cart-pole"), 4, "trapezoidal")
    fixed = Collocation(continuous_motion("cart-pole", "least-energy", 2.0), 4, "midpoint")
    assert fixed.equality_name(1) == "the start of the pole's q"
    assert fixed.equality_name(4 + 4 * 2 + 3) == "the defect of the pole's v in step 3 at t = 1 s"
    assert fixed.equality_name(4 + 16 + 1) == "the pole's q at the end"
    assert fixed.variable_name(5 + 4) == "u at t = 0.5 s"
    assert program.variable_name(program.n - 1) == "the horizon T"
    assert program.inequality_name(2) == "the tip's distance from obstacle 1 at t = 0.5 T"
    reaching = Collocation(reach(), 4)
    assert reaching.equality_name(len(reaching.values(np.ones(reaching.n)).c) - 1) == (
        "the tip's distance from its target along z at the end"
    )


def test_a_trajectory_goes_in_and_comes_out() -> None:
    problem = fully_constrained("cart-pole")
    rng = np.random.default_rng(0)
    X, U = rng.normal(size=(6, 4)), rng.normal(size=(5, 1))
    for scheme in SCHEMES:
        program = Collocation(problem, 5, scheme)
        T, states, controls = program.trajectory(program.variables(X, U, 1.7))
        assert T == 1.7
        np.testing.assert_array_equal(states, X)
        np.testing.assert_array_equal(controls[:: program.scheme.stride][:5], U)


@pytest.mark.parametrize("hessian", ["gauss-newton", "bfgs"])
def test_other_hessians_come_to_the_same_end(hessian: str) -> None:
    weights = MotionWeights(300.0, 10.0, 0.1, 0.01, 1.0)
    problem = continuous_motion(
        "pendulum", "weighted", 2.0, weights=weights, limits=MotionLimits(control=0.8)
    )
    exact = solved(problem, 25, "trapezoidal")
    other = solved(problem, 25, "trapezoidal", hessian=hessian, tolerance=1e-7)
    assert other.converged, other.stopped
    assert other.values.f == pytest.approx(exact.values.f, rel=1e-6)
    assert exact.iteration <= other.iteration


def test_wrong_use_is_said() -> None:
    with pytest.raises(LabError, match="no rule is named 'euler'; there are midpoint"):
        Collocation(minimum_energy(), 4, "euler")
    with pytest.raises(LabError, match="N = 0: a grid has at least one step"):
        Collocation(minimum_energy(), 0)


def random_problem(seed: int) -> tuple[ContinuousProblem, int, str]:
    """Of any motion but the UR5's, with any objective, limits, and rule."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(["mass", "pendulum", "double-pendulum", "cart-pole", "pendubot"]))
    objective = str(rng.choice(["weighted", "least-energy", "least-time", "fastest-end"]))
    T = float(rng.uniform(0.8, 2.5))
    limits = MotionLimits(
        velocity=float(rng.choice([np.inf, rng.uniform(3.0, 12.0)])),
        control=float(rng.uniform(0.3, 3.0)),
    )
    free = (0.3, 5.0) if objective == "least-time" or rng.integers(2) else None
    problem = continuous_motion(name, objective, T, limits=limits, T_limits=free)
    return problem, int(rng.integers(10, 50)), str(rng.choice(list(SCHEMES)))


def check_random_problem(seed: int) -> str:
    """What it ended with; where it says converged, Ipopt finds nothing better nearby."""
    problem, N, scheme = random_problem(seed)
    program, guess = Collocation(problem, N, scheme), straight_guess(problem, N)
    at = sqp.solve(program, program.variables(guess.X, guess.U), SqpOptions(iterations=100))
    assert at.stopped
    if not at.converged:
        assert not at.stopped.startswith("Converged")
        return at.stopped.split(":")[0].split(" after")[0]
    assert at.optimality
    assert at.optimality.violation <= 1e-8
    horizon, X, U = program.trajectory(at.y)
    wanted = ipopt(problem, N, scheme, X, U, warm=True)
    near = np.abs(wanted.X - X).max() < 1e-2 and abs(wanted.T - horizon) < 1e-2
    if wanted.success and near:
        assert at.values.f <= wanted.cost + 1e-5 * max(abs(wanted.cost), 1e-3)
    return "converged"


@pytest.mark.parametrize("seed", range(4))
def test_nothing_nearby_is_better(seed: int) -> None:
    assert check_random_problem(seed)


@pytest.mark.study
@pytest.mark.timeout(3600)
def test_nothing_nearby_is_better_of_two_hundred() -> None:
    ends = [check_random_problem(seed) for seed in range(200)]
    assert ends.count("converged") > 100


def test_curvature_by_the_controls_is_found_where_there_is_some() -> None:
    """f = (x_1 u_1^2, x_2 u_2 u_1), which no mechanism has."""

    def derivatives(X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        f = np.stack([X[:, 0] * U[:, 0] ** 2, X[:, 1] * U[:, 1] * U[:, 0]], axis=1)
        f_x, f_u = np.zeros((len(X), 2, 2)), np.zeros((len(X), 2, 2))
        f_x[:, 0, 0], f_x[:, 1, 1] = U[:, 0] ** 2, U[:, 0] * U[:, 1]
        f_u[:, 0, 0] = 2.0 * X[:, 0] * U[:, 0]
        f_u[:, 1] = (X[:, 1:] * U)[:, ::-1]
        return f, f_x, f_u

    X, U, w = np.array([[2.0, 3.0]]), np.array([[5.0, 7.0]]), np.array([[1.0, 10.0]])
    found = run_to_completion(weighted_curvature(derivatives, X, U, w))[0]
    expected = [[0, 0, 10, 0], [0, 0, 70, 50], [10, 70, 4, 30], [0, 50, 30, 0]]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("objective", ["least-time", "least-energy", "fastest-end"])
@pytest.mark.parametrize("name", ["pendulum", "cart-pole"])
def test_from_one_motion_the_best_of_another_kind_is_found(name: str, objective: str) -> None:
    """Also bang-bang ones, which have no second derivatives of f to go by."""
    limits = MotionLimits(velocity=8.0, control=1.0)
    first = continuous_motion(name, "weighted", 2.0, limits=limits)
    begun = Collocation(first, 30, "trapezoidal").trajectory(solved(first, 30, "trapezoidal").y)
    free = (0.3, 5.0) if objective == "least-time" else None
    problem = continuous_motion(name, objective, 2.0, limits=limits, T_limits=free)
    program = Collocation(problem, 30, "trapezoidal")
    y = program.variables(begun.X, begun.U, 2.0)
    at = sqp.solve(program, y)
    assert at.converged, at.stopped
    assert at.values.f < 1.001 * program.values(y).f
    assert (at.active_bounds != 0.0).any()
