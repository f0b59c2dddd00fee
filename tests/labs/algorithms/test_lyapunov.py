"""Lyapunov functions: constants against closed forms and simulation, P against SciPy, level sets
against states let loose in them."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from labs.algorithms.lyapunov import (
    LyapunovConstants,
    largest_invariant_level,
    largest_level_inside,
    linear_constants,
    sampled_constants,
    solve_lyapunov,
)
from labs.errors import LabError
from labs.problems.polyhedron import box

RNG = np.random.default_rng(31)


def stable(n: int) -> np.ndarray:
    """A random (n, n) of spectral radius 0.95."""
    A = RNG.normal(size=(n, n))
    return np.asarray(0.95 * A / np.abs(np.linalg.eigvals(A)).max())


def weight(n: int) -> np.ndarray:
    M = RNG.normal(size=(n, n))
    return np.asarray(M @ M.T + 0.1 * np.eye(n))


def simulate(A: np.ndarray, X: np.ndarray, steps: int) -> np.ndarray:
    """(steps + 1, k, n) from states X (k, n)."""
    paths = [X]
    for _ in range(steps):
        paths.append(paths[-1] @ A.T)
    return np.array(paths)


# P --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 5])
def test_p_is_scipys(n: int) -> None:
    for _ in range(5):
        A, Q = stable(n), weight(n)
        P = solve_lyapunov(A, Q)
        np.testing.assert_allclose(P, solve_discrete_lyapunov(A.T, Q), rtol=1e-9)
        assert np.abs(A.T @ P @ A - P + Q).max() < 1e-9 * np.abs(P).max()


def test_p_of_a_number_is_a_geometric_series() -> None:
    P = solve_lyapunov(np.array([[0.999]]), np.array([[2.0]]))
    assert P[0, 0] == pytest.approx(2.0 / (1.0 - 0.999**2))


@pytest.mark.parametrize("size", [1.0, 1.2])
def test_without_stability_there_is_no_p(size: float) -> None:
    with pytest.raises(LabError, match="must be stable"):
        solve_lyapunov(np.diag([0.5, size]), np.eye(2))


# Constants ------------------------------------------------------------------------------------


def test_constants_of_a_spiral_are_known() -> None:
    turn = 0.9 * np.array([[0.6, -0.8], [0.8, 0.6]])
    found = linear_constants(turn, np.diag([2.0, 2.0]))
    assert (found.alpha_1, found.alpha_2) == pytest.approx((2.0, 2.0))
    assert found.alpha_3 == pytest.approx(2.0 * (1.0 - 0.81))
    assert (found.c, found.gamma) == pytest.approx((1.0, 0.9)), "the spiral's own rate"
    np.testing.assert_allclose(found.bound(3), [1.0, 0.9, 0.81, 0.729])


@pytest.mark.parametrize("n", [2, 3])
def test_no_state_of_many_breaks_the_bound(n: int) -> None:
    for _ in range(5):
        A = stable(n)
        found = linear_constants(A, solve_lyapunov(A, weight(n)))
        assert found.holds
        assert 0.0 <= found.gamma < 1.0 <= found.c
        paths = simulate(A, RNG.normal(size=(2000, n)), 60)
        norms = np.linalg.norm(paths, axis=2)
        assert (norms <= found.bound(60)[:, None] * norms[0] * (1 + 1e-12)).all()


def test_samples_come_to_the_eigenvalues_from_the_safe_side() -> None:
    A = stable(2)
    P = solve_lyapunov(A, weight(2))
    exact = linear_constants(A, P)
    angles = np.linspace(0.0, np.pi, 2001)
    X = np.stack([np.cos(angles), np.sin(angles)], axis=1) * RNG.uniform(0.1, 5.0, (2001, 1))
    X[0] = 0.0
    ahead = X @ A.T
    values, after = (np.einsum("ki,ij,kj->k", x, P, x) for x in (X, ahead))
    found = sampled_constants(X, values, after)
    for name in ("alpha_1", "alpha_2", "alpha_3"):
        assert getattr(found, name) == pytest.approx(getattr(exact, name), rel=1e-4)
    assert found.alpha_1 >= exact.alpha_1 * (1 - 1e-12)
    assert found.alpha_2 <= exact.alpha_2 * (1 + 1e-12)
    assert found.alpha_3 >= exact.alpha_3 * (1 - 1e-12)
    with pytest.raises(LabError, match="no state but the origin"):
        sampled_constants(np.zeros((1, 2)), np.zeros(1), np.zeros(1))


def test_the_wrong_v_of_a_stable_system_is_told() -> None:
    A = np.array([[0.9, 1.0], [0.0, 0.9]])
    found = linear_constants(A, np.eye(2))
    assert not found.holds
    assert found.alpha_3 < 0.0
    assert np.isnan(found.c)
    assert np.isnan(found.gamma)
    assert np.isnan(LyapunovConstants(0.0, 1.0, 0.5).gamma)
    assert linear_constants(A, solve_lyapunov(A, np.eye(2))).holds


def test_riccatis_p_decreases_by_at_least_the_stage_cost() -> None:
    A, B = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[0.005], [0.1]])
    Q, R = np.diag([1.0, 0.1]), np.array([[0.3]])
    P = solve_discrete_are(A, B, Q, R)
    K = -np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    found = linear_constants(A + B @ K, P)
    assert found.holds
    assert found.alpha_3 == pytest.approx(np.linalg.eigvalsh(Q + K.T @ R @ K)[0])


# Level sets -----------------------------------------------------------------------------------


def test_the_largest_ellipse_touches_the_limits() -> None:
    for _ in range(5):
        P, allowed = weight(2), box([-1.0, -3.0], [2.0, 0.5])
        level = largest_level_inside(P, allowed)
        angles = np.linspace(0.0, 2 * np.pi, 100_000)
        circle = np.stack([np.cos(angles), np.sin(angles)])
        edge = np.sqrt(level) * np.linalg.solve(np.linalg.cholesky(P).T, circle).T
        np.testing.assert_allclose(np.einsum("ki,ij,kj->k", edge, P, edge), level)
        slack = allowed.h - edge @ allowed.H.T
        assert slack.min() == pytest.approx(0.0, abs=1e-7)
    assert largest_level_inside(P, box([0.1, -1.0], [1.0, 1.0])) == 0.0
    assert largest_level_inside(P, box([-np.inf] * 2, [np.inf] * 2)) == np.inf


def test_of_a_linear_system_the_grid_finds_the_largest_ellipse() -> None:
    A = np.array([[1.0, 0.1], [-0.3, 0.8]])
    P, allowed = solve_lyapunov(A, np.eye(2)), box([-1.0, -2.0], [1.0, 2.0])
    X = np.stack(np.meshgrid(np.linspace(-3, 3, 301), np.linspace(-3, 3, 301)), axis=-1)
    values, after = (np.einsum("...i,ij,...j", x, P, x) for x in (X, X @ A.T))
    found = largest_invariant_level(values, after, allowed.contains(X, 1e-9))
    exact = largest_level_inside(P, allowed)
    assert exact <= found <= 1.05 * exact, "of the grid's states the next outside counts"


def test_of_a_cubic_the_level_ends_where_v_grows() -> None:
    """x+ = x (0.5 + x^2): stable within |x| < sqrt(0.5)."""
    x = np.linspace(-1.0, 1.0, 20_001)
    ahead = x * (0.5 + x**2)
    found = largest_invariant_level(x**2, ahead**2, np.ones(len(x), bool))
    assert found == pytest.approx(0.5, rel=1e-3)
    inside = x[x**2 < found]
    for _ in range(3000):
        inside = inside * (0.5 + inside**2)
    assert np.abs(inside).max() < 0.01
    unknown = np.where(x > 0.5, np.nan, x**2)
    assert largest_invariant_level(unknown, ahead**2, x < 0.3) == pytest.approx(0.09, rel=1e-3)
    flat = np.zeros((5, 5))
    assert largest_invariant_level(flat, flat - 1.0, np.ones((5, 5), bool)) == 0.0


def test_a_box_that_is_left_and_a_level_set_that_is_not() -> None:
    A, allowed = np.array([[1.0, 0.5], [-0.2, 0.6]]), box([-1.0, -1.0], [1.0, 1.0])
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    staying = allowed.contains(corners @ A.T)
    np.testing.assert_array_equal(staying, [False, True, False, True])
    P = solve_lyapunov(A, np.eye(2))
    X = RNG.uniform(-1, 1, (2000, 2))
    X = X[np.einsum("ki,ij,kj->k", X, P, X) <= largest_level_inside(P, allowed)]
    assert len(X) > 100
    assert allowed.contains(simulate(A, X, 50).reshape(-1, 2)).all()
