"""Nonlinear MPC against other solvers of the same problem, and against what it promises."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from labs.algorithms import sqp
from labs.algorithms.multiple_shooting import MultipleShooting
from labs.algorithms.nonlinear_mpc import NonlinearMpc
from labs.algorithms.nonlinear_mpc_problem import NonlinearMpcProblem
from labs.algorithms.sqp import SqpOptions
from labs.errors import LabError
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import mechanism
from labs.problems.continuous_control import ContinuousProblem
from labs.problems.receding_horizon import Plan
from labs.resumable import run_to_completion
from labs.tasks.motion.continuous_cost import ContinuousMotionCost
from labs.tasks.motion.tip_constraints import Ball, ObstacleConstraint

H = 0.02
UR5 = mechanism("ur5")
HOME = UR5.arm.home
STRENGTH = UR5.control_limit
TURN = np.array([0.8, -0.5, 0.4, 0.3, 0.2, 0.5])
AT_HOME = np.concatenate([HOME, np.zeros(6)])


def reach(N: int = 20, **changes: object) -> NonlinearMpcProblem:
    """The UR5 turns its joints, within limits that act."""
    problem = NonlinearMpcProblem(
        DiscreteMechanism(UR5, H),
        N,
        Q=H * np.diag(np.repeat([10.0, 0.1], 6)),
        R=H * np.diag(0.1 / STRENGTH**2),
        Q_f=np.diag(np.repeat([30.0, 0.3], 6)),
        x_ref=np.concatenate([HOME + TURN, np.zeros(6)]),
        u_ref=UR5.equilibrium_control(HOME + TURN),
        x_lower=np.concatenate([HOME - 0.6, np.full(6, -1.0)]),
        x_upper=np.concatenate([HOME + 0.6, np.full(6, 1.0)]),
        u_lower=-0.5 * STRENGTH,
        u_upper=0.5 * STRENGTH,
    )
    return replace(problem, **changes)  # type: ignore[arg-type]


def planned(
    problem: NonlinearMpcProblem,
    x: np.ndarray,
    guess: Plan | None = None,
    iterations: int | None = None,
    N: int | None = None,
) -> Plan:
    return run_to_completion(NonlinearMpc(problem, iterations).plan(x, guess, N))


def closed_loop(problem: NonlinearMpcProblem, x: np.ndarray, periods: int) -> np.ndarray:
    """States (periods + 1, nx) under real-time iterations."""
    planner, guess, X = NonlinearMpc(problem), None, [x]
    for _ in range(periods):
        plan = run_to_completion(planner.plan(X[-1], guess))
        assert plan.found
        X.append(problem.dynamics.step(X[-1], plan.U[0]))
        guess = replace(
            plan,
            X=np.vstack([plan.X[1:], plan.X[-1:]]),
            U=np.vstack([plan.U[1:], plan.U[-1:]]),
        )
    return np.array(X)


def test_it_solves_what_multiple_shooting_and_sqp_solve() -> None:
    """The double pendulum, pushed to the side from hanging, at its limits of torque and speed."""
    body, N = mechanism("double-pendulum"), 15
    Q, R = np.diag([5.0, 5.0, 0.1, 0.1]), np.diag([0.01, 0.02])
    Q_f = np.diag([20.0, 20.0, 1.0, 1.0])
    x_ref, u_ref, x0 = np.array([1.0, 0.5, 0.0, 0.0]), np.zeros(2), np.zeros(4)
    x_upper, u_upper = np.array([np.inf, np.inf, 2.5, 2.5]), np.array([10.0, 3.0])
    cost = ContinuousMotionCost(0.0, Q, R, Q_f, np.zeros(4), x_ref, u_ref)
    whole = ContinuousProblem(body, cost, x0, N * H, -x_upper, x_upper, -u_upper, u_upper)
    shooting = MultipleShooting(whole, N, N, 1, "explicit-euler")
    guess = shooting.variables(np.tile(x0, (N + 1, 1)), np.zeros((N, 2)))
    other = sqp.solve(shooting, guess, SqpOptions(hessian="gauss-newton", tolerance=1e-9))
    assert other.converged
    dynamics = DiscreteMechanism(body, H, "explicit-euler")
    limits = (-x_upper, x_upper, -u_upper, u_upper)
    problem = NonlinearMpcProblem(dynamics, N, 2 * H * Q, 2 * H * R, 2 * Q_f, x_ref, u_ref, *limits)
    plan = planned(problem, x0)
    assert plan.message.startswith("Converged")
    assert plan.active["control"].any()
    assert plan.active["velocity"].any()
    np.testing.assert_allclose(plan.U, shooting.controls(other.y), atol=1e-4)
    np.testing.assert_allclose(plan.X, dynamics.rollout(x0, plan.U), atol=1e-7)


def test_one_iteration_a_call_comes_to_the_same() -> None:
    problem = reach()
    whole, at = planned(problem, AT_HOME), None
    for _ in range(whole.iterations):
        at = planned(problem, AT_HOME, at, iterations=1)
        assert at.iterations == 1
    assert at is not None
    np.testing.assert_allclose(at.X, whole.X, atol=2e-3)
    assert at.cost == pytest.approx(whole.cost, rel=1e-6)


def test_near_an_equilibrium_it_is_the_regulator() -> None:
    """u_0 = K x with Riccati's P as the terminal cost, for any N."""
    dynamics = DiscreteMechanism(mechanism("cart-pole"), H, "rk4")
    x_ref = np.array([0.0, np.pi, 0.0, 0.0])
    _, A, B = dynamics.linearize(x_ref[None], np.zeros((1, 1)))
    Q, R, free = np.diag([1.0, 10.0, 0.1, 0.1]), np.array([[0.01]]), np.full(4, np.inf)
    P = solve_discrete_are(A[0], B[0], Q, R)
    K = -np.linalg.solve(R + B[0].T @ P @ B[0], B[0].T @ P @ A[0])
    limit = np.array([20.0])
    problem = NonlinearMpcProblem(
        dynamics, 10, Q, R, P, x_ref, np.zeros(1), -free, free, -limit, limit
    )
    x = 1e-5 * np.array([1.0, -2.0, 3.0, 1.0])
    plan = planned(problem, x_ref + x)
    np.testing.assert_allclose(plan.U[0], K @ x, rtol=1e-4)
    assert plan.cost == pytest.approx(0.5 * x @ P @ x, rel=1e-4)
    assert not plan.active["control"].any()


def test_limits_are_held_and_lit() -> None:
    ball = Ball(UR5.tip(HOME + 0.5 * TURN) + np.array([0.02, 0.0, 0.0]), 0.1)
    problem = reach(path=ObstacleConstraint(UR5, (ball,)))
    assert problem.path
    X = closed_loop(problem, AT_HOME, 60)
    assert (X - problem.x_upper).max() < 1e-6
    assert (problem.x_lower - X).max() < 1e-6
    assert problem.path.values(X).max() < 1e-5
    np.testing.assert_allclose(X[-1, 1:6], (HOME + TURN)[1:], atol=2e-3)
    assert X[-1, 0] == pytest.approx(HOME[0] + 0.6, abs=1e-4), "as far as it may turn"
    plan = planned(problem, X[-1])
    assert plan.active["position"][-1].tolist() == [True] + 5 * [False]
    assert plan.active["path"].shape == (21, 1)


def test_a_soft_limit_is_a_hard_one_where_that_can_be_met() -> None:
    hard, soft = planned(reach(), AT_HOME), planned(reach(penalty=100.0), AT_HOME)
    assert soft.violation < 1e-6
    np.testing.assert_allclose(soft.X, hard.X, atol=1e-3)


def test_what_cannot_be_met_is_said_or_exceeded() -> None:
    """A joint that is too fast already: its speed cannot be within its limit at once."""
    fast = AT_HOME.copy()
    fast[6] = 3.0
    none = planned(reach(), fast, iterations=1)
    assert not none.found
    assert np.isnan(none.cost)
    assert "limit 1 of the velocity is exceeded at step 1 of 20" in none.message
    soft = planned(reach(penalty=1000.0), fast, iterations=1)
    assert soft.found
    assert soft.violation > 0.1
    assert soft.X[1, 6] == pytest.approx(1.0 + soft.violation, abs=1e-6)


def test_it_can_be_asked_to_end_at_rest() -> None:
    stop = np.concatenate([np.full(6, np.nan), np.zeros(6)])
    plan = planned(reach(N=10, x_final=stop), AT_HOME)
    np.testing.assert_allclose(plan.X[-1, 6:], 0.0, atol=1e-8)
    assert np.abs(planned(reach(N=10), AT_HOME).X[-1, 6:]).max() > 0.5


def test_a_shorter_horizon_goes_on_as_planned() -> None:
    """Bellman: the plan over N - 1 steps from x_1 is the tail of that over N from x_0."""
    problem = reach()
    plan = planned(problem, AT_HOME)
    tail = planned(problem, plan.X[1], replace(plan, X=plan.X[1:], U=plan.U[1:]), N=19)
    assert tail.X.shape == (20, 12)
    np.testing.assert_allclose(tail.X, plan.X[1:], atol=1e-5)


def test_a_plan_does_not_depend_on_those_before() -> None:
    planner = NonlinearMpc(reach())
    first = run_to_completion(planner.plan(AT_HOME, None))
    other = AT_HOME + 0.3
    run_to_completion(planner.with_reference(other, STRENGTH / 9.0).plan(AT_HOME + 0.01, first))
    again = run_to_completion(planner.plan(AT_HOME, None))
    np.testing.assert_array_equal(again.X, first.X)
    np.testing.assert_array_equal(again.U, first.U)


def test_another_aim_needs_no_other_planner() -> None:
    x_ref, u_ref = AT_HOME + 0.1, UR5.equilibrium_control(HOME + 0.1)
    planner = NonlinearMpc(reach())
    run_to_completion(planner.plan(AT_HOME, None))
    plan = run_to_completion(planner.with_reference(x_ref, u_ref).plan(AT_HOME, None))
    new = planned(reach(x_ref=x_ref, u_ref=u_ref), AT_HOME, iterations=1)
    np.testing.assert_array_equal(plan.X, new.X)
    assert plan.cost == new.cost


def test_it_refuses_what_makes_no_sense() -> None:
    with pytest.raises(LabError, match="at least one step"):
        reach(N=0)
    with pytest.raises(LabError, match="the lower"):
        reach(u_lower=STRENGTH)
    with pytest.raises(LabError, match="positive and finite"):
        reach(penalty=0.0)
    with pytest.raises(LabError, match="at least one"):
        NonlinearMpc(reach(), 0)


def test_the_linearisation_is_that_of_finite_differences() -> None:
    ball = Ball(UR5.tip(HOME) + np.array([0.05, 0.0, 0.0]), 0.1)
    problem, rng = reach(N=2, path=ObstacleConstraint(UR5, (ball,))), np.random.default_rng(0)
    planner = NonlinearMpc(problem)
    X = AT_HOME + 0.3 * rng.standard_normal((3, 12))
    U = 20.0 * rng.standard_normal((2, 6))
    at, eps = planner.linearize(X, U), 1e-6
    dX, dU = rng.standard_normal(X.shape), rng.standard_normal(U.shape)
    ahead, behind = (planner.linearize(X + s * eps * dX, U + s * eps * dU) for s in (1.0, -1.0))
    by_f = np.einsum("kij,kj->ki", at.A, dX[:2]) + np.einsum("kij,kj->ki", at.B, dU)
    np.testing.assert_allclose((ahead.Y - behind.Y) / (2 * eps), by_f, rtol=1e-6, atol=1e-7)
    by_g = np.einsum("kij,kj->ki", at.g_x, dX[1:])
    np.testing.assert_allclose((ahead.g - behind.g) / (2 * eps), by_g, rtol=1e-6, atol=1e-7)
