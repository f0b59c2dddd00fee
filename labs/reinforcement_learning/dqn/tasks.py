"""The robots that deep Q-learning drives: what is to be learned, and how it is looked at: through a
plane of its states, all others at rest at the goal."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from labs.models.arms import Arm, load_arm
from labs.models.pendulums import pendulum_arm
from labs.shapes import BLUE, Vector3
from labs.tasks.environments.reach import JOINT_RANGES, MOVING_JOINTS, Reach, reach
from labs.tasks.environments.swing_up import SwingUp, swing_up

TITLES = {"pendulum": "Pendulum", "double-pendulum": "Double pendulum", "ur5": "UR5, reaching"}
NODES = 31
"""Along each side of a map."""
TEST_STARTS = 12
"""Starts from which a greedy policy is tried."""


@dataclass(frozen=True, eq=False)
class RobotTask:
    """A robot to learn with, and what shows it."""

    name: str
    robot: SwingUp | Reach
    arm: Arm
    camera: tuple[Vector3, Vector3]
    relief: tuple[Vector3, float]
    """Where the middle of the relief of values stands [m], and how large it is: 1 is 1.6 m."""
    cost_scale: float
    """What costs are divided by before they are learned from."""
    plane: tuple[int, int]
    """The coordinates of x that a map runs over,"""
    middle: np.ndarray
    """(2,) about here, where the first is shown as 0"""
    half_range: np.ndarray
    """(2,) and so far to either side."""
    base: np.ndarray
    """(nx,) the state whose other coordinates a map has."""
    axes: tuple[str, str]
    home: np.ndarray
    """(nx,) where the robot in the scene begins."""
    map_coordinates: Callable[[np.ndarray], np.ndarray]
    """Observations (k, o) to the two coordinates of the map (k, 2), from its middle."""
    max_torque: float
    """[N m] the torque that an arrow of the map shows in full: of the first motor."""

    @property
    def joints(self) -> int:
        """How many move."""
        return self.robot.dynamics.joints

    @property
    def torques(self) -> np.ndarray:
        """(nu, motors) [N m]"""
        return self.robot.torques

    def test_states(self) -> np.ndarray:
        """(TEST_STARTS, nx) the same for all."""
        return self.robot.initial_states(np.array([5, 6, 7, 8], np.uint64), TEST_STARTS)

    def map_axis(self, i: int) -> np.ndarray:
        """(NODES,) of a map, from its middle."""
        return np.linspace(-self.half_range[i], self.half_range[i], NODES)

    def map_states(self, base: np.ndarray) -> np.ndarray:
        """(NODES^2, nx) the states of a map through `base` (nx,): rows along the second
        coordinate."""
        first, second = np.meshgrid(self.map_axis(0), self.map_axis(1))
        X = np.tile(base, (NODES * NODES, 1))
        X[:, self.plane[0]] = self.middle[0] + first.ravel()
        X[:, self.plane[1]] = self.middle[1] + second.ravel()
        return X

    def map_position(self, X: np.ndarray) -> np.ndarray:
        """(..., 2): where states (..., nx) are on the map; angles of pendulums within half a
        turn."""
        found = X[..., list(self.plane)] - self.middle
        if self.name != "ur5":
            found[..., 0] = np.remainder(found[..., 0] + np.pi, 2 * np.pi) - np.pi
        return np.asarray(found)

    def pose(self, x: np.ndarray) -> np.ndarray:
        """q of the arm that is drawn."""
        if self.name != "ur5":
            return x[: self.arm.model.nq]
        q = self.arm.home.copy()
        q[list(MOVING_JOINTS)] = x[:2]
        return q


@cache
def learning_task(name: str) -> RobotTask:
    """The one of this name, a key of TITLES."""
    if name == "ur5":
        return _reach_task()
    environment = swing_up(name)
    n = environment.mechanism.nq
    goal = np.concatenate([environment.goal, np.zeros(n)])
    fastest = environment.velocity_limit[0]
    return RobotTask(
        name,
        environment,
        pendulum_arm(n, (0.0, -0.8 * n), BLUE),
        ((1.8 * n, 0.0, 0.55 + 0.7 * n), (0.0, 0.0, 0.14 + 0.55 * n)),
        ((0.1, 0.43 * n, 0.5 * n), 0.78 * n),
        10.0,
        (0, n),
        np.array([np.pi, 0.0]),
        np.array([np.pi, fastest]),
        goal,
        ("angle from upright [rad]", "velocity [rad/s]"),
        np.zeros(2 * n),
        lambda seen: np.stack([np.arctan2(seen[:, n], seen[:, 0]), seen[:, 2 * n] * fastest], 1),
        float(environment.torques[:, 0].max()),
    )


def _reach_task() -> RobotTask:
    environment, arm = reach(), load_arm("ur5")
    middle = JOINT_RANGES.mean(axis=1)
    base = np.concatenate([middle, np.zeros(2), middle])
    return RobotTask(
        "ur5",
        environment,
        arm,
        ((2.0, -1.9, 1.3), (0.45, 0.35, 0.4)),
        ((0.85, 1.45, 0.03), 0.85),
        1.0,
        (0, 1),
        middle,
        0.5 * (JOINT_RANGES[:, 1] - JOINT_RANGES[:, 0]),
        base,
        ("shoulder [rad]", "elbow [rad]"),
        np.concatenate([arm.home[list(MOVING_JOINTS)], np.zeros(2), arm.home[list(MOVING_JOINTS)]]),
        lambda seen: seen[:, :2] * np.pi,
        float(environment.torques[:, 0].max()),
    )


@cache
def _posture_grid() -> tuple[np.ndarray, np.ndarray]:
    """Postures of the reaching arm (k, 2), and the places of its tip (k, 3)."""
    sides = (np.linspace(low, high, 61) for low, high in JOINT_RANGES)
    Q = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    return Q, reach().tips(Q)


def posture_at(x: float, z: float) -> np.ndarray:
    """(2,) the posture within range whose tip is nearest to (x, z) [m]."""
    Q, tips = _posture_grid()
    q: np.ndarray = Q[np.argmin((tips[:, 0] - x) ** 2 + (tips[:, 2] - z) ** 2)]
    return q
