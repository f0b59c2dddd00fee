"""Tube MPC: the example of Mayne, Seron and Rakovic (2005), and what the tube promises."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from qpsolvers import solve_qp

from labs.algorithms import mpc
from labs.algorithms.linear_mpc import LinearPlanner
from labs.algorithms.polygons import polyhedron_from_vertices, vertices
from labs.algorithms.riccati import steady_state
from labs.algorithms.robust_invariant_set import RobustInvariantSet, robust_invariant_set
from labs.algorithms.tube_mpc import TubePlanner, tighten_problem
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron, box
from labs.resumable import run_to_completion

START = np.array([-5.0, -2.0])


@dataclass(frozen=True)
class Example:
    problem: LinearMpcProblem
    """With the true limits, and no terminal set."""
    K: np.ndarray
    S: RobustInvariantSet
    planner: TubePlanner


@cache
def published(w: float = 0.1) -> Example:
    """Section 4.1 of the paper: x_2 <= 2, |u| <= 1, |w| <= 0.1 in each component, N = 9, K and
    the terminal cost of the LQR, X_f its maximal admissible set within the tightened limits."""
    A, B = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[0.5], [1.0]])
    Q, R = np.eye(2), np.array([[0.01]])
    lqr = steady_state(A, B, Q, R)
    K, inf = lqr.gain, np.inf
    X, U = box([-inf, -inf], [inf, 2.0]), box([-1.0], [1.0])
    problem = LinearMpcProblem(9, A, B, Q, R, lqr.value, X, U)
    S = robust_invariant_set(A + B @ K, box([-w, -w], [w, w]), error=1e-3)
    nominal = tighten_problem(problem, S, K)
    powers = [np.linalg.matrix_power(A + B @ K, k) for k in range(10)]
    rows = [(nominal.state_set.H @ M, nominal.state_set.h) for M in powers]
    rows += [(nominal.control_set.H @ K @ M, nominal.control_set.h) for M in powers]
    H, h = zip(*rows, strict=True)
    X_f = polyhedron_from_vertices(vertices(Polyhedron(np.vstack(H), np.concatenate(h))))
    nominal = replace(nominal, terminal_set=X_f)
    return Example(problem, K, S, TubePlanner(nominal, S.polyhedron(), K))


def test_the_published_example_is_feasible_from_its_start() -> None:
    """As in figure 2: the nominal state starts at the edge of the tube around (-5, -2), and its
    velocity goes up to the tightened limit."""
    example = published()
    np.testing.assert_allclose(example.K, [[-0.66, -1.33]], atol=5e-3)
    plan = run_to_completion(example.planner.plan(START, None))
    assert plan.found
    assert plan.X[:, 1].max() == pytest.approx(2.0 - example.S.support(np.eye(2))[1])
    S = example.planner.S
    assert (S.H @ (START - plan.X[0]) - S.h).max() == pytest.approx(0.0, abs=1e-7)
    np.testing.assert_allclose(plan.X[1:], plan.X[:-1] @ example.problem.A.T + plan.U @ [[0.5, 1]])


@pytest.mark.parametrize("kind", ["corners", "uniform", "constant"])
def test_whatever_the_disturbance_limits_hold_and_v_falls(kind: str) -> None:
    example, rng = published(), np.random.default_rng(1)
    problem, planner = example.problem, example.planner
    runs, steps = 60, 25
    drawn = {
        "corners": rng.choice([-0.1, 0.1], (steps, runs, 2)),
        "uniform": rng.uniform(-0.1, 0.1, (steps, runs, 2)),
        "constant": np.tile(rng.choice([-0.1, 0.1], (runs, 2)), (steps, 1, 1)),
    }[kind]
    x, V, spent = np.tile(START, (runs, 1)), np.full(runs, np.inf), np.zeros(runs)
    for w in drawn:
        tubes = run_to_completion(planner.values(x))
        assert np.isfinite(tubes.V).all(), "feasible once, feasible for ever"
        assert planner.S.contains(x - tubes.z, 1e-7).all()
        assert problem.state_set.contains(x, 1e-7).all()
        assert problem.control_set.contains(tubes.u, 1e-7).all()
        assert (V - spent + 1e-6 >= tubes.V).all(), "by the stage's cost at least"
        v = tubes.u - (x - tubes.z) @ example.K.T
        spent = 0.5 * ((tubes.z @ problem.Q * tubes.z).sum(axis=1) + 0.01 * (v**2).sum(axis=1))
        x, V = x @ problem.A.T + tubes.u @ problem.B.T + w, tubes.V
    assert planner.S.contains(x, 1e-5).all(), "the state ends in S, where V is zero"
    np.testing.assert_allclose(run_to_completion(planner.values(x)).V, 0.0, atol=1e-9)


def test_a_plan_equals_that_of_a_second_solver() -> None:
    """Of the programme in all z_k and v_k, with the dynamics as equations."""
    example = published()
    nominal, S, (n, m, N) = example.planner.nominal, example.planner.S, (2, 1, 9)
    assert nominal.terminal_set is not None
    size = (N + 1) * n
    P = np.zeros((size + N * m, size + N * m))
    P[: N * n, : N * n] = np.kron(np.eye(N), nominal.Q)
    P[N * n : size, N * n : size] = nominal.Q_f
    P[size:, size:] = np.kron(np.eye(N), nominal.R)
    step = np.hstack([np.kron(np.eye(N), nominal.A), np.zeros((N * n, n))])
    step -= np.hstack([np.zeros((N * n, n)), np.eye(N * n)])
    dynamics = np.hstack([step, np.kron(np.eye(N), nominal.B)])
    X, U, X_f = nominal.state_set, nominal.control_set, nominal.terminal_set
    G = np.zeros((0, size + N * m))
    parts = [(np.kron(np.eye(N), X.H), 0), (X_f.H, N * n), (np.kron(np.eye(N), U.H), size)]
    for H, column in [*parts, (-S.H, 0)]:
        rows = np.zeros((len(H), size + N * m))
        rows[:, column : column + H.shape[1]] = H
        G = np.vstack([G, rows])
    for x in (START, np.array([-3.0, 1.0]), np.array([1.0, 0.3])):
        h = np.concatenate([np.tile(X.h, N), X_f.h, np.tile(U.h, N), S.h - S.H @ x])
        y = solve_qp(P, np.zeros(len(P)), G, h, dynamics, np.zeros(N * n), solver="piqp")
        assert y is not None
        plan = run_to_completion(example.planner.plan(x, None))
        np.testing.assert_allclose(plan.X.ravel(), y[:size], atol=1e-5)
        assert plan.cost == pytest.approx(0.5 * y @ P @ y, rel=1e-6)


def test_what_is_feasible_is_the_nominal_set_and_a_tube_around_it() -> None:
    """Any state of z + S is feasible where z is, at no higher a cost."""
    example, rng = published(), np.random.default_rng(2)
    inner = LinearPlanner(example.planner.nominal)
    z = rng.uniform([-12.0, -5.0], [6.0, 2.0], (60, 2))
    V = run_to_completion(inner.values(z)).V
    feasible = np.isfinite(V)
    assert 10 < feasible.sum() < 50
    for corner in example.S.polygon()[::5]:
        around = run_to_completion(example.planner.values(z[feasible] + corner)).V
        assert (around <= V[feasible] + 1e-6).all()
    far = run_to_completion(example.planner.values(np.array([[-20.0, 0.0]]))).V
    assert np.isnan(far).all()


def test_receding_horizon_control_acts_by_the_tubes_gain() -> None:
    """The general controller over this planner applies what `values` says."""
    example = published()
    x = np.array([-3.1, 0.4])
    expected = run_to_completion(example.planner.values(x[None])).u[0]
    start = mpc.init(mpc.MpcOptions(), np.zeros(1))
    at = run_to_completion(
        mpc.step(example.planner, example.problem.step, mpc.MpcOptions(), start, x, np.zeros(1))
    )
    np.testing.assert_allclose(at.u, expected, atol=1e-12)
    plan = run_to_completion(example.planner.plan(x, None))
    assert abs(expected - plan.U[0]).max() > 1e-3, "the nominal state starts elsewhere"


def test_without_disturbance_it_is_nominal_mpc() -> None:
    small = published(1e-7)
    nominal = run_to_completion(LinearPlanner(small.planner.nominal).plan(START, None))
    plan = run_to_completion(small.planner.plan(START, None))
    np.testing.assert_allclose(plan.U, nominal.U, atol=1e-4)


def test_what_is_infeasible_says_why() -> None:
    far = run_to_completion(published().planner.plan(np.array([-20.0, 0.0]), None))
    assert not far.found
    assert np.isnan(far.cost)
    assert far.message.startswith("Infeasible")
    large = published()
    S = robust_invariant_set(large.S.A, box([-0.6, -0.6], [0.6, 0.6]), error=1e-3)
    planner = TubePlanner(tighten_problem(large.problem, S, large.K), S.polyhedron(), large.K)
    nothing = run_to_completion(planner.plan(np.zeros(2), None))
    assert not nothing.found
    assert "nothing is left of U" in nothing.message
