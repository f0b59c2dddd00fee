"""Mechanisms: the cart-pole's closed form, driven joints, and every derivative by differences."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from labs.algorithms.integrators import INTEGRATORS
from labs.errors import LabError
from labs.models import cart_pole
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import MECHANISMS, Mechanism, mechanism

G = 9.81


def points(m: Mechanism, many: int = 4) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    return rng.normal(size=(many, m.nx)), 5.0 * rng.normal(size=(many, m.nu))


def differences(f: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """df/dat by central differences."""
    step = 1e-6
    columns = [(f(at + step * e) - f(at - step * e)) / (2 * step) for e in np.eye(len(at))]
    return np.stack(columns, axis=-1)


def test_the_cart_pole_obeys_the_equations_of_its_docstring() -> None:
    m = mechanism("cart-pole")
    M, mass, l = cart_pole.CART_MASS, cart_pole.POLE_MASS, cart_pole.POLE_LENGTH / 2  # noqa: E741
    inertia = mass * (cart_pole.POLE_LENGTH**2 / 12 + cart_pole.POLE_RADIUS**2 / 4)
    X, U = points(m)
    for (_, theta, _, w), (u,) in zip(X, U, strict=True):
        left = np.array(
            [
                [M + mass, mass * l * np.cos(theta)],
                [mass * l * np.cos(theta), inertia + mass * l**2],
            ]
        )
        right = [u + mass * l * w**2 * np.sin(theta), -mass * G * l * np.sin(theta)]
        found = m.f(np.array([0.3, theta, -0.7, w]), np.array([u]))
        np.testing.assert_allclose(found, [-0.7, w, *np.linalg.solve(left, right)], rtol=1e-9)


@pytest.mark.parametrize(("name", "driven"), [("acrobot", 1), ("pendubot", 0), ("cart-pole", 0)])
def test_only_the_driven_joint_feels_the_control(name: str, driven: int) -> None:
    m = mechanism(name)
    x, u = np.array([0.4, -1.0, 0.2, 0.5]), np.array([2.0])
    tau = np.zeros(2)
    tau[driven] = 2.0
    whole = Mechanism("both", m.plant, (0, 1), 0.0)
    np.testing.assert_array_equal(m.f(x, u), whole.f(x, tau))
    np.testing.assert_array_equal(m.S[:, 0], np.eye(2)[driven])


@pytest.mark.parametrize("name", MECHANISMS)
@pytest.mark.parametrize(("payload", "friction"), [(0.0, 0.0), (0.7, 0.4)])
def test_derivatives_are_those_of_finite_differences(
    name: str, payload: float, friction: float
) -> None:
    m = mechanism(name, payload, friction)
    X, U = points(m)
    f, f_x, f_u = m.derivatives(X, U)
    for i, (x, u) in enumerate(zip(X, U, strict=True)):
        np.testing.assert_allclose(f[i], m.f(x, u), rtol=1e-12, atol=1e-12)
        by_x = differences(lambda at, u=u: m.f(at, u), x)  # type: ignore[misc]
        by_u = differences(lambda at, x=x: m.f(x, at), u)  # type: ignore[misc]
        np.testing.assert_allclose(f_x[i], by_x, atol=1e-6 * np.abs(by_x).max())
        np.testing.assert_allclose(f_u[i], by_u, atol=1e-6 * np.abs(by_u).max())


@pytest.mark.parametrize("method", INTEGRATORS)
@pytest.mark.parametrize("name", ["pendulum", "acrobot", "cart-pole", "ur5"])
def test_sensitivities_are_those_of_finite_differences(name: str, method: str) -> None:
    d = DiscreteMechanism(mechanism(name, 0.3, 0.2), 0.03, method)
    X, U = points(d.mechanism)
    after, A, B = d.linearize(X, U)
    for i, (x, u) in enumerate(zip(X, U, strict=True)):
        np.testing.assert_allclose(after[i], d.step(x, u), rtol=1e-12, atol=1e-12)
        by_x = differences(lambda at, u=u: d.step(at, u), x)  # type: ignore[misc]
        by_u = differences(lambda at, x=x: d.step(x, at), u)  # type: ignore[misc]
        np.testing.assert_allclose(A[i], by_x, atol=1e-6 * np.abs(by_x).max())
        np.testing.assert_allclose(B[i], by_u, atol=1e-6 * np.abs(by_u).max())


def test_a_rollout_repeats_steps() -> None:
    d = DiscreteMechanism(mechanism("cart-pole"), 0.02, "rk4")
    U = np.array([[1.0], [-2.0], [0.5]])
    X = d.rollout(np.array([0.0, 0.1, 0.0, 0.0]), U)
    for t in range(3):
        np.testing.assert_array_equal(X[t + 1], d.step(X[t], U[t]))


def test_what_holds_a_posture_holds_it() -> None:
    m = mechanism("ur5", payload=1.5)
    q = m.arm.home
    x = np.concatenate([q, np.zeros(6)])
    np.testing.assert_allclose(m.f(x, m.equilibrium_control(q)), np.zeros(12), atol=1e-9)
    upright = mechanism("cart-pole")
    np.testing.assert_allclose(
        upright.equilibrium_control(np.array([0.0, np.pi])), [0.0], atol=1e-9
    )


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_tips_jacobian_is_that_of_finite_differences(name: str) -> None:
    mech = mechanism(name)
    q, v = mech.arm.home + 0.3, np.linspace(0.4, 1.0, mech.nq)
    moved = (mech.tip(q + 1e-6 * v) - mech.tip(q - 1e-6 * v)) / 2e-6
    assert mech.tip_jacobian(q).shape == (3, mech.nq)
    np.testing.assert_allclose(mech.tip_jacobian(q) @ v, moved, atol=1e-8)


def test_tips_follow_a_trajectory() -> None:
    path = mechanism("pendulum").tip_positions(np.array([[0.0, 9.0], [np.pi, 9.0]]))
    np.testing.assert_allclose(path, [[0.0, 0.0, 0.25], [0.0, 0.0, 1.25]], atol=1e-12)


def test_what_cannot_be_is_said() -> None:
    with pytest.raises(LabError, match=r"acrobot cannot rest .* joint 1, which has no motor"):
        mechanism("acrobot").equilibrium_control(np.array([0.5, 0.0]))
    with pytest.raises(LabError, match=r"no mechanism is named 'unicycle'; there are pendulum"):
        mechanism("unicycle")
    with pytest.raises(LabError, match=r"no method is named 'rk9'; there are explicit-euler"):
        DiscreteMechanism(mechanism("pendulum"), 0.1, "rk9")
    with pytest.raises(LabError, match=r"h = 0.0: a step takes a positive time"):
        DiscreteMechanism(mechanism("pendulum"), 0.0)


@pytest.mark.parametrize("name", MECHANISMS)
def test_an_impulse_is_a_strong_force_for_a_short_time(name: str) -> None:
    moved = mechanism(name, 0.3)
    q, impulse, short = moved.arm.home + 0.4, np.array([0.2, 0.5, -0.3]), 1e-8
    torque = moved.tip_jacobian(q).T @ impulse / short
    change = short * pin.aba(moved.model, moved.data, q, np.zeros(moved.nq), torque)
    np.testing.assert_allclose(moved.velocity_jump(q, impulse), change, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", MECHANISMS)
def test_a_force_on_the_tip_acts_beside_the_control(name: str) -> None:
    """As the torque J' f, which may act where no motor does."""
    moved, rng = mechanism(name, 0.3, 0.2), np.random.default_rng(5)
    q, v = moved.arm.home + 0.4, rng.normal(size=moved.nq)
    u, force = rng.normal(size=moved.nu), np.array([0.2, 0.5, -0.3])
    tau = moved.S @ u - 0.2 * v + moved.tip_jacobian(q).T @ force
    expected = pin.aba(moved.model, moved.data, q, v, tau)
    found = moved.acceleration(u, lambda tip: force)(q, v)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
