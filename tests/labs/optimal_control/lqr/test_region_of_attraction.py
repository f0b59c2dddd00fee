"""Verdicts on where a policy recovers, against the mechanisms' own dynamics."""

import numpy as np
import pytest

from labs.optimal_control.lqr.linear_systems import SIMULATION_STEP, linear_system
from labs.optimal_control.lqr.region_of_attraction import (
    SMALL_ANGLE,
    SYSTEM_CODES,
    TIME_LIMIT,
    RegulatedSystem,
    grid_axes,
    state_derivative,
)
from labs.optimal_control.lqr.regulator import RegulatorSettings, regulator

WEIGHTS = (10.0, 10.0, 1.0, 1.0)


def loop(
    system: str, limit: float = np.inf, policy: str = "steady", n: int = 80
) -> RegulatedSystem:
    law = regulator(RegulatorSettings(system, 0.02, WEIGHTS, 0.1, n, "q", 0.0, policy))
    return RegulatedSystem(system, 0.02, law.gains[:, 0], limit)


@pytest.mark.parametrize("name", SYSTEM_CODES)
def test_the_closed_form_is_the_mechanism(name: str) -> None:
    rng = np.random.default_rng(2)
    mechanism = linear_system(name).mechanism
    for _ in range(20):
        x, u = rng.normal(size=mechanism.nx) * 3.0, rng.normal(size=1) * 5.0
        np.testing.assert_allclose(state_derivative(name, x, u[0]), mechanism.f(x, u), atol=1e-11)


def is_recovered(closed: RegulatedSystem, dx: np.ndarray) -> bool:
    """By the simulation of the scene: within reach all the time, and at rest in the end."""
    system = linear_system(closed.system)
    x, u = system.x_eq + dx, np.zeros(1)
    for step in range(round(TIME_LIMIT / SIMULATION_STEP)):
        tick, between = divmod(step, round(closed.period / SIMULATION_STEP))
        if not between:
            gain = closed.gains[tick % len(closed.gains)]
            u = np.clip(gain @ (x - system.x_eq), -closed.limit, closed.limit)[None]
        x = system.step(x, u)
        if system.out_of_range(x):
            return False
    return bool(np.abs(x - system.x_eq).max() < SMALL_ANGLE)


@pytest.mark.parametrize(
    ("system", "limit", "policy", "n"),
    [
        ("cart-pole", 10.0, "steady", 80),
        ("cart-pole", np.inf, "window", 80),
        ("pendulum", 4.0, "steady", 80),
        ("mass", 2.0, "receding", 30),
    ],
)
def test_verdicts_are_those_of_the_simulation(
    system: str, limit: float, policy: str, n: int
) -> None:
    closed = loop(system, limit, policy, n)
    places, speeds = grid_axes(system)
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.choice(places, 12), rng.choice(speeds, 12)])
    found = closed.recovers(closed.from_phase_plane(points))
    expected = [is_recovered(closed, dx) for dx in closed.from_phase_plane(points)]
    assert found.tolist() == expected
    assert 0 < found.sum() < 12, "both kinds were asked for"


def test_the_ellipsoid_keeps_its_promises() -> None:
    """Started on its surface, no angle exceeds SMALL_ANGLE, no control exceeds its limit, and
    the linear loop never leaves it."""
    closed = loop("cart-pole", limit=3.0)
    shape, level = closed.invariant_ellipsoid()
    system, transition = linear_system("cart-pole"), closed.transition()[1]
    rng = np.random.default_rng(0)
    for _ in range(50):
        dx = rng.normal(size=4)
        dx *= np.sqrt(level / (dx @ shape @ dx))
        assert abs(dx[1]) <= SMALL_ANGLE + 1e-12
        assert abs(dx[0]) <= system.half_rail
        assert abs(closed.gains[0] @ dx) <= 3.0 + 1e-9
        after = transition @ dx
        assert after @ shape @ after < level
        assert is_recovered(closed, dx)


def test_an_unstable_loop_recovers_from_nowhere() -> None:
    """Half a second of horizon, let go of at its end, does not hold the pole."""
    closed = loop("cart-pole", policy="window", n=25)
    assert closed.invariant_ellipsoid()[1] == -1.0
    assert not closed.recovers(np.zeros((3, 4))).any()
    assert closed.largest_recoverable_deviation() == 0.0


def test_the_largest_recoverable_deviation_is_the_edge() -> None:
    closed = loop("cart-pole", limit=10.0)
    edge = closed.largest_recoverable_deviation()
    inside, outside = closed.from_phase_plane(np.array([[edge, 0.0], [edge + 0.001, 0.0]]))
    assert is_recovered(closed, inside)
    assert not is_recovered(closed, outside)


def test_a_motor_strong_enough_brings_a_pendulum_back_from_anywhere() -> None:
    assert loop("pendulum").largest_recoverable_deviation() == np.pi


def test_rollouts_do_not_depend_on_their_company() -> None:
    closed = loop("cart-pole", limit=10.0)
    points = closed.from_phase_plane(np.array([[0.5, 0.0], [0.55, 0.0], [0.1, 1.0]]))
    together = closed.recovers(points)
    assert [bool(closed.recovers(p[None])[0]) for p in points] == together.tolist()
