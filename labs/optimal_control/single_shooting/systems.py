"""What single shooting is tried on: the motions of `labs.tasks.motion.continuous`, and a pendulum
that has only to be caught, from a lean."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from labs.algorithms.single_shooting import SingleShooting
from labs.models.mechanisms import Mechanism, mechanism
from labs.problems.continuous_control import ContinuousProblem
from labs.shapes import Vector3
from labs.tasks.motion.continuous import CONTINUOUS_MOTIONS, continuous_motion

LEAN = 0.1
"""[rad] by which the upright pendulum starts off."""
TITLES: Mapping[str, str] = {
    "mass": "Mass on a line",
    "pendulum": "Pendulum, from hanging",
    "upright": "Pendulum, upright",
    "double-pendulum": "Double pendulum",
    "cart-pole": "Cart-pole",
}
CAMERAS: Mapping[str, tuple[Vector3, Vector3]] = {
    "mass": ((2.2, 0.7, 1.45), (-0.1, 0.35, 0.4)),
    "pendulum": ((1.5, 0.8, 1.05), (-0.1, 0.2, 0.7)),
    "double-pendulum": ((2.6, 1.4, 1.9), (-0.1, 0.3, 1.2)),
    "cart-pole": ((2.4, 0.8, 1.4), (-0.1, 0.0, 0.65)),
}
"""Where a viewer stands and what it looks at [m]: from where time, which runs back, is seen."""
STRIPS: Mapping[str, Vector3] = {
    "mass": (0.2, 0.0, 0.2),
    "pendulum": (0.0, 0.65, 0.6),
    "double-pendulum": (0.0, 1.15, 1.0),
    "cart-pole": (0.2, -0.4, 0.12),
}
"""Where the strip of the control's change begins [m]: beside what swings, below what slides."""


@dataclass(frozen=True, eq=False)
class System:
    """A mechanism with its task: to come from rest to rest at a goal."""

    motion: str
    """A key of CONTINUOUS_MOTIONS."""
    mechanism: Mechanism
    x0: np.ndarray
    """(nx,)"""
    goal: np.ndarray
    """q* (nq,) [rad; m]"""
    u_0: np.ndarray
    """(nu,) [N m; N] a natural size of the controls."""
    shown: int
    """The joint that tells most."""

    @property
    def camera(self) -> tuple[Vector3, Vector3]:
        return CAMERAS[self.motion]

    @property
    def strip(self) -> Vector3:
        return STRIPS[self.motion]

    def shooting(self, x0: np.ndarray, N: int, T: float, M: int, method: str) -> SingleShooting:
        """N free controls from x0 (nx,) over T [s], for the motions they make."""
        x, u = np.full(self.mechanism.nx, np.inf), np.full(self.mechanism.nu, np.inf)
        cost = continuous_motion(self.motion, "least-energy", T).cost
        problem = ContinuousProblem(self.mechanism, cost, x0, T, -x, x, -u, u)
        return SingleShooting(problem, N, M, method)


@cache
def system(name: str) -> System:
    """The one of this name, a key of TITLES."""
    upright = name == "upright"
    motion_name = "pendulum" if upright else name
    motion, body = CONTINUOUS_MOTIONS[motion_name], mechanism(motion_name)
    goal = np.array(motion.goal)
    q0 = goal - LEAN if upright else body.arm.home
    x0 = np.concatenate([q0, np.zeros(body.nq)])
    return System(motion_name, body, x0, goal, np.array(motion.control_scale), motion.shown_joint)
