"""The motion of a bead down a polyline, against closed forms and an integrated motion."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from labs.optimal_control.brachistochrone import curves
from labs.optimal_control.brachistochrone.descent import BeadMotion, Descent, descend

G = 9.81
ZIGZAG = np.array([[0.0, 0.0], [0.3, 0.9], [0.1, 1.0], [2.0, 1.2], [2.2, 0.8]])
"""Steep, back, level, and up again."""


def at(descent: Descent, t: float) -> BeadMotion:
    return descent.at(np.array([t]))


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_an_inclined_plane_is_school_physics(mu: float) -> None:
    descent = descend(curves.straight_line(2.0, 1.5), G, mu)
    a = G * (1.5 - mu * 2.0) / 2.5
    assert descent.time == pytest.approx(np.sqrt(2.0 * 2.5 / a), rel=1e-14)
    now = at(descent, 0.4)
    np.testing.assert_allclose(now.point[0], 0.5 * a * 0.4**2 * np.array([0.8, 0.6]), rtol=1e-13)
    assert now.speed[0] == pytest.approx(0.4 * a, rel=1e-13)
    assert now.friction_work[0] == pytest.approx(mu * G * now.point[0, 0], rel=1e-13)


@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_it_moves_as_the_equation_of_motion_says(mu: float) -> None:
    """s'' = g (sin alpha - mu cos alpha), segment by segment."""
    descent = descend(ZIGZAG, G, mu)
    begin, v = 0.0, 0.0
    for a, b in pairwise(ZIGZAG):
        length = float(np.hypot(*(b - a)))
        pull = G * ((b - a)[1] - mu * abs((b - a)[0])) / length

        def motion(t: float, s: np.ndarray, pull: float = pull) -> list[float]:
            return [s[1], pull]

        def passes(t: float, s: np.ndarray, length: float = length) -> float:
            return float(s[0] - length)

        passes.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(motion, (0.0, 9.0), [0.0, v], events=passes, rtol=1e-11, atol=1e-12)
        middle = begin + 0.5 * run.t[-1]
        part = float(np.interp(0.0, [0.0], [v * 0.5 * run.t[-1] + pull * run.t[-1] ** 2 / 8.0]))
        np.testing.assert_allclose(
            at(descent, middle).point[0], a + part / length * (b - a), atol=1e-8
        )
        begin, v = begin + run.t[-1], run.y[1, -1]
    assert descent.arrived
    assert descent.time == pytest.approx(begin, rel=1e-8)


def test_energy_is_kept_up_to_what_friction_takes() -> None:
    descent = descend(ZIGZAG, G, 0.1)
    now = descent.at(np.linspace(0.0, 1.2 * descent.time, 50))
    np.testing.assert_allclose(
        0.5 * now.speed**2 + now.friction_work, G * now.point[:, 1], atol=1e-12
    )
    np.testing.assert_array_equal(now.point[-1], ZIGZAG[-1])
    np.testing.assert_allclose(np.hypot(*now.direction.T), 1.0)


def test_a_quadrant_takes_a_pendulum_a_quarter_of_its_period() -> None:
    R = 0.7
    exact = np.sqrt(R / G) * ellipk(0.5)
    assert descend(curves.circle_to_bottom(R, 0.0), G, 0.0).time == pytest.approx(exact, rel=3e-7)
    assert descend(curves.circle_arc(R, R), G, 0.0).time == pytest.approx(exact, rel=3e-7)


@pytest.mark.parametrize("part", [1.0, 0.8, 0.5, 0.2, 0.02])
def test_from_anywhere_on_a_cycloid_it_takes_as_long(part: float) -> None:
    path = curves.cycloid_to_bottom(0.5, 2.0 * np.arccos(part))
    np.testing.assert_allclose(path[-1], [0.5 * np.pi, 1.0])
    assert descend(path, G, 0.0).time == pytest.approx(np.pi * np.sqrt(0.5 / G), rel=3e-7)


def test_a_bead_gets_stuck_where_its_speed_is_used_up() -> None:
    path = np.array([[0.0, 0.0], [0.0, 1.0], [9.0, 1.0]])
    descent = descend(path, G, 0.5)
    assert not descent.arrived
    assert descent.time == np.inf
    np.testing.assert_allclose(descent.points[-1], [2.0, 1.0])
    assert descent.clock[-1] == pytest.approx(np.sqrt(2.0 / G) + np.sqrt(2.0 * G) / (0.5 * G))
    assert at(descent, 99.0).speed[0] == 0.0
    np.testing.assert_allclose(at(descent, 99.0).point[0], [2.0, 1.0])


@pytest.mark.parametrize("path", [[[0.0, 0.0], [1.0, 0.2]], [[0.0, 0.0], [1.0, 0.3], [2.0, 2.0]]])
def test_what_starts_too_flat_never_leaves(path: list[list[float]]) -> None:
    descent = descend(np.array(path), G, 0.3)
    assert not descent.arrived
    now = descent.at(np.array([0.0, 5.0]))
    np.testing.assert_array_equal(now.point, 0.0)
    np.testing.assert_array_equal(now.speed, 0.0)


def test_a_bezier_curve_leaves_and_arrives_along_its_polygon() -> None:
    control = np.array([[0.0, 0.0], [0.0, 0.6], [0.5, 1.1], [1.3, 1.1], [2.0, 1.0]])
    path = curves.bezier(control)
    np.testing.assert_array_equal(path[[0, -1]], control[[0, -1]])
    start, end = path[1] - path[0], path[-1] - path[-2]
    assert start[0] / start[1] == pytest.approx(0.0, abs=1e-5)
    assert end[1] / end[0] == pytest.approx(-1.0 / 7.0, abs=1e-2)
    middle = curves.bezier(control)[round(np.sqrt(0.5) * (len(path) - 1))]
    exact = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0 @ control
    np.testing.assert_allclose(middle, exact, atol=2e-3)
