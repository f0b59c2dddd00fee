"""The programme whose minimum is the fastest polyline: its derivatives, convexity and order."""

import numpy as np
import pytest

from labs.algorithms import sqp
from labs.optimal_control.brachistochrone.cycloid import fastest_descent
from labs.optimal_control.brachistochrone.descent import descend
from labs.optimal_control.brachistochrone.fastest_polyline import FastestPolyline, grid_abscissae
from labs.optimal_control.brachistochrone.lab import OPTIONS
from labs.resumable import run_to_completion

G, NONE = 9.81, np.zeros(0)


def programme(across: float, depth: float, segments: int, **more: float) -> FastestPolyline:
    return FastestPolyline(grid_abscissae(across, segments, "clustered"), depth, G, **more)


def some_speeds(problem: FastestPolyline, seed: int) -> np.ndarray:
    """Of a jagged curve."""
    v = problem.straight_line_speeds
    return v * np.random.default_rng(seed).uniform(0.7, 1.5, len(v))


def hessian(problem: FastestPolyline, v: np.ndarray, exact: bool) -> np.ndarray:
    return np.asarray(run_to_completion(problem.hessian(v, NONE, NONE, exact)).toarray())


@pytest.mark.parametrize("mu", [0.0, 0.2])
@pytest.mark.parametrize("seed", range(3))
def test_derivatives_are_those_of_finite_differences(mu: float, seed: int) -> None:
    problem = programme(2.0, 1.0, 9, mu=mu)
    v, h = some_speeds(problem, seed), 1e-6
    steps = h * np.eye(len(v))
    f_y = problem.derivatives(v).f_y
    by_f = [(problem.values(v + s).f - problem.values(v - s).f) / (2.0 * h) for s in steps]
    np.testing.assert_allclose(f_y, by_f, rtol=1e-6, atol=1e-5)
    by_f_y = [
        (problem.derivatives(v + s).f_y - problem.derivatives(v - s).f_y) / (2.0 * h) for s in steps
    ]
    H = hessian(problem, v, exact=True)
    np.testing.assert_allclose(H, by_f_y, rtol=1e-6, atol=1e-4)
    assert not np.tril(H, -2).any(), "tridiagonal"


def test_the_time_is_that_of_a_bead() -> None:
    for mu in (0.0, 0.2):
        problem = programme(2.0, 1.0, 9, mu=mu)
        v = some_speeds(problem, 0)
        time = 1e3 * descend(problem.nodes(v), G, mu).time
        assert problem.values(v).f == pytest.approx(time, rel=1e-12)
        np.testing.assert_allclose(problem.speeds(problem.nodes(v)[1:-1, 1]), v)


def test_it_is_convex() -> None:
    """Without friction anywhere; with it where no segment climbs too steeply, and as told."""
    for seed in range(20):
        free, rough = (programme(2.0, 1.0, 9, mu=mu) for mu in (0.0, 0.4))
        v = some_speeds(free, seed)
        assert np.linalg.eigvalsh(hessian(free, v, exact=True)).min() > 0.0
        v = np.random.default_rng(seed).uniform(0.01, 9.0, 8)
        assert np.linalg.eigvalsh(hessian(rough, v, exact=False)).min() > -1e-9


@pytest.mark.parametrize(("name", "order"), [("even", 1.0), ("clustered", 2.0)])
def test_the_error_falls_at_the_order_of_the_grid(name: str, order: float) -> None:
    best = 1e3 * fastest_descent(2.0, 1.0, G).time
    errors = []
    for N in (40, 80, 160):
        problem = FastestPolyline(grid_abscissae(2.0, N, name), 1.0, G)
        at = sqp.solve(problem, problem.straight_line_speeds, OPTIONS)
        assert at.converged
        errors.append(at.values.f / best - 1.0)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, order, atol=0.05)


@pytest.mark.parametrize("ends", [(2.0, 1.0), (1.0, 1.0), (0.3, 2.3), (3.0, 0.7)])
def test_with_100_segments_it_is_within_1e_4_of_the_cycloid(ends: tuple[float, float]) -> None:
    problem = programme(*ends, 100)
    at = sqp.solve(problem, problem.straight_line_speeds, OPTIONS)
    assert at.converged
    assert 0.0 < 1e-3 * at.values.f / fastest_descent(*ends, G).time - 1.0 < 1e-4


def test_on_a_floor_at_the_depth_of_b_it_falls_on_half_a_cycloid_and_goes_level() -> None:
    w, h = 3.0, 0.5
    problem = programme(w, h, 200, floor=h)
    at = sqp.solve(problem, problem.straight_line_speeds, OPTIONS)
    assert at.converged
    r = h / 2.0
    exact = np.pi * np.sqrt(r / G) + (w - np.pi * r) / np.sqrt(2.0 * G * h)
    assert 0.0 < 1e-3 * at.values.f / exact - 1.0 < 1e-4
    y = problem.nodes(at.y)[:, 1]
    assert y.max() <= h * (1.0 + 1e-12)
    on_floor = problem.x[1:-1][at.nu > 0.0]
    assert on_floor.min() == pytest.approx(np.pi * r, abs=0.05)


def test_what_does_not_move_has_no_time() -> None:
    problem = programme(2.0, 1.0, 5)
    assert problem.values(np.array([1.0, 0.0, 1.0, 1.0])).f == np.inf
    assert problem.values(np.array([1.0, np.nan, 1.0, 1.0])).f == np.inf
