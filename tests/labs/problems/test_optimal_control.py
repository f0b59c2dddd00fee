"""The expansion of a problem about a trajectory, against finite differences."""

import numpy as np
import pytest

from labs.errors import LabError
from labs.problems.optimal_control import (
    OptimalControlProblem,
    diverges_at,
    rollout,
    second_derivatives,
)
from labs.resumable import run_to_completion
from tests.labs.problems.random_problem import random_problem, simulate

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("name", ["cart-pole", "acrobot", "ur5"])
def test_the_gradients_of_the_cost_are_those_of_finite_differences(name: str) -> None:
    p = random_problem(RNG, name)
    X, U = RNG.normal(size=(7, p.dynamics.nx)), RNG.normal(size=(6, p.dynamics.nu))
    found, eps = p.cost.derivatives(X, U, exact=True), 1e-6
    for array, gradient in ((X, found.l_x), (U, found.l_u)):
        for index in np.ndindex(array.shape):
            kept = array[index]
            sides = []
            for sign in (1.0, -1.0):
                array[index] = kept + sign * eps
                sides.append(p.cost.value(X, U))
            array[index] = kept
            difference = (sides[0] - sides[1]) / (2 * eps)
            assert gradient[index] == pytest.approx(difference, rel=1e-6, abs=1e-5)


def test_the_hessians_of_the_cost_are_those_of_finite_differences() -> None:
    p = random_problem(RNG, "ur5")
    X, U = RNG.normal(size=(7, 12)), RNG.normal(size=(6, 6))
    found, eps = p.cost.derivatives(X, U, exact=True), 1e-5
    for t in (0, 3, 6):
        for k in range(12):
            sides = []
            for sign in (1.0, -1.0):
                moved = X.copy()
                moved[t, k] += sign * eps
                sides.append(p.cost.derivatives(moved, U, exact=True))
            by_x = (sides[0].l_x - sides[1].l_x)[t] / (2 * eps)
            np.testing.assert_allclose(found.l_xx[t, :, k], by_x, rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(found.l_uu, np.broadcast_to(2 * p.cost.R, (6, 6, 6)))  # type: ignore[attr-defined]
    assert not found.l_ux.any()


def test_the_gauss_newton_hessian_is_never_indefinite() -> None:
    p = random_problem(RNG, "ur5")
    X, U = RNG.normal(size=(7, 12)), RNG.normal(size=(6, 6))
    plain, exact = (p.cost.derivatives(X, U, exact) for exact in (False, True))
    assert np.linalg.eigvalsh(plain.l_xx[-1]).min() > -1e-9
    assert np.abs(plain.l_xx[-1] - exact.l_xx[-1]).max() > 0.1, "there is a difference"
    np.testing.assert_array_equal(plain.l_x, exact.l_x)


@pytest.mark.parametrize("method", ["semi-implicit-euler", "rk4"])
@pytest.mark.parametrize("name", ["pendulum", "cart-pole", "ur5"])
def test_second_derivatives_are_those_of_the_dynamics(name: str, method: str) -> None:
    """Against second differences of the step itself, along random directions."""
    p = random_problem(RNG, name, method=method)
    n, m = p.dynamics.nx, p.dynamics.nu
    X, U = RNG.normal(size=(7, n)), RNG.normal(size=(6, m))
    second = run_to_completion(second_derivatives(p.dynamics, X, U))
    np.testing.assert_array_equal(second, second.transpose(0, 1, 3, 2))
    eps = 1e-3
    for t in range(6):
        d = RNG.normal(size=n + m)
        f = [p.dynamics.step(X[t] + s * eps * d[:n], U[t] + s * eps * d[n:]) for s in (-1, 0, 1)]
        by_difference = (f[0] - 2 * f[1] + f[2]) / eps**2
        found = np.einsum("ijk,j,k->i", second[t], d, d)
        scale = max(1e-3, np.abs(by_difference).max())
        np.testing.assert_allclose(found, by_difference, atol=2e-4 * scale)


def test_a_rollout_follows_the_policy_within_the_bound() -> None:
    p = random_problem(RNG, "cart-pole")
    bounded = OptimalControlProblem(p.dynamics, p.cost, p.x0, p.N, bound=np.array([0.4]))
    X, U, K = RNG.normal(size=(7, 4)), RNG.normal(size=(6, 1)), RNG.normal(size=(6, 1, 4))
    for which, limit in ((p, np.inf), (bounded, 0.4)):
        found_X, found_U, cost = rollout(which, X, U, K)
        np.testing.assert_array_equal(found_X[0], p.x0)
        for t in range(6):
            wanted = np.clip(U[t] + K[t] @ (found_X[t] - X[t]), -limit, limit)
            np.testing.assert_allclose(found_U[t], wanted, atol=1e-14)
            np.testing.assert_array_equal(found_X[t + 1], p.dynamics.step(found_X[t], found_U[t]))
        assert cost == p.cost.value(found_X, found_U)


def test_a_diverging_rollout_costs_infinitely_much() -> None:
    p = random_problem(RNG, "cart-pole", N=60, method="explicit-euler")
    U = np.zeros((60, 1))
    U[3] = 1e9
    X, _, cost = simulate(p, U)
    assert cost == np.inf
    assert 3 < diverges_at(X) <= 5


def test_what_does_not_fit_is_said() -> None:
    p = random_problem(RNG, "cart-pole")
    with pytest.raises(LabError, match="N = 0: a horizon has at least one step"):
        OptimalControlProblem(p.dynamics, p.cost, p.x0, 0)
    with pytest.raises(LabError, match=r"x_0 has shape \(3,\); this system takes \(4,\)"):
        OptimalControlProblem(p.dynamics, p.cost, np.zeros(3), 5)
    with pytest.raises(LabError, match="takes 1 positive numbers"):
        OptimalControlProblem(p.dynamics, p.cost, p.x0, 5, bound=np.array([-1.0]))
