"""Systems with a plane of states, x = (q, v), for the labs of MPC (notes, 2.5) and of Lyapunov
functions (B.1): everything about them can be drawn.

    q' = v,    v' = a(q, v, u),    u held over a period T:    x+ = f(x, u)

f is T/h steps of RK4 with h = 10 ms; for the cart, which is linear, that is exact:
A = [1 T; 0 1], B = [T^2/2; T]/m. Near a rest a(q_eq, 0, u_eq) = 0,

    x+ = A x + B u + c + O(|x - x_eq|^2),    c = x_eq - A x_eq - B u_eq
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from labs.algorithms.discretisation import linear_step, repeat_held
from labs.algorithms.integrators import rk4
from labs.errors import LabError
from labs.models.arms import Arm
from labs.models.mass_on_a_line import BLOCK_MASS, mass_on_a_line
from labs.models.pendulums import ROD_LENGTH, ROD_RADIUS, pendulum_arm
from labs.models.pendulums import ROD_MASS as ROD
from labs.shapes import BLUE, Vector3

SIMULATION_STEP = 0.01
"""h [s]"""
GRAVITY = 9.81
"""[m/s^2]"""
INERTIA = ROD * (ROD_LENGTH**2 / 3.0 + ROD_RADIUS**2 / 4.0)
"""[kg m^2] of a rod about its hinge."""
GRAVITY_TORQUE = 0.5 * ROD * GRAVITY * ROD_LENGTH
"""[N m] that holds a rod level."""
HALF_AMPLITUDE = 0.5
"""[m] beyond which the oscillator's damper pushes; its limit cycle reaches about twice as far."""

ForcedAcceleration = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""q, v, u, each (...), to a (...)."""


@dataclass(frozen=True, eq=False)
class PlaneSystem:
    """A system of the plane, a rest of it, and its natural limits."""

    name: str
    title: str
    body: str
    """What moves: "mass" or "pendulum"."""
    acceleration: ForcedAcceleration
    acceleration_gradients: Callable[[float], tuple[float, float]]
    """q to the derivatives of a(q, v, u) by q and by v at (q, 0)."""
    input_gain: float
    """The derivative of a by u."""
    x_max: tuple[float, float]
    """Natural limits of |x - x_eq|."""
    u_max: float
    """A natural limit of |u|."""
    names: tuple[str, str]
    """Of q and v, short."""
    units: tuple[str, str]
    control_unit: str
    x_eq: tuple[float, float] = (0.0, 0.0)
    u_eq: float = 0.0
    offset: float = 0.0
    """[rad] the pendulum's angle from hanging at q = 0."""

    def resting_at(self, q: float) -> "PlaneSystem":
        """The same about the rest at q, under the control that holds it there."""
        return replace(self, x_eq=(q, 0.0), u_eq=float(self.holding(np.array(q))))

    def holding(self, q: np.ndarray) -> np.ndarray:
        """u (...) that keeps q (...) at rest; of a joint the torque of gravity g(q)."""
        nothing = np.zeros_like(q)
        return np.asarray(-self.acceleration(q, nothing, nothing) / self.input_gain)

    def step(self, X: np.ndarray, U: np.ndarray, T: float) -> np.ndarray:
        """f(x, u) (..., 2) of states X (..., 2) under controls U (..., 1) held for `T` [s]."""
        q, v, u = X[..., 0], X[..., 1], U[..., 0]
        with np.errstate(all="ignore"):
            for _ in range(_step_count(T)):
                q, v = rk4(lambda q, v: self.acceleration(q, v, u), q, v, SIMULATION_STEP)
        return np.stack([q, v], axis=-1)

    def linear(self, T: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A (2, 2), B (2, 1) and c (2,) of `step` at the rest."""
        by_q, by_v = self.acceleration_gradients(self.x_eq[0])
        a, b = np.array([[0.0, 1.0], [by_q, by_v]]), np.array([[0.0], [self.input_gain]])
        A, B = repeat_held(*linear_step("rk4", SIMULATION_STEP, a, b), _step_count(T))
        x_eq = np.array(self.x_eq)
        return A, B, x_eq - A @ x_eq - B[:, 0] * self.u_eq

    def placed_body(self, place: tuple[float, float] = (0.0, 0.0), color: Vector3 = BLUE) -> Arm:
        """The body, at (x, y) = `place` [m]; the rail of the mass stays in the middle."""
        return (
            mass_on_a_line(place[0], color)
            if self.body == "mass"
            else pendulum_arm(1, place, color)
        )

    def pose(self, x: np.ndarray) -> np.ndarray:
        """(1,) where the body's joint is at x (2,)."""
        return np.array([x[0] + self.offset])


def _step_count(T: float) -> int:
    steps = round(T / SIMULATION_STEP)
    if steps < 1 or abs(steps * SIMULATION_STEP - T) > 1e-9:
        raise LabError(f"T = {T} s: a period is whole steps of {SIMULATION_STEP} s, one at least")
    return steps


METRES = {"names": ("p", "v"), "units": ("m", "m/s"), "control_unit": "N"}
RADIANS = {"names": ("q", "v"), "units": ("rad", "rad/s"), "control_unit": "N m"}


def _cart() -> PlaneSystem:
    return PlaneSystem(
        "cart",
        "Cart between walls",
        "mass",
        lambda q, v, u: u / BLOCK_MASS + 0.0 * q,
        lambda q: (0.0, 0.0),
        1.0 / BLOCK_MASS,
        (1.0, 1.0),
        1.0,
        **METRES,  # type: ignore[arg-type]
    )


def _unstable() -> PlaneSystem:
    return PlaneSystem(
        "unstable",
        "Pendulum, upright",
        "pendulum",
        lambda q, v, u: (u + GRAVITY_TORQUE * np.sin(q)) / INERTIA,
        lambda q: (GRAVITY_TORQUE * np.cos(q) / INERTIA, 0.0),
        1.0 / INERTIA,
        (0.5, 3.0),
        2.0,
        **RADIANS,  # type: ignore[arg-type]
        offset=np.pi,
    )


def _joint() -> PlaneSystem:
    return PlaneSystem(
        "joint",
        "Joint with gravity",
        "pendulum",
        lambda q, v, u: (u - GRAVITY_TORQUE * np.sin(q)) / INERTIA,
        lambda q: (-GRAVITY_TORQUE * np.cos(q) / INERTIA, 0.0),
        1.0 / INERTIA,
        (1.2, 4.0),
        8.0,
        **RADIANS,  # type: ignore[arg-type]
    ).resting_at(0.5 * np.pi)


def _oscillator() -> PlaneSystem:
    return PlaneSystem(
        "oscillator",
        "Van der Pol, reversed",
        "mass",
        lambda q, v, u: u / BLOCK_MASS - q - (1.0 - (q / HALF_AMPLITUDE) ** 2) * v,
        lambda q: (-1.0, (q / HALF_AMPLITUDE) ** 2 - 1.0),
        1.0 / BLOCK_MASS,
        (1.2, 1.5),
        1.0,
        **METRES,  # type: ignore[arg-type]
    )


PLANE_SYSTEMS: Mapping[str, Callable[[], PlaneSystem]] = {
    "cart": _cart,
    "unstable": _unstable,
    "joint": _joint,
    "oscillator": _oscillator,
}
"""By name. The joint's angle is measured from hanging, and it rests level; the oscillator is a
mass on a spring of 1 N/m whose damper takes energy near the middle and gives it farther out."""


@cache
def plane_system(name: str) -> PlaneSystem:
    """The system of this name. Raises LabError, listing those there are."""
    if name not in PLANE_SYSTEMS:
        raise LabError(f"no plane system is named {name!r}; there are {', '.join(PLANE_SYSTEMS)}")
    return PLANE_SYSTEMS[name]()
