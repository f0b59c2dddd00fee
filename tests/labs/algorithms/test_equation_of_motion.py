"""The equation of motion: energies, Christoffel symbols, a closed form, two inverse problems."""

import numpy as np
import pinocchio as pin
import pytest

from labs.algorithms.equation_of_motion import (
    EquationTerms,
    direct_dynamics,
    equation_terms,
    inverse_dynamics,
    mass_matrix,
)
from labs.models.plant import Plant, plant

ROBOTS = ("ur5", "panda", "double-pendulum")
every_robot = pytest.mark.parametrize("robot", ROBOTS)


def states(robot: str, count: int = 5) -> list[tuple[Plant, np.ndarray, np.ndarray]]:
    """An arm with a payload in random states."""
    world, rng = plant(robot, 1.5), np.random.default_rng(7)
    n = world.model.nv
    return [(world, rng.uniform(-2, 2, n), rng.uniform(-2, 2, n)) for _ in range(count)]


def of(world: Plant, q: np.ndarray, v: np.ndarray) -> EquationTerms:
    return equation_terms(world.model, world.data, q, v)


def kinetic(world: Plant, q: np.ndarray, v: np.ndarray) -> float:
    """Body by body: half of twist . inertia . twist, and the rotors."""
    model, data = world.model, world.model.createData()
    pin.forwardKinematics(model, data, q, v)
    bodies = sum(
        0.5 * data.v[j].vector @ (model.inertias[j].matrix() @ data.v[j].vector)
        for j in range(1, model.njoints)
    )
    return float(bodies + 0.5 * model.armature @ v**2)


def mass_slopes(world: Plant, q: np.ndarray, d: float = 1e-5) -> np.ndarray:
    """dM/dq_k by central differences, (k, i, j)."""
    n = len(q)
    v = np.zeros(n)
    return np.array(
        [(of(world, q + d * e, v).mass - of(world, q - d * e, v).mass) / (2 * d) for e in np.eye(n)]
    )


@every_robot
def test_mass_is_the_hessian_of_the_kinetic_energy(robot: str) -> None:
    """T is quadratic in v, so M_ij = T(e_i + e_j) - T(e_i) - T(e_j) without any step."""
    for world, q, v in states(robot):
        n = len(q)
        unit = np.eye(n)
        alone = [kinetic(world, q, e) for e in unit]
        hessian = np.array(
            [
                [kinetic(world, q, unit[i] + unit[j]) - alone[i] - alone[j] for j in range(n)]
                for i in range(n)
            ]
        )
        np.testing.assert_allclose(of(world, q, v).mass, hessian, rtol=1e-12, atol=1e-12)


@every_robot
def test_mass_is_symmetric_and_positive_definite(robot: str) -> None:
    for world, q, v in states(robot):
        mass = of(world, q, v).mass
        np.testing.assert_array_equal(mass, mass.T)
        assert np.linalg.eigvalsh(mass)[0] > 0.01
        np.linalg.cholesky(mass)


@every_robot
def test_coriolis_is_that_of_christoffel(robot: str) -> None:
    """C_ij = sum_k (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) v_k / 2."""
    for world, q, v in states(robot):
        slopes = mass_slopes(world, q)
        symbols = 0.5 * (
            np.einsum("kij->ijk", slopes)
            + np.einsum("jik->ijk", slopes)
            - np.einsum("ijk->ijk", slopes)
        )
        expected = symbols @ v
        found = of(world, q, v).coriolis
        np.testing.assert_allclose(found @ v, expected @ v, atol=1e-8)
        np.testing.assert_allclose(found, expected, atol=1e-8)


@every_robot
def test_mass_rate_minus_twice_coriolis_is_skew(robot: str) -> None:
    for world, q, v in states(robot):
        rate = np.einsum("kij,k->ij", mass_slopes(world, q), v)
        defect = rate - 2 * of(world, q, v).coriolis
        np.testing.assert_allclose(defect, -defect.T, atol=1e-8)
        assert np.abs(rate).max() > 1e-2


@every_robot
def test_gravity_is_the_slope_of_the_potential_energy(robot: str) -> None:
    d = 1e-5
    for world, q, v in states(robot):
        slope = [
            (world.energy(q + d * e, v)[1] - world.energy(q - d * e, v)[1]) / (2 * d)
            for e in np.eye(len(q))
        ]
        np.testing.assert_allclose(of(world, q, v).gravity, slope, atol=1e-7)


@every_robot
def test_bias_is_the_torque_of_no_acceleration(robot: str) -> None:
    for world, q, v in states(robot):
        h = of(world, q, v).bias(v)
        still = inverse_dynamics(world.model, world.data, q, v, np.zeros(len(q)))
        np.testing.assert_allclose(h, still, rtol=1e-12, atol=1e-12)


@every_robot
def test_the_two_problems_undo_one_another(robot: str) -> None:
    rng = np.random.default_rng(3)
    for world, q, v in states(robot):
        model, data = world.model, world.data
        a, tau = rng.uniform(-10, 10, (2, len(q)))
        there = inverse_dynamics(model, data, q, v, a)
        np.testing.assert_allclose(direct_dynamics(model, data, q, v, there), a, rtol=0, atol=1e-10)
        back = direct_dynamics(model, data, q, v, tau)
        np.testing.assert_allclose(
            inverse_dynamics(model, data, q, v, back), tau, rtol=0, atol=1e-10
        )
        found = of(world, q, v)
        np.testing.assert_allclose(found.mass @ back + found.bias(v), tau, rtol=0, atol=1e-10)


def test_the_double_pendulum_in_closed_form() -> None:
    """Two uniform rods; q = 0 hangs, the second angle is relative to the first rod."""
    length, m, radius, g0 = 0.5, 2.0, 0.03, 9.81
    c = length / 2
    inertia = m * (3 * radius**2 + length**2) / 12
    world = plant("double-pendulum")
    rng = np.random.default_rng(1)
    for q, v in rng.uniform(-3, 3, (5, 2, 2)):
        coupling = m * length * c
        m22 = inertia + m * c**2
        m12 = m22 + coupling * np.cos(q[1])
        m11 = 2 * inertia + m * (2 * c**2 + length**2) + 2 * coupling * np.cos(q[1])
        s = coupling * np.sin(q[1])
        found = of(world, q, v)
        np.testing.assert_allclose(found.mass, [[m11, m12], [m12, m22]], rtol=1e-12)
        coriolis = [[-s * v[1], -s * (v[0] + v[1])], [s * v[0], 0.0]]
        np.testing.assert_allclose(found.coriolis, coriolis, atol=1e-12)
        second = m * g0 * c * np.sin(q[0] + q[1])
        first = m * g0 * (c + length) * np.sin(q[0]) + second
        np.testing.assert_allclose(found.gravity, [first, second], rtol=1e-12)


def test_what_is_returned_is_no_workspace() -> None:
    (world, q, v), (_, other, _) = states("ur5", 2)
    model, data = world.model, world.data
    first, a = of(world, q, v), direct_dynamics(model, data, q, v, v)
    tau = inverse_dynamics(model, data, q, v, v)
    kept = [x.copy() for x in (first.mass, first.coriolis, first.gravity, a, tau)]
    (
        of(world, other, q),
        direct_dynamics(model, data, other, q, q),
        inverse_dynamics(model, data, other, q, q),
    )
    for one, same in zip((first.mass, first.coriolis, first.gravity, a, tau), kept, strict=True):
        np.testing.assert_array_equal(one, same)


@every_robot
def test_the_mass_matrix_is_symmetric_and_positive(robot: str) -> None:
    model = plant(robot).model
    q = np.random.default_rng(3).normal(size=model.nq)
    mass = mass_matrix(model, model.createData(), q)
    np.testing.assert_array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass)[0] > 0
