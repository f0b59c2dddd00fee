"""The tunables of kinematics: an arm's joints, and a body in a gimbal."""

from functools import cache
from typing import Any

import numpy as np

from labs.algorithms.frame_chain import FrameChain
from labs.algorithms.orientation import SEQUENCES
from labs.models.arms import load_arm
from labs.params import Group, Params
from labs.reactive_control.kinematics.gimbal import Gimbal
from labs.tasks.arm.params import MAX_JOINTS, joint_values, robot_choice, where_joint_exists

ROBOTS = ("ur5", "panda")

JOINTS = Group("Joints")
CHAIN = Group("Chain")
ORIENTATION = Group("Orientation")
GIMBAL = Group("Gimbal")


def _angle(i: int, default: float) -> Any:
    """The slider of joint i."""
    return JOINTS.knob(
        default,
        -3.14,
        3.14,
        f"q_{i}",
        "rad",
        step=0.01,
        key=True,
        when=where_joint_exists(i, ROBOTS),
        help=f"Angle of joint {i}. The robot stops at its own limits.",
    )


class KinematicsParams(Params):
    """What the user can turn."""

    robot: str = robot_choice(CHAIN, ROBOTS, key=True)
    """The arm: six joints or seven."""
    factor: str = CHAIN.choice(
        "moved",
        {"moved": "of the joint moved last", **{str(i): str(i) for i in range(1, MAX_JOINTS + 1)}},
        "Factor shown",
        "i",
    )
    """Which factor of the chain to show, with its frame. The UR5's last is the sixth."""
    translucent: bool = CHAIN.toggle(True, "Translucent arm")
    """Draw the arm so that the frames inside it show."""
    q1: float = _angle(1, 0.4)
    q2: float = _angle(2, -1.2)
    q3: float = _angle(3, 1.3)
    q4: float = _angle(4, -1.6)
    q5: float = _angle(5, -1.2)
    q6: float = _angle(6, 0.5)
    q7: float = _angle(7, 0.8)
    sequence: str = ORIENTATION.choice(
        "zyx", {name: name.upper() for name in SEQUENCES}, "Euler sequence", key=True
    )
    """About which axes the three Euler angles turn, each in the frame turned so far."""
    distance: float = GIMBAL.knob(
        0.035, 0.0, 1.57, r"\delta", "rad", "Distance from the lock", scale="log", key=True
    )
    """How far the middle angle of the body in the gimbal is from where it locks."""
    direction: str = GIMBAL.choice(
        "lost",
        {"lost": "the lost direction", "first": "the first axis", "second": "the second axis"},
        "Wobble about",
    )
    """The fixed axis about which the body in the gimbal turns to and fro."""
    size: float = GIMBAL.knob(0.1, 0.0, 0.5, "A", "rad", "Size of the wobble", step=0.005)
    """The body turns this far, to either side."""
    frequency: float = GIMBAL.knob(0.25, 0.0, 2.0, "f", "Hz", "Frequency", step=0.01)
    """Of the wobble. Its fastest angular speed is 2 pi f A."""

    @property
    def sliders(self) -> np.ndarray:
        """(MAX_JOINTS,) [rad]"""
        return joint_values(self, "q", MAX_JOINTS)

    @property
    def q(self) -> np.ndarray:
        """(n,) [rad]: the sliders of the robot's joints, within its limits."""
        model = load_arm(self.robot).model
        low, high = model.lowerPositionLimit, model.upperPositionLimit
        q: np.ndarray = np.clip(self.sliders[: model.nq], low, high)
        return q

    def shown(self, moved: int) -> int:
        """The factor shown, from 1 to n."""
        wanted = moved if self.factor == "moved" else int(self.factor)
        return min(wanted, int(load_arm(self.robot).model.nq))

    @property
    def chain(self) -> FrameChain:
        """Up to the end-effector."""
        return _frame_chain(self.robot)

    @property
    def gimbal(self) -> Gimbal:
        return Gimbal(self.sequence, self.distance, self.direction, self.size)


@cache
def _frame_chain(robot: str) -> FrameChain:
    arm = load_arm(robot)
    return FrameChain(arm.model, arm.tip)
