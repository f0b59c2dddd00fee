"""What the direct methods are tried on, single and multiple shooting, collocation and their
race: the motions of `labs.tasks.motion.continuous`, and a pendulum that has
only to be caught, from a lean."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from labs.algorithms.inverse_kinematics import nearest_posture
from labs.models.mechanisms import Mechanism, mechanism
from labs.shapes import Vector3
from labs.tasks.motion.continuous import CONTINUOUS_MOTIONS

INITIAL_LEAN = 0.1
"""[rad] by which the upright pendulum starts off."""
TASK_TITLES: Mapping[str, str] = {
    "mass": "Mass on a line",
    "pendulum": "Pendulum, from hanging",
    "upright": "Pendulum, upright",
    "double-pendulum": "Double pendulum",
    "cart-pole": "Cart-pole",
    "ur5": "UR5, reaching",
}
CAMERAS: Mapping[str, tuple[Vector3, Vector3]] = {
    "mass": ((2.2, 0.7, 1.45), (-0.1, 0.35, 0.4)),
    "pendulum": ((1.6, 0.7, 1.15), (-0.1, 0.0, 0.6)),
    "double-pendulum": ((2.7, 1.2, 1.9), (-0.1, 0.0, 1.05)),
    "cart-pole": ((2.4, 0.8, 1.4), (-0.1, 0.0, 0.65)),
    "ur5": CONTINUOUS_MOTIONS["ur5"].camera,
}
"""By motion: where a viewer stands and what it looks at [m], so that time is seen to run back."""


@dataclass(frozen=True, eq=False)
class RestToRestTask:
    """A mechanism with its task: to come from rest to rest at a goal."""

    motion: str
    """A key of CONTINUOUS_MOTIONS."""
    mechanism: Mechanism
    x0: np.ndarray
    """(nx,)"""
    goal: np.ndarray
    """q* (nq,) [rad; m]; empty where the tip has a place to reach."""
    u_0: np.ndarray
    """(nu,) [N m; N] a natural size of the controls."""
    holding: np.ndarray
    """(nu,) what keeps it where it starts, were it at rest."""
    shown: int
    """The joint that tells most."""

    @property
    def motor(self) -> int:
        """Which control tells most: of the joint that does, if it is driven."""
        driven = self.mechanism.actuated_joints
        return driven.index(self.shown) if self.shown in driven else 0

    def position_limits(self, margin: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Least and greatest q (nq,) [rad; m]: so far beyond where it starts and its goal, at every
        joint; of the cart-pole the rail's, for its pole has to swing."""
        start = self.x0[: self.mechanism.nq]
        goal = self.goal if len(self.goal) else start
        free = np.array([self.motion == "cart-pole" and i > 0 for i in range(len(start))])
        lower, upper = np.minimum(start, goal) - margin, np.maximum(start, goal) + margin
        lower, upper = np.where(free, -np.inf, lower), np.where(free, np.inf, upper)
        return tuple(lower.tolist()), tuple(upper.tolist())

    @property
    def camera(self) -> tuple[Vector3, Vector3]:
        return CAMERAS[self.motion]

    @property
    def planar(self) -> bool:
        """Whether motions lie in a plane, so that time can be drawn across it."""
        return self.motion != "ur5"


@cache
def rest_to_rest_task(name: str) -> RestToRestTask:
    """The one of this name, a key of TASK_TITLES."""
    motion_name = "pendulum" if name == "upright" else name
    motion, body = CONTINUOUS_MOTIONS[motion_name], mechanism(motion_name)
    goal, home = np.array(motion.goal), body.arm.home
    q0 = goal - INITIAL_LEAN if name == "upright" else home
    return RestToRestTask(
        motion_name,
        body,
        np.concatenate([q0, np.zeros(body.nq)]),
        goal,
        np.array(motion.control_scale),
        body.equilibrium_control(home),
        motion.shown_joint,
    )


def reaching_posture(name: str, target: np.ndarray) -> np.ndarray:
    """q (nq,) with the tip at, or as near as it comes to, `target` (3,) [m]; the goal of a system
    that has one."""
    goal = rest_to_rest_task(name).goal
    return goal if len(goal) else np.array(_reaching_posture(name, tuple(target.tolist())))


@lru_cache(maxsize=8)
def _reaching_posture(name: str, target: tuple[float, ...]) -> tuple[float, ...]:
    body = rest_to_rest_task(name).mechanism
    q = nearest_posture(body.tip, body.tip_jacobian, np.array(target), body.arm.home)
    return tuple(q.tolist())
