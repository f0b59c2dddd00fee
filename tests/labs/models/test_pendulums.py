"""The pendulums: closed forms, derivatives by finite differences, energy."""

import numpy as np
import pinocchio as pin
import pytest

from labs.models.arms import double_pendulum
from labs.models.pendulums import ROD_LENGTH, ROD_MASS, ROD_RADIUS, pendulum, pendulum_arm

G = 9.81


def test_one_rod_obeys_the_equation_of_the_docstring() -> None:
    for q, v, b in ((0.7, -1.3, 0.0), (2.5, 4.0, 0.8)):
        inertia = ROD_MASS * (ROD_LENGTH**2 / 3 + ROD_RADIUS**2 / 4)  # the rod has a radius
        wanted = -(ROD_MASS * G * ROD_LENGTH / 2 * np.sin(q) + b * v) / inertia
        found = pendulum(1, b).f(np.array([q, v]), 0.0)
        np.testing.assert_allclose(found, [v, wanted], rtol=1e-12)
        slender = -3 * G / (2 * ROD_LENGTH) * np.sin(q) - 3 * b / (ROD_MASS * ROD_LENGTH**2) * v
        assert wanted == pytest.approx(slender, rel=2e-3)


def test_two_rods_obey_lagrange() -> None:
    """M q'' + h = -b q' with M and h by Pinocchio's other algorithms."""
    p = pendulum(2, 0.3)
    rng = np.random.default_rng(0)
    for x in rng.normal(size=(5, 4)):
        q, v = x[:2], x[2:]
        mass = pin.crba(p.model, p.model.createData(), q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        h = pin.nonLinearEffects(p.model, p.model.createData(), q, v)
        np.testing.assert_allclose(mass @ p.acceleration(q, v) + h, -0.3 * v, atol=1e-11)


@pytest.mark.parametrize("rods", [1, 2])
def test_derivatives_are_those_of_finite_differences(rods: int) -> None:
    p = pendulum(rods, 0.4)
    for x in np.random.default_rng(1).normal(size=(5, 2 * rods)):
        step = 1e-6
        columns = [
            (p.f(x + step * d, 0.0) - p.f(x - step * d, 0.0)) / (2 * step) for d in np.eye(2 * rods)
        ]
        np.testing.assert_allclose(p.jacobian(x, 0.0), np.array(columns).T, atol=2e-7)


@pytest.mark.parametrize("rods", [1, 2])
def test_friction_takes_exactly_its_power(rods: int) -> None:
    """dE/dt = -b |q'|^2, and none without friction."""
    for b in (0.0, 0.7):
        p = pendulum(rods, b)
        for x in np.random.default_rng(2).normal(size=(3, 2 * rods)):
            step = 1e-6
            slope = p.f(x, 0.0)
            power = (p.energy(x + step * slope) - p.energy(x - step * slope)) / (2 * step)
            assert power == pytest.approx(-b * x[rods:] @ x[rods:], abs=1e-7)
    assert pendulum(rods).energy(np.zeros(2 * rods)) == 0.0


def test_eigenvalues_are_the_small_swings() -> None:
    omega = np.sqrt(
        ROD_MASS * G * ROD_LENGTH / 2 / (ROD_MASS * (ROD_LENGTH**2 / 3 + ROD_RADIUS**2 / 4))
    )
    np.testing.assert_allclose(sorted(pendulum(1).eigenvalues.imag), [-omega, omega], rtol=1e-12)
    damped = pendulum(2, 0.5).eigenvalues
    assert damped.real.max() < 0.0
    assert np.iscomplexobj(pendulum(1, 5.0).eigenvalues)


def test_it_hangs_where_it_is_put_and_swings_as_anywhere() -> None:
    place = pendulum_arm(2, (0.3, -0.4))
    data = place.model.createData()
    pin.framesForwardKinematics(place.model, data, np.array([np.pi / 2, 0.0]))
    np.testing.assert_allclose(
        data.oMf[place.tip].translation,
        [0.3, -0.4 + 2 * ROD_LENGTH, 0.25 + 2 * ROD_LENGTH],
        atol=1e-12,
    )
    assert pendulum_arm(2, (0.3, -0.4)) is place
    x = np.array([0.4, -0.9, 1.0, 2.0])
    wanted = pendulum(2).acceleration(x[:2], x[2:])
    found = pin.aba(place.model, data, x[:2], x[2:], np.zeros(2))
    np.testing.assert_allclose(found, wanted, atol=1e-12)
    # The double pendulum of the other labs turns the same way.
    other = double_pendulum()
    assert other.model.joints[1].shortname() == place.model.joints[1].shortname()
