"""Systems of the plane: what is simulated in a formula, by Pinocchio, and near a rest."""

import numpy as np
import pytest
from scipy.linalg import expm

from labs.algorithms.integrators import rk4
from labs.errors import LabError
from labs.models.mechanisms import mechanism
from labs.tasks.phase_plane.systems import PLANE_SYSTEMS, SIMULATION_STEP, plane_system

RNG = np.random.default_rng(12)


@pytest.mark.parametrize("name", ["cart", "unstable", "joint"])
def test_the_formula_moves_as_the_body_does(name: str) -> None:
    system = plane_system(name)
    body = mechanism(system.body)
    for _ in range(5):
        x, u = RNG.normal(size=2), RNG.normal(size=1)
        q, v = system.pose(x), x[1:]
        for _ in range(3):
            q, v = rk4(body.acceleration(u), q, v, SIMULATION_STEP)
        after = system.step(x, u, 3 * SIMULATION_STEP)
        np.testing.assert_allclose(system.pose(after), q, atol=1e-12)
        np.testing.assert_allclose(after[1:], v, atol=1e-11)
        np.testing.assert_allclose(
            system.holding(x[0]), body.equilibrium_control(system.pose(x)), atol=1e-12
        )


@pytest.mark.parametrize("name", PLANE_SYSTEMS)
def test_many_states_step_as_each_does(name: str) -> None:
    system = plane_system(name)
    X, U = RNG.normal(size=(3, 4, 2)), RNG.normal(size=(3, 4, 1))
    each = [
        [system.step(x, u, 0.1) for x, u in zip(*row, strict=True)]
        for row in zip(X, U, strict=True)
    ]
    np.testing.assert_allclose(system.step(X, U, 0.1), each, rtol=1e-13)


@pytest.mark.parametrize("name", PLANE_SYSTEMS)
def test_it_rests_and_is_linear_nearby(name: str) -> None:
    system = plane_system(name)
    x, u = np.array(system.x_eq), np.array([system.u_eq])
    np.testing.assert_allclose(system.step(x, u, 0.1), x, atol=1e-12)
    A, B, c = system.linear(0.1)
    np.testing.assert_allclose(A @ x + B @ u + c, x, atol=1e-12)
    d = 1e-6
    by_x = [
        (system.step(x + e, u, 0.1) - system.step(x - e, u, 0.1)) / (2 * d) for e in d * np.eye(2)
    ]
    by_u = (system.step(x, u + d, 0.1) - system.step(x, u - d, 0.1)) / (2 * d)
    np.testing.assert_allclose(A, np.transpose(by_x), atol=1e-8)
    np.testing.assert_allclose(B[:, 0], by_u, atol=1e-8)
    by_q, by_v = system.acceleration_gradients(x[0])
    exact = expm(0.1 * np.array([[0, 1, 0], [by_q, by_v, system.input_gain], [0, 0, 0]]))
    np.testing.assert_allclose(np.hstack([A, B]), exact[:2], atol=1e-7)


def test_of_the_cart_it_is_the_double_integrator() -> None:
    A, B, c = plane_system("cart").linear(0.2)
    np.testing.assert_allclose(A, [[1.0, 0.2], [0.0, 1.0]], atol=1e-15)
    np.testing.assert_allclose(B, [[0.02], [0.2]], atol=1e-15)
    assert not c.any()


def test_a_joint_rests_wherever_it_is_held() -> None:
    joint = plane_system("joint").resting_at(0.7)
    assert joint.x_eq == (0.7, 0.0)
    assert joint.u_eq == pytest.approx(2.0 * 9.81 * 0.25 * np.sin(0.7))
    x = np.array(joint.x_eq)
    np.testing.assert_allclose(joint.step(x, np.array([joint.u_eq]), 1.0), x, atol=1e-12)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(LabError, match="'carriage'; there are cart"):
        plane_system("carriage")
    with pytest.raises(LabError, match="whole steps"):
        plane_system("cart").linear(0.015)
