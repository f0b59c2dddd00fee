"""Discrete-time maps against the differential equation and against the integrators."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from labs.algorithms.discretisation import zero_order_hold, zero_order_hold_integrated
from labs.algorithms.equation_of_motion import mass_matrix
from labs.algorithms.integrators import INTEGRATORS
from labs.models.plant import plant


def linear_arm(friction: float) -> tuple[np.ndarray, np.ndarray]:
    """A (12, 12) and B (12, 6) of the UR5 with a payload, at rest near home."""
    world = plant("ur5", 2.0)
    model, data, home, n = world.model, world.data, world.arm.home, 6
    gravity = pin.computeGeneralizedGravityDerivatives(model, data, home).copy()
    inverse = np.linalg.inv(mass_matrix(model, data, home))
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ gravity, -friction * inverse]])
    return a, np.vstack([np.zeros((n, n)), inverse])


def test_exact_hold_is_the_ode_under_a_constant_input() -> None:
    a, b = linear_arm(friction=1.0)
    phi, gamma = zero_order_hold(a, b, 0.01)
    rng = np.random.default_rng(1)
    x, u = rng.normal(size=len(a)), rng.normal(size=b.shape[1])
    ode = solve_ivp(lambda t, x: a @ x + b @ u, (0, 0.01), x, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(phi @ x + gamma @ u, ode.y[:, -1], rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_integrators_map_is_what_the_integrator_does(name: str) -> None:
    a, b = linear_arm(friction=3.0)
    n = b.shape[1]
    rng = np.random.default_rng(1)
    q, v, u = rng.normal(size=(3, n))
    phi, gamma = zero_order_hold_integrated(name, 2e-3, a, b, 0.01)
    expected = phi @ np.concatenate([q, v]) + gamma @ u
    for _ in range(5):
        q, v = INTEGRATORS[name].step(
            lambda q, v: a[n:] @ np.concatenate([q, v]) + b[n:] @ u, q, v, 2e-3
        )
    np.testing.assert_allclose(np.concatenate([q, v]), expected, rtol=1e-10, atol=1e-10)
