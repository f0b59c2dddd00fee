"""The linear quadratic regulator against SciPy, a least-squares problem, a QP and itself."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from qpsolvers import Problem, solve_problem
from scipy.linalg import block_diag, solve_discrete_are

from labs.algorithms.least_squares_lqr import prediction_matrices, solve_least_squares
from labs.algorithms.riccati import solve, steady_state, steady_state_by_scipy
from labs.algorithms.stabilizability import unstabilizable_modes
from labs.errors import LabError
from labs.problems.linear_quadratic import LqrPolicy, LqrProblem, tracking_problem

ONE = np.eye(1)


def weight(rng: np.random.Generator, size: int) -> np.ndarray:
    root = rng.normal(size=(size, size))
    return np.asarray(root @ root.T + 0.1 * np.eye(size))


def stationary(seed: int, n: int = 4, m: int = 2, horizon: int = 20) -> LqrProblem:
    """A random system, some of its modes unstable."""
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(n, n)) * 0.6, rng.normal(size=(n, m))
    return LqrProblem(horizon, a, b, weight(rng, n), weight(rng, m), weight(rng, n))


def general(seed: int, n: int = 3, m: int = 2, horizon: int = 8) -> LqrProblem:
    """Every term there is, another at every step."""
    rng = np.random.default_rng(seed)
    joint = np.array([weight(rng, n + m) for _ in range(horizon)])
    return LqrProblem(
        horizon=horizon,
        a=rng.normal(size=(horizon, n, n)) * 0.6,
        b=rng.normal(size=(horizon, n, m)),
        q=joint[:, :n, :n],
        r=joint[:, n:, n:],
        q_final=weight(rng, n),
        s=joint[:, :n, n:],
        c=rng.normal(size=(horizon, n)),
        q_linear=rng.normal(size=(horizon, n)),
        s_linear=rng.normal(size=(horizon, m)),
        constant=rng.normal(size=horizon),
        q_final_linear=rng.normal(size=n),
        constant_final=0.7,
    )


def as_qp(problem: LqrProblem, x0: np.ndarray) -> Problem:
    """The problem in all states and controls (x_0, u_0, x_1, ..., x_N), written out entry by
    entry: half the cost without constants, subject to the dynamics."""
    n, m, steps = problem.n, problem.m, problem.horizon
    size = steps * (n + m) + n
    hessian, gradient = np.zeros((size, size)), np.zeros(size)
    equal, right = np.zeros(((steps + 1) * n, size)), np.zeros((steps + 1) * n)
    equal[:n, :n], right[:n] = np.eye(n), x0

    def term(name: str, t: int) -> np.ndarray:
        stack = problem.terms[name]
        return np.asarray(stack[t] if len(stack) > 1 else stack[0])

    for t in range(steps):
        at = t * (n + m)
        x, u, after = (
            slice(at, at + n),
            slice(at + n, at + n + m),
            slice(at + n + m, at + 2 * n + m),
        )
        hessian[x, x], hessian[u, u] = term("q", t), term("r", t)
        hessian[x, u], hessian[u, x] = term("s", t), term("s", t).T
        gradient[x], gradient[u] = term("q_linear", t), term("s_linear", t)
        rows = slice((t + 1) * n, (t + 2) * n)
        equal[rows, x], equal[rows, u] = -term("a", t), -term("b", t)
        equal[rows, after], right[rows] = np.eye(n), term("c", t)
    hessian[-n:, -n:], gradient[-n:] = problem.q_final, term("q_final_linear", 0)
    return Problem(P=hessian, q=gradient, A=equal, b=right)


def optimum(problem: LqrProblem, x0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x and u of the QP, by quadprog; its residuals certify it."""
    found = solve_problem(as_qp(problem, x0), solver="quadprog")
    assert found.primal_residual() < 1e-8
    assert found.dual_residual() < 1e-8
    n, m, steps = problem.n, problem.m, problem.horizon
    assert found.x is not None
    whole = np.append(found.x, np.zeros(m)).reshape(steps + 1, n + m)
    return whole[:, :n], whole[:-1, n:]


# Against others -------------------------------------------------------------------------------


def test_one_step_by_hand() -> None:
    """x+ = 2 x + u, Q = Q_f = 1, R = 1: H = 2, K = -1, P = 1 + 4 - 2 = 3."""
    policy = solve(LqrProblem(1, 2.0 * ONE, ONE, ONE, ONE, ONE))
    assert policy.gains[0, 0, 0] == pytest.approx(-1.0, abs=1e-15)
    assert policy.values[0, 0, 0] == pytest.approx(3.0, abs=1e-15)


def test_the_steady_state_of_one_dimension() -> None:
    """x+ = x + u, Q = R = 1: P^2 = P + 1, the golden ratio."""
    found = steady_state(ONE, ONE, ONE, ONE)
    golden = (1 + np.sqrt(5)) / 2
    assert found.value[0, 0] == pytest.approx(golden, rel=1e-13)
    assert found.gain[0, 0] == pytest.approx(-golden / (1 + golden), rel=1e-13)
    assert 10 < found.iterations < 40
    assert not found.trouble


@pytest.mark.parametrize("seed", range(8))
def test_the_steady_state_is_scipys(seed: int) -> None:
    p = stationary(seed, n=6, m=3)
    expected = solve_discrete_are(p.a, p.b, p.q, p.r)
    gain = -np.linalg.solve(p.r + p.b.T @ expected @ p.b, p.b.T @ expected @ p.a)
    for found in (steady_state(p.a, p.b, p.q, p.r), steady_state_by_scipy(p.a, p.b, p.q, p.r)):
        np.testing.assert_allclose(found.value, expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.gain, gain, rtol=1e-9, atol=1e-9)
        assert found.residual < 1e-10
        assert np.abs(np.linalg.eigvals(p.a + p.b @ found.gain)).max() < 1.0


@pytest.mark.parametrize("seed", range(4))
def test_a_long_horizon_begins_in_the_steady_state(seed: int) -> None:
    p = stationary(seed, horizon=400)
    policy, steady = solve(p), steady_state(p.a, p.b, p.q, p.r)
    np.testing.assert_allclose(policy.values[0], steady.value, rtol=1e-9)
    np.testing.assert_allclose(policy.gains[0], steady.gain, atol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_riccati_is_the_least_squares_solution(seed: int) -> None:
    p = stationary(seed)
    x0 = np.random.default_rng(seed).normal(size=p.n)
    _, u = p.rollout(solve(p), x0)
    np.testing.assert_allclose(u, solve_least_squares(p, x0), rtol=1e-9, atol=1e-9)


def test_riccati_is_the_least_squares_solution_of_a_varying_system() -> None:
    g = general(3)
    p = LqrProblem(g.horizon, g.a, g.b, g.q, g.r, g.q_final)
    x0 = np.array([1.0, -2.0, 0.5])
    _, u = p.rollout(solve(p), x0)
    np.testing.assert_allclose(u, solve_least_squares(p, x0), rtol=1e-9, atol=1e-9)


def test_the_trajectory_map_is_the_dynamics() -> None:
    g = general(5)
    p = LqrProblem(g.horizon, g.a, g.b, g.q, g.r, g.q_final)
    rng = np.random.default_rng(0)
    x, u = [rng.normal(size=p.n)], rng.normal(size=(p.horizon, p.m))
    for t in range(p.horizon):
        x.append(g.a[t] @ x[t] + g.b[t] @ u[t])
    h, big_g = prediction_matrices(p)
    np.testing.assert_allclose(h @ x[0] + big_g @ u.ravel(), np.ravel(x[1:]), atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_all_terms_together_are_the_qp(seed: int) -> None:
    p = general(seed)
    x0 = np.random.default_rng(seed).normal(size=p.n)
    policy = solve(p)
    x, u = p.rollout(policy, x0)
    x_qp, u_qp = optimum(p, x0)
    np.testing.assert_allclose(x, x_qp, atol=1e-8)
    np.testing.assert_allclose(u, u_qp, atol=1e-8)
    assert policy.value(x0) == pytest.approx(p.cost(x_qp, u_qp), abs=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_all_terms_together_fulfil_the_optimality_conditions(seed: int) -> None:
    """KKT: with lambda_t = P_t x_t + p_t, half the gradient of V_t, every control is stationary
    and every lambda is the cost of its state plus what it hands on."""
    p = general(seed)
    policy = solve(p)
    x, u = p.rollout(policy, np.random.default_rng(seed).normal(size=p.n))
    multiplier = np.einsum("tij,tj->ti", policy.values, x) + policy.linear
    for t in range(p.horizon):
        term = {name: stack[t % len(stack)] for name, stack in p.terms.items()}
        by_u = term["r"] @ u[t] + term["s"].T @ x[t] + term["s_linear"]
        by_x = term["q"] @ x[t] + term["s"] @ u[t] + term["q_linear"]
        np.testing.assert_allclose(by_u + term["b"].T @ multiplier[t + 1], 0.0, atol=1e-9)
        np.testing.assert_allclose(by_x + term["a"].T @ multiplier[t + 1], multiplier[t], atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_tracking_is_the_qp_of_the_differences(seed: int) -> None:
    """The cost of the differences, summed up here, is least; and it is the value."""
    rng = np.random.default_rng(seed)
    n, m, steps = 3, 2, 12
    x_ref, u_ref = rng.normal(size=(steps + 1, n)), rng.normal(size=(steps, m))
    a, b, c = rng.normal(size=(n, n)) * 0.6, rng.normal(size=(n, m)), rng.normal(size=n)
    q, r, q_final = weight(rng, n), weight(rng, m), weight(rng, n)
    p = tracking_problem(steps, (a, b, c), (q, r, q_final), x_ref, u_ref)
    x0 = rng.normal(size=n)
    policy = solve(p)
    x, u = p.rollout(policy, x0)
    by_x, by_u = block_diag(*[q] * steps, q_final), block_diag(*[r] * steps)

    def differences(x: np.ndarray, u: np.ndarray) -> float:
        dx, du = (x - x_ref).ravel(), (u - u_ref).ravel()
        return float(dx @ by_x @ dx + du @ by_u @ du)

    x_qp, u_qp = optimum(p, x0)
    np.testing.assert_allclose(u, u_qp, atol=1e-8)
    assert policy.value(x0) == pytest.approx(differences(x, u), rel=1e-10)
    assert differences(x, u) == pytest.approx(differences(x_qp, u_qp), rel=1e-10)


def test_tracking_a_motion_of_the_system_costs_nothing() -> None:
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 1))
    u_ref, x_ref = rng.normal(size=(10, 1)), np.zeros((11, 3))
    for t in range(10):
        x_ref[t + 1] = a @ x_ref[t] + b @ u_ref[t]
    p = tracking_problem(10, (a, b, None), (np.eye(3), np.eye(1), np.eye(3)), x_ref, u_ref)
    policy = solve(p)
    x, u = p.rollout(policy, x_ref[0])
    np.testing.assert_allclose(x, x_ref, atol=1e-10)
    np.testing.assert_allclose(u, u_ref, atol=1e-10)
    assert policy.value(x_ref[0]) == pytest.approx(0.0, abs=1e-9 * np.sum(x_ref**2))


# Properties -----------------------------------------------------------------------------------


@st.composite
def problems(draw: st.DrawFn) -> LqrProblem:
    """Stabilizable systems of any shape, with weights whose size differs widely."""
    n, m = draw(st.integers(1, 4)), draw(st.integers(1, 3))
    numbers = st.floats(-1.5, 1.5, allow_subnormal=False).map(lambda x: round(x, 3))
    a = draw(arrays(float, (n, n), elements=numbers))
    b = draw(arrays(float, (n, m), elements=numbers))
    assume(np.abs(b).max() > 0.05)
    assume(_stabilizability_margin(a, b) > 1e-2)
    size = st.floats(-2.0, 2.0)
    q, r, q_final = (np.diag(10.0 ** np.array([draw(size) for _ in range(k)])) for k in (n, m, n))
    return LqrProblem(draw(st.integers(1, 30)), a, b, q, r, q_final)


def _stabilizability_margin(a: np.ndarray, b: np.ndarray) -> float:
    """How far (A, B) is from a system with a mode that neither decays nor listens."""
    outside = [e for e in np.linalg.eigvals(a) if abs(e) > 0.95]
    eye = np.eye(len(a))
    return min((np.linalg.svd(np.hstack([a - e * eye, b]))[1][-1] for e in outside), default=1.0)


@given(problems(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_value_and_perturbed_gains(p: LqrProblem, seed: int) -> None:
    """V_0(x_0) is what the policy costs, P_t is symmetric and semidefinite, and any other gain
    costs more."""
    rng = np.random.default_rng(seed)
    x0 = rng.normal(size=p.n)
    policy = solve(p)
    cost = p.cost(*p.rollout(policy, x0))
    assert cost == pytest.approx(policy.value(x0), rel=1e-8)
    assert (policy.values == policy.values.transpose(0, 2, 1)).all()
    size = np.abs(policy.values).max(axis=(1, 2))
    assert (np.linalg.eigvalsh(policy.values)[:, 0] >= -1e-9 * size).all()
    t = rng.integers(p.horizon)
    gains = policy.gains.copy()
    change = rng.normal(size=gains[t].shape)
    gains[t] += change
    other = LqrPolicy(gains, policy.values, policy.offsets, policy.linear, policy.constants)
    x, _ = p.rollout(policy, x0)
    du = change @ x[t]
    h = p.r + p.b.T @ policy.values[t + 1] @ p.b
    dearer = p.cost(*p.rollout(other, x0)) - cost
    assert dearer == pytest.approx(du @ h @ du, rel=1e-6, abs=1e-8 * cost)
    assert dearer >= -1e-12 * cost


@given(problems())
@settings(max_examples=60, deadline=None)
def test_the_steady_state_stabilises(p: LqrProblem) -> None:
    found = steady_state(p.a, p.b, p.q, p.r)
    assert not found.trouble
    assert np.abs(np.linalg.eigvals(p.a + p.b @ found.gain)).max() < 1.0
    directly = steady_state_by_scipy(p.a, p.b, p.q, p.r)
    size = np.abs(directly.value).max()
    np.testing.assert_allclose(found.value, directly.value, atol=1e-7 * size)


# What cannot be -------------------------------------------------------------------------------

WELL_CONDITIONED: dict[str, Any] = {
    "horizon": 3,
    "a": np.eye(2),
    "b": np.ones((2, 1)),
    "q": np.eye(2),
    "r": ONE,
    "q_final": np.eye(2),
}


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"horizon": 0}, "N = 0: it takes at least one step"),
        ({"a": np.eye(3)}, r"b has shape \(2, 1\): it takes \(3, 1\) or \(3, 3, 1\)"),
        ({"a": np.ones(2)}, r"a has shape \(2,\): it takes a matrix"),
        ({"q": np.ones((4, 2, 2))}, r"q has shape \(4, 2, 2\): it takes \(2, 2\) or \(3, 2, 2\)"),
        ({"q_final": np.ones((3, 2, 2))}, r"q_final has shape .*: it takes \(2, 2\)$"),
        ({"c": np.ones(3)}, r"c has shape \(3,\): it takes \(2,\) or \(3, 2\)"),
        ({"a": np.full((2, 2), np.nan)}, "a has entries that are not finite"),
        ({"q": np.array([[1.0, 0.5], [0.0, 1.0]])}, "Q is not symmetric: entries differ by 0.5"),
        ({"q": -np.eye(2)}, "Q has an eigenvalue -1: it takes a positive semidefinite"),
        ({"q_final": np.diag([1.0, -2.0])}, "Q_f has an eigenvalue -2"),
        ({"r": np.zeros((1, 1))}, "R has an eigenvalue 0: it takes a positive definite"),
        ({"r": np.array([ONE, ONE, -ONE])}, "R has an eigenvalue -1"),
        ({"s": np.full((2, 1), 2.0)}, r"\[Q S; S' R\] has an eigenvalue -1.8"),
    ],
)
def test_a_problem_that_is_none_says_why(changes: dict[str, Any], sentence: str) -> None:
    LqrProblem(**WELL_CONDITIONED)
    with pytest.raises(LabError, match=sentence):
        LqrProblem(**{**WELL_CONDITIONED, **changes})


def test_a_mode_out_of_reach_is_named() -> None:
    a, b = np.diag([0.5, 1.2]), np.array([[1.0], [0.0]])
    assert unstabilizable_modes(a, b) == pytest.approx([1.2])
    for find in (steady_state, steady_state_by_scipy):
        with pytest.raises(LabError, match=r"not stabilizable: .* eigenvalue 1\.2"):
            find(a, b, np.eye(2), ONE)
    with pytest.raises(LabError, match="P grows beyond all numbers"):
        solve(LqrProblem(3000, a, b, np.eye(2), ONE, np.eye(2)))


def test_a_stable_mode_out_of_reach_is_none_of_our_business() -> None:
    a, b = np.diag([0.5, 1.2]), np.array([[0.0], [1.0]])
    assert len(unstabilizable_modes(a, b)) == 0
    assert not steady_state(a, b, np.eye(2), ONE).trouble


def test_an_unstable_mode_must_cost_something() -> None:
    """Position that costs nothing drifts: no steady state brings it back."""
    a, b = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[0.005], [0.1]])
    for find in (steady_state, steady_state_by_scipy):
        with pytest.raises(LabError, match="Q does not see the mode with eigenvalue 1,"):
            find(a, b, np.diag([0.0, 1.0]), ONE)
        assert find(a, b, np.diag([1.0, 0.0]), ONE).residual < 1e-10


def test_too_few_steps_of_the_recursion_are_told() -> None:
    found = steady_state(ONE, ONE, ONE, ONE, most=3)
    assert found.iterations == 3
    assert found.trouble.startswith("After 3 steps of the recursion P still changes by ")


def test_the_least_squares_problem_knows_its_bounds() -> None:
    with pytest.raises(LabError, match="takes A, B, Q, R and Q_f alone"):
        solve_least_squares(general(0), np.zeros(3))
    with pytest.raises(LabError, match="N = 2000 makes a matrix of 12000 by 4000 entries"):
        solve_least_squares(stationary(0, horizon=2000), np.zeros(4))
