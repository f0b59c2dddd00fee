"""The periodic regulator, against long horizons, SciPy, a stacked least-squares problem and costs
paid step by step."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from labs.algorithms.periodic_lqr import PeriodicRegulator, preview_problem, solve_periodic
from labs.algorithms.riccati import solve
from labs.errors import LabError
from labs.problems.linear_quadratic import LqrProblem

M = 12


def lap(seed: int = 0, n: int = 4, m: int = 2) -> LqrProblem:
    """A lap whose every term but Q and R varies, with modes that grow."""
    rng = np.random.default_rng(seed)
    a = np.eye(n) + 0.2 * rng.standard_normal((M, n, n))
    return LqrProblem(
        horizon=M,
        a=a,
        b=rng.standard_normal((M, n, m)),
        q=np.diag(rng.uniform(0.5, 2.0, n)),
        r=np.diag(rng.uniform(0.5, 2.0, m)),
        q_final=np.eye(n),
        c=rng.standard_normal((M, n)),
        q_linear=rng.standard_normal(n),
        s_linear=rng.standard_normal((M, m)),
    )


def repeated(problem: LqrProblem, laps: int) -> LqrProblem:
    """The same for several laps."""
    at = np.arange(laps * M)
    terms: dict[str, Any] = {
        name: term[at % len(term)] for name, term in problem.terms.items() if "final" not in name
    }
    return LqrProblem(horizon=laps * M, q_final=problem.q_final, **terms)


def test_it_is_the_policy_far_from_the_end_of_a_long_horizon() -> None:
    problem = lap()
    found = solve_periodic(problem)
    far = solve(repeated(problem, 30))
    np.testing.assert_allclose(found.policy.gains, far.gains[:M], atol=1e-9)
    np.testing.assert_allclose(found.policy.offsets, far.offsets[:M], atol=1e-8)
    assert found.laps > 2
    np.testing.assert_allclose(found.policy.values[0], found.policy.values[M], rtol=1e-8)


def test_where_nothing_varies_it_is_scipys_steady_state() -> None:
    one = lap(3)
    a, b = one.a[0], one.b[0]
    still = replace(one, a=a, b=b, c=None, q_linear=None, s_linear=None)
    found = solve_periodic(still)
    p = solve_discrete_are(a, b, one.q, one.r)
    for value in found.policy.values:
        np.testing.assert_allclose(value, p, rtol=1e-8, atol=1e-10)
    assert found.lap_cost == pytest.approx(0.0, abs=1e-12)


def periodic_steady_state(
    found: PeriodicRegulator, laps: int = 40
) -> tuple[np.ndarray, np.ndarray]:
    """x (M + 1, n) and u (M, m) of the last of many laps."""
    problem, policy = found.problem, found.policy
    x = np.ones(problem.n)
    for _ in range(laps):
        xs, us = problem.rollout(policy, x)
        x = xs[-1]
    return xs, us


def test_a_settled_lap_costs_what_is_foretold() -> None:
    found = solve_periodic(lap(1))
    x, u = periodic_steady_state(found)
    np.testing.assert_allclose(x[0], x[-1], atol=1e-9)
    nothing = np.zeros_like(found.problem.q_final)
    paid = replace(found.problem, q_final=nothing).cost(x, u)
    assert paid == pytest.approx(found.lap_cost, rel=1e-8)
    assert abs(paid) > 1.0


def test_no_other_motion_that_repeats_is_cheaper() -> None:
    """Of all u over a lap that lead back to where they began: the least-squares problem with that
    as its constraint, by its optimality conditions."""
    found = solve_periodic(lap(2))
    problem = found.problem
    n, m = problem.n, problem.m
    size = M * (n + m)
    hessian, linear = np.zeros((size, size)), np.zeros(size)
    rows, right = np.zeros((M * n, size)), np.zeros(M * n)
    for t in range(M):
        x, u = slice(t * n, t * n + n), slice(M * n + t * m, M * n + t * m + m)
        after = slice((t + 1) % M * n, (t + 1) % M * n + n)
        hessian[x, x], hessian[u, u] = problem.q, problem.r
        linear[x], linear[u] = problem.terms["q_linear"][0], problem.terms["s_linear"][t]
        step = slice(t * n, t * n + n)
        rows[step, after] += np.eye(n)
        rows[step, x] -= problem.a[t]
        rows[step, u] -= problem.b[t]
        right[step] = problem.terms["c"][t]
    kkt = np.block([[hessian, rows.T], [rows, np.zeros((M * n, M * n))]])
    z = np.linalg.solve(kkt, np.concatenate([-linear, right]))[:size]
    least = z @ hessian @ z + 2.0 * linear @ z
    assert found.lap_cost == pytest.approx(least, rel=1e-8)
    xs, us = periodic_steady_state(found)
    np.testing.assert_allclose(z[: M * n].reshape(M, n), xs[:M], atol=1e-7)
    np.testing.assert_allclose(z[M * n :].reshape(M, m), us, atol=1e-7)


def test_linear_terms_reach_k_by_a_recursion_of_their_own() -> None:
    """The formulas of the module's head."""
    found = solve_periodic(lap(4))
    problem, policy = found.problem, found.policy
    for t in range(M):
        a, b, c = problem.a[t], problem.b[t], problem.terms["c"][t]
        s, q = problem.terms["s_linear"][t], problem.terms["q_linear"][0]
        p_next, value, k = policy.linear[t + 1], policy.values[t + 1], policy.gains[t]
        ahead = p_next + value @ c
        expected = q + k.T @ s + (a + b @ k).T @ ahead
        np.testing.assert_allclose(policy.linear[t], expected, atol=1e-8)
        h = problem.r + b.T @ value @ b
        np.testing.assert_allclose(policy.offsets[t], -np.linalg.solve(h, b.T @ ahead + s))


@pytest.mark.parametrize("start", [0, 5, M - 1])
def test_a_preview_has_the_gains_for_ever_and_its_own_offsets(start: int) -> None:
    found = solve_periodic(lap(5))
    window, policy = preview_problem(found, start, 7)
    at = (start + np.arange(7)) % M
    np.testing.assert_allclose(policy.gains, found.policy.gains[at], atol=1e-8)
    np.testing.assert_array_equal(window.terms["c"], found.problem.terms["c"][at])
    assert np.abs(policy.offsets[0] - found.policy.offsets[start]).max() > 1e-4
    _, far = preview_problem(found, start, 10 * M)
    np.testing.assert_allclose(far.offsets[0], found.policy.offsets[start], atol=1e-8)


def test_without_preview_there_is_no_affine_term() -> None:
    found = solve_periodic(lap(6))
    window, policy = preview_problem(found, 3, 0)
    assert window.horizon == 1
    np.testing.assert_array_equal(policy.offsets, 0.0)
    np.testing.assert_allclose(policy.gains[0], found.policy.gains[3], atol=1e-8)


def test_the_end_of_a_preview_costs_what_a_reference_that_is_a_motion_would() -> None:
    """Beyond it c, q and s count as zero: the same as a longer horizon in which they are."""
    found = solve_periodic(lap(7))
    _, near = preview_problem(found, 2, 6)
    longer = repeated(found.problem, 20)
    names = ("c", "q_linear", "s_linear")
    terms: dict[str, Any] = {name: longer.terms[name].copy() for name in names}
    for term in terms.values():
        term[8:] = 0.0
    far = solve(replace(longer, **terms))
    np.testing.assert_allclose(near.offsets, far.offsets[2:8], atol=1e-8)


def test_what_no_control_reaches_is_refused() -> None:
    one = np.eye(1)
    with pytest.raises(LabError, match="after 400 laps"):
        solve_periodic(LqrProblem(2, one, 0.0 * one, one, one, one))
