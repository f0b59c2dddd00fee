"""The regulator in badly scaled coordinates, and what is said of a solution that is none."""

from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms.least_squares_lqr import solve_least_squares
from labs.algorithms.periodic_lqr import solve_periodic
from labs.algorithms.riccati import solve, steady_state, steady_state_by_scipy
from labs.algorithms.stabilizability import require_detectable, unstabilizable_modes
from labs.errors import LabError
from labs.problems.linear_quadratic import LqrProblem, weight_roots

ONE, TWO = np.eye(1), np.eye(2)


def scalar(a: float, q: float) -> float:
    """The positive P of P = q + a^2 P / (1 + P)."""
    half = 0.5 * (a * a - 1.0 + q)
    return float(half + np.sqrt(half**2 + q))


def test_a_mode_that_grows_slowly_and_costs_little_is_waited_for() -> None:
    a, q = np.diag([1.0001, 0.5]), np.diag([1e-13, 1.0])
    found = steady_state(a, TWO, q, TWO, most=200_000)
    assert not found.trouble
    assert scalar(1.0001, 1e-13) == pytest.approx(2.0001e-4, rel=1e-5)
    assert found.value[0, 0] == pytest.approx(scalar(1.0001, 1e-13), rel=1e-7)
    assert found.value[1, 1] == pytest.approx(scalar(0.5, 1.0), rel=1e-12)
    assert found.radius < 1.0
    assert "still changes" in steady_state(a, TWO, q, TWO, most=50_000).trouble


def test_it_is_waited_for_along_no_axis_either() -> None:
    """Turned, the small value hides behind the large ones; only the unstable loop tells."""
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    a, q = turn @ np.diag([1.001, 0.5]) @ turn.T, turn @ np.diag([1e-12, 1.0]) @ turn.T
    found = steady_state(a, TWO, 0.5 * (q + q.T), TWO)
    assert not found.trouble
    assert (turn.T @ found.value @ turn)[0, 0] == pytest.approx(scalar(1.001, 0.0), rel=1e-6)


def test_a_solution_of_scipys_that_is_none_is_told() -> None:
    a = np.diag(20.0 * np.linspace(1.0, 1.5, 4)) + np.diag(np.ones(3), 1)
    b = np.eye(4)[:, 3:]
    found = steady_state_by_scipy(a, b, np.eye(4), ONE)
    assert found.radius == pytest.approx(np.abs(np.linalg.eigvals(a + b @ found.gain)).max())
    assert found.residual > 0.1 or found.radius > 1.0, "else it is a solution by now"
    assert found.trouble.startswith("SciPy's P does not solve the Riccati equation")


def test_the_units_of_the_coordinates_do_not_matter() -> None:
    """Powers of two, to the last bit."""
    rng = np.random.default_rng(0)
    a, b = 0.6 * rng.normal(size=(5, 5)), rng.normal(size=(5, 2))
    found = steady_state(a, b, np.eye(5), TWO)
    d = 2.0 ** rng.integers(-30, 30, 5)
    scaled = steady_state(a * d[:, None] / d, d[:, None] * b, np.diag(d**-2), TWO)
    assert scaled.iterations == found.iterations
    np.testing.assert_array_equal(scaled.value * d * d[:, None], found.value)
    np.testing.assert_array_equal(scaled.gain * d, found.gain)


def test_a_controllable_chain_is_so_in_any_units() -> None:
    a, b = np.array([[1.2, 1e-4, 0.0], [0.0, 0.5, 1e4], [0.0, 0.0, 0.5]]), np.eye(3)[:, 2:]
    assert len(unstabilizable_modes(a, b)) == 0
    require_detectable(a.T, np.diag([0.0, 0.0, 1.0]))
    found = steady_state(a, b, np.eye(3), ONE)
    assert not found.trouble
    assert np.abs(np.linalg.eigvals(a + b @ found.gain)).max() < 1.0


@pytest.mark.parametrize("seed", range(40))
def test_what_is_out_of_reach_is_so_in_any_units(seed: int) -> None:
    """n - c coordinates that B does not reach, in turned coordinates and odd units."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    c = int(rng.integers(1, n))
    a, b = rng.normal(size=(n, n)), rng.normal(size=(n, 2))
    a[c:, :c], b[c:] = 0.0, 0.0
    alone = np.linalg.eigvals(a[c:, c:])
    a[c:, c:] *= 1.3 / np.abs(alone).max()
    turn = np.linalg.qr(rng.normal(size=(n, n)))[0] if seed % 2 else np.eye(n)
    d = 10.0 ** rng.uniform(-4, 4, n)
    a, b = (turn @ a @ turn.T) * d[:, None] / d, d[:, None] * (turn @ b)
    hidden = unstabilizable_modes(a, b)
    wanted = 1.3 / np.abs(alone).max() * alone
    wanted = wanted[np.abs(wanted) >= 1.0]
    assert len(hidden) == len(wanted)
    np.testing.assert_allclose(np.sort(np.abs(hidden)), np.sort(np.abs(wanted)), rtol=1e-6)
    assert len(unstabilizable_modes(a, np.hstack([b, np.diag(d)]))) == 0


def test_the_roots_of_a_weight_are_accurate_row_by_row() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4))
    d = np.array([1e-12, 1.0, 1e5, 0.0])
    q = d[:, None] * (root @ root.T) * d
    found = weight_roots(q[None])[0]
    np.testing.assert_allclose(found.T @ found, q, rtol=1e-12)


def test_a_small_negative_weight_is_not_rounding() -> None:
    with pytest.raises(LabError, match=r"Q has an eigenvalue -0\.0001"):
        LqrProblem(1, TWO, TWO, np.diag([1e6, -1e-4]), TWO, TWO)


def test_least_squares_sees_small_weights() -> None:
    """The same problem in other units has the same controls."""
    rng = np.random.default_rng(2)
    a, b, x0 = 0.7 * rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), rng.normal(size=3)
    root = rng.normal(size=(3, 3))
    q = root @ root.T
    q = 0.5 * (q + q.T)
    wanted = solve_least_squares(LqrProblem(10, a, b, q, TWO, q), x0)
    d = np.array([1e-9, 1.0, 1e4])
    scaled_q = q / d / d[:, None]
    scaled = LqrProblem(10, a * d[:, None] / d, d[:, None] * b, scaled_q, TWO, scaled_q)
    np.testing.assert_allclose(solve_least_squares(scaled, d * x0), wanted, rtol=1e-9, atol=1e-12)
    by_riccati = solve(scaled)
    np.testing.assert_allclose(scaled.rollout(by_riccati, d * x0)[1], wanted, rtol=1e-8, atol=1e-11)


def test_a_lap_settles_when_its_smallest_value_does() -> None:
    """A mode that grows by 10 % a lap and costs next to nothing, beside a large one at rest."""
    a, q = np.diag([1.1, 0.5]), np.diag([1e-13, 1.0])
    lap = LqrProblem(1, a, TWO, q, TWO, q)
    found = solve_periodic(lap)
    assert found.policy.values[0, 0, 0] == pytest.approx(scalar(1.1, 1e-13), rel=1e-6)
    assert found.radius < 1.0
    with pytest.raises(LabError, match=r"what it regulates grows by a factor of 1\.1 a lap"):
        solve_periodic(replace(lap, q=np.diag([0.0, 1.0])))
