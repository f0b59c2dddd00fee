"""The integrators: measured orders, and what each does to energy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labs.algorithms.integrators import INTEGRATORS

Q0, V0 = np.array([0.8, -0.5]), np.array([0.3, 1.1])
END = 1.0


def pendula(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Two coupled pendula with quadratic drag: smooth and nonlinear in q and v."""
    return np.array(
        [
            -4.0 * np.sin(q[0]) + np.cos(q[1]) * v[1] - 0.3 * v[0] * abs(v[0]) ** 2,
            -2.0 * np.sin(q[1] - q[0]) - 0.5 * v[1] * v[0],
        ]
    )


def final(name: str, steps: int) -> np.ndarray:
    q, v = Q0, V0
    for _ in range(steps):
        q, v = INTEGRATORS[name].step(pendula, q, v, END / steps)
    return np.concatenate([q, v])


@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_measured_order_is_the_stated_one(name: str) -> None:
    exact = solve_ivp(
        lambda t, x: np.concatenate([x[2:], pendula(x[:2], x[2:])]),
        (0.0, END),
        np.concatenate([Q0, V0]),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    ).y[:, -1]
    coarse, fine = 160, 320
    errors = [np.linalg.norm(final(name, n) - exact) for n in (coarse, fine)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(INTEGRATORS[name].order, abs=0.1)


def oscillation(name: str, h: float, steps: int) -> np.ndarray:
    """(q, v) at every step of q'' = -q from q = 1, v = 0."""
    q, v, path = np.array([1.0]), np.array([0.0]), []
    for _ in range(steps):
        q, v = INTEGRATORS[name].step(lambda q, v: -q, q, v, h)
        path.append([q[0], v[0]])
    return np.array(path)


def test_explicit_euler_multiplies_the_energy_at_every_step() -> None:
    h, steps = 0.05, 400
    q, v = oscillation("explicit-euler", h, steps)[-1]
    assert q**2 + v**2 == pytest.approx((1 + h**2) ** steps, rel=1e-12)


def test_semi_implicit_euler_conserves_a_nearby_energy() -> None:
    h = 0.05
    q, v = oscillation("semi-implicit-euler", h, 40_000).T
    np.testing.assert_allclose(q**2 + v**2 - h * q * v, 1.0, rtol=1e-9)
    assert np.abs(q**2 + v**2 - 1).max() < 1.1 * h / 2


@pytest.mark.parametrize(
    ("name", "gain"),
    [("midpoint", lambda h: 1 + h**4 / 4), ("rk4", lambda h: 1 - h**6 / 72 + h**8 / 576)],
)
def test_what_runge_kutta_does_to_energy(name: str, gain: "object") -> None:
    """|R(ih)|^2 of the stability polynomial: midpoint feeds a little, RK4 takes a little."""
    h, steps = 0.2, 200
    q, v = oscillation(name, h, steps)[-1]
    assert callable(gain)
    assert q**2 + v**2 == pytest.approx(gain(h) ** steps, rel=1e-10)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_step_leaves_its_arguments_alone(name: str) -> None:
    q, v = Q0.copy(), V0.copy()
    new_q, new_v = INTEGRATORS[name].step(pendula, q, v, 0.01)
    np.testing.assert_array_equal(q, Q0)
    np.testing.assert_array_equal(v, V0)
    assert not np.shares_memory(new_q, q)
    assert not np.shares_memory(new_v, v)
