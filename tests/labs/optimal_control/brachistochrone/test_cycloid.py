"""The fastest descent's closed forms, against quadrature and the best polylines."""

import numpy as np
import pytest
from scipy.integrate import quad

from labs.algorithms import sqp
from labs.optimal_control.brachistochrone.curves import cycloid
from labs.optimal_control.brachistochrone.cycloid import cycloid_points, fastest_descent
from labs.optimal_control.brachistochrone.descent import descend
from labs.optimal_control.brachistochrone.fastest_polyline import FastestPolyline, grid_abscissae
from labs.optimal_control.brachistochrone.lab import OPTIONS

G = 9.81
ENDS = [(2.0, 1.0), (1.0, 1.0), (0.3, 2.3), (3.7, 0.1)]
"""Steep and flat: theta_B from 0.6 to 5.7."""


@pytest.mark.parametrize("ends", ENDS)
def test_the_cycloid_ends_in_b_after_the_time_of_its_formula(ends: tuple[float, float]) -> None:
    found = fastest_descent(*ends, G)
    end = cycloid_points(found.radius, np.array([found.theta]))[0]
    np.testing.assert_allclose(end, ends, rtol=1e-10)
    assert found.time == pytest.approx(found.theta * np.sqrt(found.radius / G), rel=1e-14)

    def pace(theta: float) -> float:
        """ds / v for each radian."""
        x, y = 1.0 - np.cos(theta), np.sin(theta)
        return float(found.radius * np.hypot(x, y) / np.sqrt(2.0 * G * found.radius * x))

    assert quad(pace, 1e-9, found.theta)[0] == pytest.approx(found.time, rel=1e-7)
    assert descend(cycloid(*ends), G, 0.0).time == pytest.approx(found.time, rel=3e-7)


@pytest.mark.parametrize(("ends", "mu"), [((2.0, 1.0), 0.2), ((1.0, 1.0), 0.5), ((2.0, 1.0), 0.45)])
def test_with_friction_it_falls_plumb_and_joins_a_tilted_cycloid(
    ends: tuple[float, float], mu: float
) -> None:
    """Its drawn-out form ends in B after this time, and no polyline is faster: those of 100 and 200
    segments tend to it from above at order 2."""
    found = fastest_descent(*ends, G, mu)
    phi, stretch = np.arctan(mu), np.hypot(1.0, mu)
    psi = 2.0 * phi + (found.theta - 2.0 * phi) * np.linspace(0.0, 1.0, 3000) ** 2
    along, fall = cycloid_points(found.radius, psi).T
    curve = np.stack([along - mu * fall, fall + mu * along], axis=1) / stretch
    curve += np.array([0.0, found.plumb]) - curve[0]
    np.testing.assert_allclose(curve[-1], ends, rtol=1e-9)
    drawn = np.concatenate([[[0.0, 0.0]], curve])
    assert descend(drawn, G, mu).time == pytest.approx(found.time, rel=1e-6)
    errors = [optimum(ends, mu, N) / found.time - 1.0 for N in (100, 200)]
    assert 0.0 < errors[1] < errors[0] < 1e-4
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def optimum(ends: tuple[float, float], mu: float, segments: int) -> float:
    """[s] the best polyline's time."""
    problem = FastestPolyline(grid_abscissae(ends[0], segments, "clustered"), ends[1], G, mu)
    line = ends[1] * problem.x[1:-1] / ends[0]
    at = sqp.solve(problem, problem.speeds(line), OPTIONS)
    assert at.converged
    return 1e-3 * at.values.f


def test_a_bend_presses_as_much_as_the_weight() -> None:
    """v^2 kappa = g sin(theta / 2), the weight's part across the cycloid."""
    h, theta, r = 1e-4, np.linspace(0.3, 5.0, 9), 0.5
    before, here, after = (cycloid_points(r, theta + step) for step in (-h, 0.0, h))
    (x_1, y_1), (x_2, y_2) = ((after - before) / (2 * h)).T, ((after - 2 * here + before) / h**2).T
    curvature = np.abs(x_1 * y_2 - y_1 * x_2) / np.hypot(x_1, y_1) ** 3
    weight = G * np.abs(x_1) / np.hypot(x_1, y_1)
    np.testing.assert_allclose(2.0 * G * here[:, 1] * curvature, weight, rtol=1e-5)


def test_without_friction_nothing_is_plumb() -> None:
    none, little = (fastest_descent(2.0, 1.0, G, mu) for mu in (0.0, 1e-6))
    assert none.plumb == 0.0
    assert little.time == pytest.approx(none.time, rel=1e-5)
