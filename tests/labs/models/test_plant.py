"""The plant: payload, friction and force against formulas that do not use its code."""

import numpy as np
import pinocchio as pin
import pytest

from labs.models.arms import ARMS, load_arm
from labs.models.plant import plant

FORCE = np.array([3.0, -20.0, 11.0])


@pytest.fixture(params=list(ARMS))
def robot(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def at(robot: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    home = load_arm(robot).home
    q, v, tau = rng.normal(size=(3, len(home)))
    return home + 0.3 * q, v, 5.0 * tau


def drifting_acceleration(robot: str, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """J' v: the tip's acceleration when q'' = 0, by central differences of J."""
    world, d = plant(robot), 1e-6
    ahead, behind = world.tip_jacobian(q + d * v), world.tip_jacobian(q - d * v)
    drift: np.ndarray = (ahead - behind) @ v / (2 * d)
    return drift


def test_a_payload_is_a_point_mass_at_the_tip(robot: str) -> None:
    """(M + m J'J) q'' + h + m J'(J' v - gravity) = tau, from the model without payload."""
    q, v, tau = at(robot)
    arm, payload = load_arm(robot), 3.7
    data = arm.model.createData()
    mass = pin.crba(arm.model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    h = pin.nonLinearEffects(arm.model, data, q, v)
    j = plant(robot).tip_jacobian(q)
    gravity = np.array([0.0, 0.0, -9.81])
    load_torque = payload * j.T @ (drifting_acceleration(robot, q, v) - gravity)
    expected = np.linalg.solve(mass + payload * j.T @ j, tau - h - load_torque)
    found = plant(robot, payload).acceleration(tau)(q, v)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_friction_and_force_are_torques(robot: str) -> None:
    q, v, tau = at(robot)
    world = plant(robot)
    j = world.tip_jacobian(q)
    expected = world.acceleration(tau - 4.0 * v + j.T @ FORCE)(q, v)
    found = world.acceleration(tau, 4.0, lambda tip: FORCE)(q, v)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(
        world.acceleration(tau, 4.0)(q, v), world.acceleration(tau - 4.0 * v)(q, v)
    )


def test_a_force_sees_where_the_tip_is(robot: str) -> None:
    q, v, tau = at(robot)
    world = plant(robot)
    seen: list[np.ndarray] = []

    def force(tip: np.ndarray) -> np.ndarray:
        seen.append(tip)
        return FORCE

    world.acceleration(tau, 0.0, force)(q, v)
    np.testing.assert_array_equal(seen[0], world.tip(q))


def test_the_jacobian_is_the_tips_derivative(robot: str) -> None:
    q, v, _ = at(robot)
    world, d = plant(robot), 1e-6
    velocity = (world.tip(q + d * v) - world.tip(q - d * v)) / (2 * d)
    np.testing.assert_allclose(world.tip_jacobian(q) @ v, velocity, atol=1e-8)


def test_power_balance(robot: str) -> None:
    """dE/dt = tau v - b v'v + f (J v), with the payload's energy in E."""
    q, v, tau = at(robot)
    world, b, d = plant(robot, 2.0), 1.5, 1e-6
    a = world.acceleration(tau, b, lambda tip: FORCE)(q, v)

    def energy(t: float) -> float:
        return sum(world.energy(q + t * v + 0.5 * t**2 * a, v + t * a))

    power = tau @ v - b * v @ v + FORCE @ (world.tip_jacobian(q) @ v)
    assert (energy(d) - energy(-d)) / (2 * d) == pytest.approx(power, rel=1e-6)


def test_the_held_torque_may_be_rewritten(robot: str) -> None:
    q, v, tau = at(robot)
    held = np.zeros_like(tau)
    acceleration = plant(robot).acceleration(held)
    held[:] = tau
    np.testing.assert_array_equal(acceleration(q, v), plant(robot).acceleration(tau)(q, v))
