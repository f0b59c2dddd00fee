"""What is controlled: a UR5 that reaches, a cart that balances its pole, a double pendulum."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import Mechanism, mechanism
from labs.shapes import Vector3
from labs.tasks.direct.systems import reaching_posture
from labs.tasks.motion.motions import FAR_VIEW, MOTIONS, ROBOT_VIEW

ROD, HINGE = 0.5, 1.25
"""Length of each rod of the double pendulum, height of its hinge [m]."""
MAX_REACH = 1.0 - 1e-9
"""What the elbow's cosine is cut to."""
BRAKE_GAIN = 1.0
"""[s/rad; s/m] of u_0 by which a braking motor works against each unit of velocity."""


@dataclass(frozen=True, eq=False)
class ControlledSystem:
    """A mechanism, where it starts and how it is integrated."""

    title: str
    mechanism: Mechanism
    x0: np.ndarray
    """(nx,)"""
    u_0: np.ndarray
    """(nu,) [N m; N] a natural size of the controls."""
    q_limited: np.ndarray
    """(nq,) whether a joint's position has limits, about where it starts;"""
    v_limited: np.ndarray
    """(nq,) and its velocity."""
    shown: int
    """The joint that tells most."""
    method: str
    """Of INTEGRATORS, by which plan and plant go."""
    camera: tuple[Vector3, Vector3]

    @property
    def n(self) -> int:
        return self.mechanism.nq

    def brake(self, x: np.ndarray) -> np.ndarray:
        """u (nu,) that holds the arm against gravity and slows down what moves."""
        driven = list(self.mechanism.actuated_joints)
        u: np.ndarray = -BRAKE_GAIN * self.u_0 * x[self.n :][driven]
        return u + self.mechanism.equilibrium_control(x[: self.n]) if len(driven) == self.n else u


@cache
def controlled_system(name: str) -> ControlledSystem:
    """The one of this name, a key of SYSTEM_TITLES."""
    body = mechanism(name)
    title, q_limited, v_limited, shown, method, camera = _SYSTEMS[name]
    u_0 = MOTIONS[name].control_scale
    x0 = np.concatenate([body.arm.home, np.zeros(body.nq)])
    limited = np.array(q_limited), np.array(v_limited)
    return ControlledSystem(title, body, x0, np.array(u_0), *limited, shown, method, camera)


@lru_cache(maxsize=32)
def dynamics(name: str, h: float, payload: float = 0.0) -> DiscreteMechanism:
    """x+ = f(x, u) of this system over h [s], carrying a payload [kg]."""
    return DiscreteMechanism(mechanism(name, payload), h, controlled_system(name).method)


def goal_posture(name: str, target: np.ndarray) -> np.ndarray:
    """q* (nq,) that puts what is to be moved at `target` (3,) [m], or as near as it comes: the
    arms' tips, and the cart, with the pole upright."""
    if name == "cart-pole":
        return np.array([target[1], np.pi])
    if name == "double-pendulum":
        return _double_pendulum_posture(target[1], target[2] - HINGE)
    return reaching_posture(name, target)


def _double_pendulum_posture(y: float, z: float) -> np.ndarray:
    """Angles of two rods of one length from hanging, the first in [0, 2 pi)."""
    reach = min(np.hypot(y, z) / (2.0 * ROD), MAX_REACH)
    elbow = 2.0 * np.arccos(reach)
    direction = np.arctan2(y, -z) % (2.0 * np.pi)
    return np.array([direction - 0.5 * elbow, elbow])


_SYSTEMS: Mapping[
    str,
    tuple[
        str,
        tuple[bool, ...],
        tuple[bool, ...],
        int,
        str,
        tuple[Vector3, Vector3],
    ],
] = {
    "ur5": (
        "UR5, reaching",
        (True,) * 6,
        (True,) * 6,
        0,
        "semi-implicit-euler",
        ROBOT_VIEW,
    ),
    "cart-pole": (
        "Cart-pole, swinging up",
        (True, False),
        (True, False),
        1,
        "rk4",
        ((2.5, 0.5, 1.15), (0.0, 0.0, 0.8)),
    ),
    "double-pendulum": (
        "Double pendulum",
        (False, True),
        (True, True),
        0,
        "rk4",
        FAR_VIEW,
    ),
}
SYSTEM_TITLES: Mapping[str, str] = {name: entry[0] for name, entry in _SYSTEMS.items()}
