"""One step of q'' = a(q, v) with v = q', by four explicit methods (notes, A.1).

Written for x = (q, v), x' = f(x) = (v, a(q, v)), the notes' methods read

    explicit Euler   x+ = x + h f(x)                                    order 1
    midpoint         x+ = x + h f(x + h/2 f(x))                         order 2
    RK4              x+ = x + h/6 (k1 + 2 k2 + 2 k3 + k4)               order 4

and one that treats q and v apart, the common choice for mechanisms (not in the notes):

    semi-implicit    v+ = v + h a(q, v),  q+ = q + h v+                 order 1

Semi-implicit Euler costs what explicit Euler costs, but without friction it keeps an
oscillation's energy bounded where explicit Euler feeds it at every step. The order is that of
the global error at a fixed time, O(h^order) for smooth a. The torque is held during a step, so
a(q, v) does not depend on time. Every q of these labs is a vector of joint angles, so q + h v
is the integration on the configuration space.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

Acceleration = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""a(q, v): (nq,) [rad], (nv,) [rad/s] to (nv,) [rad/s^2]."""

Duration = float | np.ndarray
"""h [s]: a number, or that number nv times in an array, which NumPy multiplies faster."""

IntegratorStep = Callable[
    [Acceleration, np.ndarray, np.ndarray, Duration], tuple[np.ndarray, np.ndarray]
]
"""(a, q, v, h) to (q+, v+), as new arrays."""


def explicit_euler(
    a: Acceleration, q: np.ndarray, v: np.ndarray, h: Duration
) -> tuple[np.ndarray, np.ndarray]:
    """x+ = x + h f(x). Order 1, one evaluation (A.1.1)."""
    return q + h * v, v + h * a(q, v)


def semi_implicit_euler(
    a: Acceleration, q: np.ndarray, v: np.ndarray, h: Duration
) -> tuple[np.ndarray, np.ndarray]:
    """v+ = v + h a(q, v), q+ = q + h v+. Order 1, one evaluation; symplectic when a is the
    acceleration of a potential."""
    v = v + h * a(q, v)
    return q + h * v, v


def midpoint(
    a: Acceleration, q: np.ndarray, v: np.ndarray, h: Duration
) -> tuple[np.ndarray, np.ndarray]:
    """x+ = x + h f(x + h/2 f(x)). Order 2, two evaluations (A.1.2)."""
    v_mid = v + 0.5 * h * a(q, v)
    return q + h * v_mid, v + h * a(q + 0.5 * h * v, v_mid)


def rk4(
    a: Acceleration, q: np.ndarray, v: np.ndarray, h: Duration
) -> tuple[np.ndarray, np.ndarray]:
    """The classical Runge-Kutta method. Order 4, four evaluations (A.1.3)."""
    half = 0.5 * h
    a1 = a(q, v)
    v2 = v + half * a1
    a2 = a(q + half * v, v2)
    v3 = v + half * a2
    a3 = a(q + half * v2, v3)
    v4 = v + h * a3
    a4 = a(q + h * v3, v4)
    sixth = h / 6.0
    return q + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (a1 + 2.0 * (a2 + a3) + a4)


@dataclass(frozen=True)
class Integrator:
    """A method with what is known of it."""

    title: str
    order: int
    step: IntegratorStep


INTEGRATORS: Mapping[str, Integrator] = {
    "explicit-euler": Integrator("Explicit Euler", 1, explicit_euler),
    "semi-implicit-euler": Integrator("Semi-implicit Euler", 1, semi_implicit_euler),
    "midpoint": Integrator("Midpoint", 2, midpoint),
    "rk4": Integrator("Runge-Kutta 4", 4, rk4),
}
