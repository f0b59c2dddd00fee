"""Linear MPC against LQR, a second solver, its own optimality conditions and its other form."""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest

from labs.algorithms.linear_mpc import LinearPlan, LinearPlanner
from labs.algorithms.linear_mpc_limits import ProblemTerms, TwoSidedLimits
from labs.algorithms.terminal_cost import cost_of_gain
from labs.errors import LabError
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron, box
from labs.problems.receding_horizon import Plan
from labs.resumable import run_to_completion
from tests.labs.algorithms.linear_mpc_problems import (
    DOUBLE_INTEGRATOR,
    by_quadprog,
    random_problem,
    riccati,
    with_riccati,
)

FORMS: tuple[Literal["condensed", "sparse"], ...] = ("condensed", "sparse")
ORIGIN = box([0.0, 0.0], [0.0, 0.0])


def plan(
    planner: LinearPlanner, x: np.ndarray | list[float], guess: Plan | None = None, N: int = 0
) -> LinearPlan:
    return run_to_completion(planner.plan(np.array(x), guess, N or None))


def test_a_plan_without_active_limits_is_lqr() -> None:
    problem = with_riccati(DOUBLE_INTEGRATOR)
    P, K = riccati(problem)
    x = np.array([0.2, -0.1])
    for form in FORMS:
        found = plan(LinearPlanner(problem, form), x)
        assert found.found
        assert not any(rows.any() for rows in found.active.values())
        np.testing.assert_allclose(found.U, found.X[:-1] @ K.T, rtol=0.0, atol=1e-9)
        assert found.cost == pytest.approx(x @ P @ x / 2, rel=0.0, abs=1e-9)


def test_plans_are_those_of_a_second_solver_and_optimal() -> None:
    rng = np.random.default_rng(0)
    solved = limited = 0
    for _ in range(120):
        problem = random_problem(rng)
        x = rng.uniform(-1.0, 1.0, problem.n)
        other = by_quadprog(problem, x)
        for form in FORMS:
            found = plan(LinearPlanner(problem, form), x)
            assert found.found == (other is not None), found.message
            if other is None:
                assert found.infeasibility is not None
                continue
            value, X, U = other
            assert found.cost == pytest.approx(value, rel=1e-7, abs=1e-7)
            np.testing.assert_allclose(found.X, X, atol=1e-6)
            np.testing.assert_allclose(found.U, U, atol=1e-6)
            assert optimality(problem, found) < 1e-7
            solved, limited = solved + 1, limited + any(a.any() for a in found.active.values())
    assert solved > 100
    assert limited > 50


def optimality(problem: LinearMpcProblem, found: LinearPlan) -> float:
    """The largest residual of the conditions of Karush, Kuhn and Tucker, with the costates from
    stationarity in the states, backward."""
    N, mu = problem.N, found.multipliers
    assert problem.x_ref is not None
    assert problem.u_ref is not None
    assert problem.state_margins is not None
    assert problem.control_margins is not None
    dx, du = found.X - problem.x_ref, found.U - problem.u_ref
    lam = problem.Q_f @ dx[N]
    residual = 0.0
    end = problem.terminal_set
    if end is not None:
        lam = lam + end.H.T @ mu["terminal"][0]
        slack = end.h - end.H @ found.X[N]
        residual = max(residual, -slack.min(), np.abs(slack * mu["terminal"][0]).max())
    for k in reversed(range(N)):
        gradient = problem.R @ du[k] + problem.r + problem.B.T @ lam
        gradient = gradient + problem.control_set.H.T @ mu["control"][k]
        lam = problem.Q @ dx[k] + problem.q + problem.A.T @ lam
        lam = lam + problem.state_set.H.T @ mu["state"][k]
        slack_x = problem.state_set.h - problem.state_margins[k] - problem.state_set.H @ found.X[k]
        slack_u = (
            problem.control_set.h - problem.control_margins[k] - problem.control_set.H @ found.U[k]
        )
        gap = problem.A @ found.X[k] + problem.B @ found.U[k] + problem.c - found.X[k + 1]
        products = [
            np.abs(slack_x * mu["state"][k]).max(),
            np.abs(slack_u * mu["control"][k]).max(),
        ]
        residual = max(residual, np.abs(gradient).max(), -slack_x.min(), -slack_u.min(), *products)
        residual = max(residual, np.abs(gap).max())
    assert all((rows >= 0.0).all() for rows in mu.values())
    return float(residual)


def test_a_warm_start_is_done_at_once_and_a_plan_knows_no_history() -> None:
    planner = LinearPlanner(DOUBLE_INTEGRATOR)
    first = plan(planner, [1.5, 0.5])
    assert first.iterations > 3
    assert plan(planner, [1.5, 0.5], first).iterations == 1
    plan(planner, [-1.0, 0.1], first)
    again = plan(planner, [1.5, 0.5])
    fresh = plan(LinearPlanner(DOUBLE_INTEGRATOR), [1.5, 0.5])
    for other in (again, fresh):
        np.testing.assert_array_equal(other.U, first.U)
    for form in FORMS:
        used = LinearPlanner(DOUBLE_INTEGRATOR, form)
        plan(used, [-1.0, 0.1])
        new = plan(LinearPlanner(DOUBLE_INTEGRATOR, form), [1.5, 0.5], first)
        np.testing.assert_array_equal(plan(used, [1.5, 0.5], first).U, new.U)


def test_the_values_of_many_states_are_those_of_their_plans() -> None:
    planner = LinearPlanner(replace(DOUBLE_INTEGRATOR, terminal_set=ORIGIN, q=np.array([0.1, 0.0])))
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-0.9, 0.9, 7)), -1).reshape(
        -1, 2
    )
    values = run_to_completion(planner.values(grid))
    plans = [plan(planner, x) for x in grid]
    assert 5 < sum(found.found for found in plans) < 45
    for found, V, u in zip(plans, *values, strict=True):
        assert found.found == np.isfinite(V)
        if found.found:
            assert pytest.approx(found.cost, abs=1e-10) == V
            np.testing.assert_allclose(u, found.U[0], atol=1e-10)


def test_a_horizon_that_shrinks_keeps_the_plan() -> None:
    """Bellman's principle, with references and margins that go with the steps."""
    rng = np.random.default_rng(4)
    problem = replace(random_problem(rng), terminal_set=None)
    planner = LinearPlanner(problem)
    x = np.zeros(problem.n)
    whole = plan(planner, x)
    assert whole.found
    for k in range(1, problem.N):
        tail = plan(planner, whole.X[k], None, problem.N - k)
        np.testing.assert_allclose(tail.U, whole.U[k:], atol=1e-8)


@pytest.mark.parametrize("form", FORMS)
def test_soft_limits_are_exact_above_the_multipliers(form: Literal["condensed", "sparse"]) -> None:
    x = [-1.9, 0.0]
    hard = plan(LinearPlanner(DOUBLE_INTEGRATOR, form), x)
    largest = max(hard.multipliers[kind].max(initial=0.0) for kind in ("state", "terminal"))
    assert largest > 0.1
    above = plan(LinearPlanner(DOUBLE_INTEGRATOR, form, penalty=1.01 * largest), x)
    np.testing.assert_array_equal(above.U, hard.U)
    assert above.violation == 0.0
    # The softened programme itself has the hard solution, too.
    soft = LinearPlanner(DOUBLE_INTEGRATOR, form, penalty=1.01 * largest)
    np.testing.assert_allclose(soft._plan_sparse(np.array(x), 10, hard=False).U, hard.U, atol=1e-5)
    below = plan(LinearPlanner(DOUBLE_INTEGRATOR, form, penalty=0.5 * largest), x)
    assert below.found
    assert below.violation > 0.01
    assert below.cost < hard.cost


def test_softened_plans_weigh_cost_against_excess() -> None:
    """Where the hard problem is infeasible, no plan nearby is better."""
    planner, x = LinearPlanner(DOUBLE_INTEGRATOR, penalty=20.0), np.array([1.9, 0.8])
    assert not plan(LinearPlanner(DOUBLE_INTEGRATOR), x).found
    found = plan(planner, x)
    assert found.found
    assert "Softened" in found.message
    least = merit(DOUBLE_INTEGRATOR, x, found.U)
    assert found.cost + 20.0 * found.violation == pytest.approx(least, rel=1e-6)
    rng = np.random.default_rng(1)
    for size in (1e-3, 1e-2, 0.1):
        U = np.clip(found.U + size * rng.standard_normal((50, 10, 1)), -1.0, 1.0)
        assert min(merit(DOUBLE_INTEGRATOR, x, other) for other in U) > least - 1e-6


def merit(problem: LinearMpcProblem, x: np.ndarray, U: np.ndarray) -> float:
    """Cost and 20 times the excess over X."""
    total = 0.0
    for u in U:
        total += x @ problem.Q @ x / 2 + u @ problem.R @ u / 2
        total += 20.0 * np.maximum(problem.state_set.H @ x - problem.state_set.h, 0.0).sum()
        x = problem.step(x, u)
    return float(total)


@pytest.mark.parametrize("form", FORMS)
def test_what_is_infeasible_says_where(form: Literal["condensed", "sparse"]) -> None:
    planner = LinearPlanner(DOUBLE_INTEGRATOR, form)
    # With u = -1 the speed falls by 0.2 a step: 1.9 + 0.14 is already outside.
    at_wall = plan(planner, [1.9, 0.8])
    why = at_wall.infeasibility
    assert why is not None
    assert (why.step, why.kind, why.limit) == (1, "state", "x₁ ≤ 2")
    assert why.excess == pytest.approx(0.04, rel=1e-3)
    assert np.isnan(at_wall.cost)
    assert "x₁ ≤ 2 is exceeded at step 1" in at_wall.message
    # 0.6 + 0.4 + 0.2: it takes 3 steps to stop, the second of them leaves at 2.01.
    later = plan(planner, [1.85, 0.6]).infeasibility
    assert later is not None
    assert (later.step, later.limit) == (2, "x₁ ≤ 2")
    outside = plan(planner, [0.0, -0.9])
    assert "x₀ is outside X, where x₂ ≥ -0.8 is exceeded by 0.1" in outside.message
    far = plan(LinearPlanner(replace(DOUBLE_INTEGRATOR, terminal_set=ORIGIN), form), [-1.9, 0.0])
    assert far.infeasibility is not None
    assert far.infeasibility.kind == "terminal"
    assert "out of reach in N = 10 steps" in far.message
    limits = np.full((10, 2), 0.0)
    limits[6] = 1.5
    empty = plan(
        LinearPlanner(replace(DOUBLE_INTEGRATOR, control_margins=limits), form), [0.0, 0.0]
    )
    assert "no control meets the limits of U at step 6" in empty.message


def test_the_first_infeasible_step_is_that_of_shorter_problems() -> None:
    rng = np.random.default_rng(2)
    seen = set()
    for _ in range(300):
        problem = replace(random_problem(rng), terminal_set=None)
        x = rng.uniform(-1.5, 1.5, problem.n)
        why = plan(LinearPlanner(problem), x).infeasibility
        if why is None or why.step < 2:
            continue
        seen.add(why.step)
        for N, feasible in ((why.step, True), (why.step + 1, False)):
            # Of N steps X limits the first N states.
            short = replace(
                problem,
                N=N,
                x_ref=None,
                u_ref=None,
                state_margins=problem.state_margins[:N],  # type: ignore[index]
                control_margins=problem.control_margins[:N],  # type: ignore[index]
            )
            assert plan(LinearPlanner(short), x).found == feasible
    assert len(seen) >= 2


def test_an_unstable_plant_far_ahead_is_left_to_the_sparse_form() -> None:
    """1.5^80 costs all digits of the condensed form."""
    problem = LinearMpcProblem(
        80,
        np.array([[1.5]]),
        np.eye(1),
        np.eye(1),
        np.eye(1),
        np.eye(1),
        box([-1.0], [1.0]),
        box([-1.0], [1.0]),
    )
    found, other = (plan(LinearPlanner(problem, form), [0.9]) for form in FORMS)
    assert found.found
    assert other.found
    np.testing.assert_allclose(found.U, other.U, atol=1e-7)


def test_held_controls_cost_more_and_are_optimal_among_their_kind() -> None:
    x, holds = [1.0, 0.3], (1, 2, 3, 4)
    free, held = (plan(LinearPlanner(DOUBLE_INTEGRATOR, holds=h), x) for h in (None, holds))
    blocks = np.repeat(range(4), holds)
    assert held.found
    np.testing.assert_array_equal(held.U, held.U[np.searchsorted(blocks, blocks)])
    assert free.cost < held.cost < 1.2 * free.cost
    every = plan(LinearPlanner(DOUBLE_INTEGRATOR, holds=(1,) * 10), x)
    np.testing.assert_allclose(every.U, free.U, atol=1e-10)
    shorter = plan(LinearPlanner(DOUBLE_INTEGRATOR, holds=holds), x, None, 5)
    assert shorter.U[0] != shorter.U[1] == shorter.U[2] == shorter.U[3] == shorter.U[4] or (
        shorter.U[1] == shorter.U[4]
    )
    for wrong in ((1, 2), (0, 10)):
        with pytest.raises(LabError, match="controls held"):
            plan(LinearPlanner(DOUBLE_INTEGRATOR, holds=wrong), x)
    with pytest.raises(LabError, match="condensed form"):
        LinearPlanner(DOUBLE_INTEGRATOR, "sparse", holds=holds)


@pytest.mark.parametrize("form", FORMS)
def test_other_terms_make_another_problem(form: Literal["condensed", "sparse"]) -> None:
    planner, x = LinearPlanner(DOUBLE_INTEGRATOR, form), [0.1, 0.0]
    before = plan(planner, x)
    terms: dict[str, Any] = {
        "x_ref": np.linspace([0.0, 0.0], [1.0, 0.0], 11),
        "r": np.array([0.1]),
        "control_margins": np.full((10, 2), 0.5),
    }
    other = plan(planner.with_terms(**terms), x)
    fresh = plan(LinearPlanner(replace(DOUBLE_INTEGRATOR, **terms), form), x)
    np.testing.assert_array_equal(other.U, fresh.U)
    assert np.abs(other.U).max() == pytest.approx(0.5)
    np.testing.assert_array_equal(plan(planner, x).U, before.U)
    with pytest.raises(LabError, match="Q may not change"):
        planner.with_terms(Q=np.eye(2))


def test_opposite_rows_are_joined() -> None:
    limits = box([-1.0, -2.0], [3.0, np.inf]).intersection(
        Polyhedron(np.array([[1.0, 1.0]]), np.ones(1))
    )
    joined = TwoSidedLimits.of(limits)
    assert len(joined.H) == 3
    lower, upper = joined.bounds(limits.h)
    inside = np.random.default_rng(0).uniform(-4, 4, (200, 2))
    rows = inside @ joined.H.T
    both = ((lower <= rows) & (rows <= upper)).all(axis=1)
    np.testing.assert_array_equal(both, limits.contains(inside))
    pushes = np.array([-1.0, 2.0, 0.5])
    apart = joined.split(pushes, len(limits.h))
    np.testing.assert_allclose(limits.H.T @ apart, joined.H.T @ pushes)
    np.testing.assert_array_equal(joined.join(apart > 0), np.sign(pushes))


def test_the_cost_of_a_gain_is_its_sum() -> None:
    P, K = riccati(DOUBLE_INTEGRATOR)
    A, B, Q, R = (getattr(DOUBLE_INTEGRATOR, name) for name in "ABQR")
    np.testing.assert_allclose(cost_of_gain(A, B, Q, R, K), P, rtol=1e-9)
    slow = 0.5 * K
    total, power = np.zeros((2, 2)), np.eye(2)
    for _ in range(2000):
        total += power.T @ (Q + slow.T @ R @ slow) @ power
        power = (A + B @ slow) @ power
    np.testing.assert_allclose(cost_of_gain(A, B, Q, R, slow), total, rtol=1e-9)
    with pytest.raises(LabError, match="magnitude 1"):
        cost_of_gain(A, B, Q, R, np.zeros((1, 2)))


@pytest.mark.filterwarnings("error")
def test_a_cost_that_overflows_is_infinite() -> None:
    problem = DOUBLE_INTEGRATOR
    X, U = np.full((problem.N + 1, 2), 1e200), np.zeros((problem.N, 1))
    assert ProblemTerms.of(problem, problem.N).cost(problem, X, U) == np.inf


def test_a_guess_of_other_limits_is_left_aside() -> None:
    """As when a limit is switched on or off between two periods."""
    A, B = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[0.005], [0.1]])
    weights = np.eye(2), np.eye(1), np.eye(2)
    free = Polyhedron(np.zeros((0, 2)), np.zeros(0))
    plans: dict[str, LinearPlan] = {}
    for name, X in (("free", free), ("walls", box([-1.0, -0.5], [1.0, 0.5]))):
        problem = LinearMpcProblem(5, A, B, *weights, X, box([-1.0], [1.0]))
        planner = LinearPlanner(problem)
        x = np.array([-0.9, 0.4])
        cold = run_to_completion(planner.plan(x, None))
        for other in plans.values():
            warm = run_to_completion(planner.plan(x, other))
            np.testing.assert_allclose(warm.U, cold.U, atol=1e-9)
        plans[name] = cold
