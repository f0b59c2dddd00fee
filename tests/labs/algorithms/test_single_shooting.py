"""Derivatives of single shooting by finite differences, its orders, and closed forms."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labs.algorithms import riccati
from labs.algorithms.shooting_steps import COST_FORMS, SHOOTING_METHODS, CostForm
from labs.algorithms.single_shooting import SingleShooting
from labs.errors import LabError
from labs.models.mechanisms import mechanism
from labs.problems.linear_quadratic import LqrProblem
from labs.problems.nonlinear_program import NonlinearProgram
from labs.resumable import run_to_completion
from tests.labs.problems.continuous_problems import (
    Circle,
    Disc,
    DoubleIntegrator,
    Quadratic,
    nonlinear,
    problem,
)

NOTHING = np.zeros(0)


def differences(f: Callable[[np.ndarray], np.ndarray], y: np.ndarray, eps: float) -> np.ndarray:
    """df/dy by central differences, the last axis that of y."""
    sides = [[f(y + sign * e) for e in eps * np.eye(len(y))] for sign in (1.0, -1.0)]
    return np.stack((np.array(sides[0]) - np.array(sides[1])) / (2.0 * eps), axis=-1)


def constrained(rng: np.random.Generator, name: str) -> SingleShooting:
    """With everything a problem may have."""
    n = mechanism(name).nx
    lower, upper, goal = np.full(n, -np.inf), np.full(n, np.inf), np.full(n, np.nan)
    lower[0], upper[0], upper[-1], goal[1:] = -1.0, 1.0, 2.0, 0.3
    given = {"x_lower": lower, "x_upper": upper, "x_final": goal, "path": Disc(), "end": Circle()}
    return SingleShooting(nonlinear(rng, name, T_limits=(0.1, 3.0), **given), N=4, M=2)


@pytest.mark.parametrize("form", COST_FORMS)
@pytest.mark.parametrize("method", SHOOTING_METHODS)
def test_sensitivities_and_gradients_by_finite_differences(method: str, form: CostForm) -> None:
    rng = np.random.default_rng(1)
    p = nonlinear(rng, "double-pendulum", T_limits=(0.1, 3.0))
    shooting = SingleShooting(p, 4, 3, method, form)
    y = shooting.pack(rng.normal(size=(4, 2)), 0.7)
    at = shooting.linearize(y)
    S = shooting.sensitivities(at)
    assert S.shape == (13, 4, 9)
    by_differences = differences(lambda y: shooting.rollout(y).X, y, 1e-6)
    np.testing.assert_allclose(S, by_differences, atol=1e-8, rtol=1e-7)
    assert not S[3, :, 2:-1].any(), "the future has no influence"
    gradient = shooting.gradient_by_adjoint(y, at)
    np.testing.assert_allclose(
        shooting.gradient_by_sensitivities(y, at, S), gradient, rtol=1e-12, atol=1e-12
    )
    central = run_to_completion(shooting.gradient_by_differences(y, 1e-6, "central"))
    np.testing.assert_allclose(central, gradient, rtol=1e-7, atol=1e-7)
    forward = run_to_completion(shooting.gradient_by_differences(y, 1e-7, "forward"))
    np.testing.assert_allclose(forward, gradient, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("name", ["pendulum", "cart-pole"])
def test_constraints_and_exact_hessian_by_finite_differences(name: str) -> None:
    rng = np.random.default_rng(2)
    shooting: NonlinearProgram = constrained(rng, name)
    assert isinstance(shooting, SingleShooting)
    y = shooting.pack(rng.normal(size=(4, 1)), 0.7)
    at, values = shooting.derivatives(y), shooting.values(y)
    for of, analytic in (("c", at.c_y), ("g", at.g_y)):
        by_differences = differences(lambda y: getattr(shooting.values(y), of), y, 1e-6)  # noqa: B023
        np.testing.assert_allclose(analytic.toarray(), by_differences, atol=1e-7)
    assert at.c_y.nnz == at.c_y.shape[0] * 5
    assert at.g_y.nnz == (1 + 2 + 3 + 4 + 4) * len(values.g) // 4, "and T"
    lam, mu = rng.normal(size=len(values.c)), rng.uniform(size=len(values.g))

    def gradient(y: np.ndarray) -> np.ndarray:
        at = shooting.derivatives(y)
        return np.asarray(at.f_y + at.c_y.T @ lam + at.g_y.T @ mu)

    exact = run_to_completion(shooting.hessian(y, lam, mu, exact=True)).toarray()
    np.testing.assert_allclose(exact, differences(gradient, y, 1e-5), rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(exact, exact.T)
    gauss_newton = run_to_completion(shooting.hessian(y, lam, mu, exact=False)).toarray()
    assert np.linalg.eigvalsh(gauss_newton).min() > -1e-9


@pytest.mark.parametrize("form", COST_FORMS)
def test_the_hessians_meet_where_the_model_is_linear(form: CostForm) -> None:
    cost = Quadratic(np.diag([1.0, 0.2]), np.array([[0.3]]), np.eye(2), np.array([1.0, 0.0]))
    p = problem(DoubleIntegrator(), cost, np.array([0.5, -1.0]), 2.0)
    shooting = SingleShooting(p, 5, 3, "rk4", form)
    y = np.random.default_rng(3).normal(size=5)
    exact, gauss_newton = (
        run_to_completion(shooting.hessian(y, NOTHING, NOTHING, kind)).toarray()
        for kind in (True, False)
    )
    np.testing.assert_allclose(gauss_newton, exact, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("form", COST_FORMS)
@pytest.mark.parametrize("method", SHOOTING_METHODS)
def test_one_newton_step_is_riccati(method: str, form: CostForm) -> None:
    rng = np.random.default_rng(4)
    cost = Quadratic(np.diag([2.0, 0.1]), np.array([[0.5]]), np.diag([9.0, 3.0]), np.zeros(2))
    p = problem(DoubleIntegrator(), cost, np.array([1.0, 0.3]), 1.5)
    shooting = SingleShooting(p, 10, 1, method, form)
    y = rng.normal(size=10)
    gradient = shooting.derivatives(y).f_y
    hessian = run_to_completion(shooting.hessian(y, NOTHING, NOTHING, exact=False)).toarray()
    y = y - np.linalg.solve(hessian, gradient)
    at = shooting.linearize(y, gauss_newton=True)
    half = 0.5 * at.L_zz[0]
    policy = riccati.solve(
        LqrProblem(10, at.A[0], at.B[0, :, :1], half[:2, :2], half[2:3, 2:3], cost.F, half[:2, 2:3])
    )
    X = shooting.rollout(y).X
    np.testing.assert_allclose(y, [(K @ x)[0] for K, x in zip(policy.gains, X, strict=False)])
    assert shooting.cost(y) == pytest.approx(p.x0 @ policy.values[0] @ p.x0, rel=1e-12)


def test_least_energy_over_a_metre_has_its_closed_form() -> None:
    """From rest to rest in T with int u^2 least: u = 6/T^2 - 12 t/T^3; held on pieces it takes the
    means of that over them, up to O(1/N^2), and the cost is 12/T^3 (1 + O(1/N^2))."""
    T, excess = 2.0, []
    for N in (10, 20):
        cost = Quadratic(np.zeros((2, 2)), np.eye(1), np.zeros((2, 2)), np.zeros(2))
        p = problem(DoubleIntegrator(), cost, np.zeros(2), T, x_final=np.array([1.0, 0.0]))
        shooting = SingleShooting(p, N)
        y = np.zeros(N)
        at, c = shooting.derivatives(y), shooting.values(y).c
        hessian = run_to_completion(shooting.hessian(y, np.zeros(2), NOTHING, True)).toarray()
        J = at.c_y.toarray()
        kkt = np.block([[hessian, J.T], [J, np.zeros((2, 2))]])
        y = np.linalg.solve(kkt, -np.concatenate([at.f_y, c]))[:N]
        np.testing.assert_allclose(shooting.values(y).c, 0.0, atol=1e-12)
        middle = (np.arange(N) + 0.5) * T / N
        exact = 6.0 / T**2 - 12.0 * middle / T**3
        np.testing.assert_allclose(y / exact, 1.0 / (1.0 - 1.0 / N**2), rtol=1e-9)
        excess.append(shooting.cost(y) / (12.0 / T**3) - 1.0)
    assert np.log2(excess[0] / excess[1]) == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("method", SHOOTING_METHODS)
def test_errors_fall_at_the_order_of_the_method(method: str) -> None:
    """Of state and cost, over M with N fixed; the notes' sum is of order 1 whatever the method."""
    p = nonlinear(np.random.default_rng(5), "pendulum")
    U = np.random.default_rng(6).normal(size=(3, 1))
    X, J = p.x0, 0.0
    for u in U:

        def augmented(t: float, x: np.ndarray, u: np.ndarray = u) -> np.ndarray:
            return np.append(p.dynamics.f(x[:2], u), p.cost.running(x[None, :2], u[None]))

        end = solve_ivp(augmented, (0.0, p.T / 3), np.append(X, J), rtol=1e-12, atol=1e-12).y[:, -1]
        X, J = end[:2], end[2]
    J += p.cost.final(X)

    def errors(M: int, form: CostForm) -> np.ndarray:
        shooting = SingleShooting(p, 3, M, method, form)
        y = shooting.pack(U)
        off = np.linalg.norm(shooting.rollout(y).X[-1] - X)
        return np.array([off, abs(shooting.cost(y) - J)])

    order, M = SHOOTING_METHODS[method].order, 16 if method == "rk4" else 400
    orders = np.log2(errors(M, "augmented") / errors(2 * M, "augmented"))
    np.testing.assert_allclose(orders, order, atol=0.1)
    assert np.log2(errors(400, "sum") / errors(800, "sum"))[-1] == pytest.approx(1.0, abs=0.1)


def test_a_diverging_rollout_has_no_cost_and_says_where() -> None:
    p = nonlinear(np.random.default_rng(7), "cart-pole")
    shooting = SingleShooting(p, 8, 2, "explicit-euler")
    y = np.zeros(8)
    assert np.isfinite(shooting.cost(y))
    y[3] = 1e12
    assert shooting.values(y).f == np.inf
    step, t = shooting.diverges_at(y)
    assert 6 < step <= 8, "in the fourth piece"
    assert t == pytest.approx(step * p.T / 16)


def test_names_say_what_and_where() -> None:
    shooting = constrained(np.random.default_rng(8), "pendulum")
    assert shooting.equality_name(0) == "x_2 at the end"
    assert shooting.equality_name(1) == "the distance from the circle at the end"
    size = len(shooting.values(shooting.pack(np.zeros((4, 1)))).g) // 4
    assert size == 5
    names = [shooting.inequality_name(size + i) for i in range(size)]
    assert names[0] == "the upper bound of x_1 at the end of piece 2 of 4"
    assert names[2] == "the lower bound of x_1 at the end of piece 2 of 4"
    assert names[3] == "the distance from the disc at the end of piece 2 of 4"
    assert shooting.variable_name(3) == "u_1 in piece 4 of 4"
    assert shooting.variable_name(4) == "the horizon T"
    assert (shooting.lower[-1], shooting.upper[-1]) == (0.1, 3.0)


def test_what_does_not_fit_is_said() -> None:
    p = nonlinear(np.random.default_rng(9), "pendulum")
    with pytest.raises(LabError, match="no method is named 'rk5'; there are explicit-euler"):
        SingleShooting(p, 3, method="rk5")
    with pytest.raises(LabError, match="at least one piece"):
        SingleShooting(p, 0)
