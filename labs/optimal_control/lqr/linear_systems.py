"""Systems to regulate (notes, 2.4): a mechanism at rest somewhere, and what it is nearby.

With x = (q, v), dx = x - (q_eq, 0) and du = u - u_eq, where u_eq holds q_eq at rest,

    dx_(t+1) = A dx_t + B du_t + O(|dx|^2 + |du|^2)

over a control period T in which u is held. A and B are the derivatives of what is simulated: of
T/h steps of RK4 with h = 10 ms. For the mass on a line, which is linear, that is exact:
A = [1 T; 0 1], B = [T^2/2; T]/m.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from labs.algorithms.discretisation import repeat_held
from labs.algorithms.integrators import rk4
from labs.errors import LabError
from labs.models.arms import load_arm
from labs.models.cart_pole import HALF_RAIL_LENGTH
from labs.models.discrete import DiscreteMechanism
from labs.models.mass_on_a_line import mass_on_a_line
from labs.models.mechanisms import Mechanism, mechanism
from labs.models.plant import Force, Plant
from labs.shapes import Vector3

SIMULATION_STEP = 0.01
"""h [s], of the simulation."""
CAMERAS: Mapping[str, tuple[Vector3, Vector3]] = {
    "cart-pole": ((2.2, 0.45, 1.2), (0.0, 0.0, 0.8)),
    "pendulum": ((1.2, 0.6, 1.05), (0.0, 0.0, 0.88)),
    "mass": ((2.2, 0.45, 1.1), (0.0, 0.0, 0.6)),
    "ur5": ((0.77, -0.54, 0.62), (0.22, 0.05, 0.38)),
}
"""Where a viewer stands and what it looks at [m]."""
LARGEST_RATE = 100.0
"""[m/s, rad/s] faster than this nothing here is meant to go."""


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """A mechanism and the rest it is regulated to."""

    name: str
    mechanism: Mechanism
    x_eq: np.ndarray
    """(nx,) the rest (q_eq, 0)."""
    u_eq: np.ndarray
    """(nu,) [N; N m] what holds it there."""
    prismatic: tuple[int, ...]
    """The coordinates q_i that slide [m]; the others turn [rad]."""
    half_rail: float
    """[m] half the rail's length; infinite where nothing slides."""
    pull_stiffness: float
    """[N/m] of the spring by which a hand pulls at the tip: as suits the weight."""

    @property
    def nx(self) -> int:
        return len(self.x_eq)

    @property
    def nq(self) -> int:
        return self.mechanism.nq

    @property
    def nu(self) -> int:
        return len(self.u_eq)

    @property
    def camera(self) -> tuple[Vector3, Vector3]:
        """Where a viewer stands and what it looks at [m]: close, for it moves little."""
        return CAMERAS[self.name]

    def linear(self, period: float) -> tuple[np.ndarray, np.ndarray]:
        """A (nx, nx) and B (nx, nu) over `period` [s], a multiple of SIMULATION_STEP."""
        return _linear(self.name, period)

    def step(self, x: np.ndarray, u: np.ndarray, force: Force | None = None) -> np.ndarray:
        """x+ (nx,) after SIMULATION_STEP, by RK4: u (nu,) is held, `force` acts on the tip."""
        n = self.mechanism.nq
        after, acceleration = np.empty(2 * n), self.mechanism.acceleration(u, force)
        with np.errstate(all="ignore"):
            after[:n], after[n:] = rk4(acceleration, x[:n], x[n:], SIMULATION_STEP)
        return after

    def phase_point(self, x: np.ndarray) -> np.ndarray:
        """(2,) the deviation of the coordinate that tells most, and its rate: of the pole, the
        pendulum, the mass, the UR5's second joint."""
        nq = self.mechanism.nq
        i = 1 if self.name == "ur5" else nq - 1
        return np.asarray((x - self.x_eq)[[i, nq + i]])

    def out_of_range(self, x: np.ndarray) -> str:
        """Why it is simulated no further, "it ..."; empty while it is."""
        nq = self.mechanism.nq
        dx = x - self.x_eq
        turning = [i for i in range(nq) if i not in self.prismatic]
        if not np.abs(dx[list(self.prismatic)]).max(initial=0.0) <= self.half_rail:
            return f"it ran off its rail, {self.half_rail:g} m either way"
        if not np.abs(dx[turning]).max(initial=0.0) <= 4.0 * np.pi:
            return "it had turned twice round"
        if not np.abs(dx[nq:]).max() <= LARGEST_RATE:
            return f"it passed {LARGEST_RATE:g} m/s or rad/s"
        return ""


LINEAR_SYSTEMS: Mapping[str, str] = {
    "cart-pole": "Cart-pole, upright",
    "pendulum": "Pendulum, upright",
    "mass": "Mass on a line",
    "ur5": "UR5, at home",
}


@cache
def linear_system(name: str) -> LinearSystem:
    """The system of this name. Raises LabError, listing those there are."""
    match name:
        case "cart-pole":
            return _at_rest(name, mechanism(name), [0.0, np.pi], (0,), HALF_RAIL_LENGTH, 10.0)
        case "pendulum":
            return _at_rest(name, mechanism(name), [np.pi], (), np.inf, 40.0)
        case "mass":
            arm = mass_on_a_line()
            block = Mechanism(name, Plant(arm, arm.model, arm.model.createData()), (0,), 0.0)
            return _at_rest(name, block, [0.0], (0,), HALF_RAIL_LENGTH, 20.0)
        case "ur5":
            home = load_arm(name).home
            return _at_rest(name, mechanism(name), list(home), (), np.inf, 300.0)
        case _:
            raise LabError(
                f"no linear system is named {name!r}; there are {', '.join(LINEAR_SYSTEMS)}"
            )


def _at_rest(
    name: str,
    body: Mechanism,
    q: list[float],
    prismatic: tuple[int, ...],
    half_rail: float,
    pull_stiffness: float,
) -> LinearSystem:
    q_eq = np.array(q)
    x_eq, u_eq = np.concatenate([q_eq, np.zeros(body.nq)]), body.equilibrium_control(q_eq)
    return LinearSystem(name, body, x_eq, u_eq, prismatic, half_rail, pull_stiffness)


@lru_cache(maxsize=32)
def _linear(name: str, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Of the steps in a period, u held."""
    steps = round(period / SIMULATION_STEP)
    if steps < 1 or abs(steps * SIMULATION_STEP - period) > 1e-9:
        raise LabError(f"T = {period} s: it takes whole steps of {SIMULATION_STEP} s, one at least")
    system = linear_system(name)
    one = DiscreteMechanism(system.mechanism, SIMULATION_STEP, "rk4")
    _, a, b = one.linearize(system.x_eq[None], system.u_eq[None])
    return repeat_held(a[0], b[0], steps)
