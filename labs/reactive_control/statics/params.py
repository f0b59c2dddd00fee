"""The tunables of statics: a posture, a wrench, and a motion whose power is reckoned."""

from typing import Any

import numpy as np

from labs.models.arms import load_arm
from labs.params import Group, Params
from labs.tasks.arm.params import (
    joint_values,
    offset_knob,
    offset_posture,
    robot_choice,
    where_joint_exists,
)
from labs.tasks.arm.postures import POSED_ARMS, POSTURES

POSTURE = Group("Posture")
WRENCH = Group("Wrench at the end-effector")
VELOCITY = Group("Velocity of the joints")


def _speed(joint: int, default: float = 0.0) -> Any:
    return VELOCITY.knob(
        default,
        -2.0,
        2.0,
        f"\\dot q_{joint}",
        "rad/s",
        f"Joint {joint}",
        step=0.01,
        when=where_joint_exists(joint),
        help="The motion whose power is reckoned; the arm itself stays where it is.",
    )


def _force(axis: str, default: float) -> Any:
    return WRENCH.knob(
        default,
        -300.0,
        300.0,
        f"f_{axis}",
        "N",
        f"Force {axis}",
        step=1.0,
        key=True,
        help="In the world's axes; or drag the ball at the arrow's tip.",
    )


def _moment(axis: str) -> Any:
    return WRENCH.knob(
        0.0,
        -40.0,
        40.0,
        f"m_{axis}",
        "N·m",
        f"Moment {axis}",
        step=0.1,
        help="In the world's axes, drawn as an arc around the end-effector.",
    )


class StaticsParams(Params):
    """What the user can turn."""

    robot: str = robot_choice(POSTURE, POSED_ARMS, effect="restart", key=True)
    """The arm that is pulled at."""
    posture: str = POSTURE.choice("home", POSTURES, "Posture", key=True)
    """What the joint sliders turn."""
    fx: float = _force("x", 60.0)
    fy: float = _force("y", 0.0)
    fz: float = _force("z", -120.0)
    mx: float = _moment("x")
    my: float = _moment("y")
    mz: float = _moment("z")
    q1: float = offset_knob(POSTURE, 1)
    q2: float = offset_knob(POSTURE, 2)
    q3: float = offset_knob(POSTURE, 3)
    q4: float = offset_knob(POSTURE, 4)
    q5: float = offset_knob(POSTURE, 5)
    q6: float = offset_knob(POSTURE, 6)
    q7: float = offset_knob(POSTURE, 7)
    dq1: float = _speed(1, -0.3)
    dq2: float = _speed(2, 0.5)
    dq3: float = _speed(3, -1.0)
    dq4: float = _speed(4)
    dq5: float = _speed(5)
    dq6: float = _speed(6)
    dq7: float = _speed(7)

    @property
    def q(self) -> np.ndarray:
        """(nq,) [rad]: the posture, each joint turned by its slider."""
        return offset_posture(self, self.robot, self.posture)

    @property
    def dq(self) -> np.ndarray:
        """q' (nv,) [rad/s]."""
        return joint_values(self, "dq", load_arm(self.robot).model.nv)

    @property
    def force(self) -> np.ndarray:
        """(3,) [N] what the sliders say."""
        return np.array([self.fx, self.fy, self.fz])

    @property
    def moment(self) -> np.ndarray:
        """(3,) [N m]"""
        return np.array([self.mx, self.my, self.mz])
