"""Tunables that labs of robot arms share: which arm, and a knob for each of its joints."""

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np

from labs.models.arms import ARM_TITLES, JOINT_COUNTS
from labs.params import Group, Params
from labs.tasks.arm.postures import POSED_ARMS, posture
from labs.tunables import ChoiceCondition, TunableOptions

MAX_JOINTS = 7
"""Knobs a group has for the joints; an arm with fewer joints ignores the last ones."""


def robot_choice(group: Group, names: Sequence[str], **shared: Unpack[TunableOptions]) -> Any:
    """One of the arms of these names (`labs.models.arms`), at first the first."""
    titles = {name: ARM_TITLES[name] for name in names}
    return group.choice(names[0], titles, "Robot", **shared)


def where_joint_exists(joint: int, names: Sequence[str] = POSED_ARMS) -> ChoiceCondition:
    """Where `robot`, one of these names, has this joint, from 1."""
    return {"robot": [name for name in names if JOINT_COUNTS[name] >= joint]}


def offset_knob(group: Group, joint: int) -> Any:
    """How far a joint, from 1, is turned away from one of `labs.tasks.arm.postures` [rad]."""
    return group.knob(
        0.0,
        -3.14,
        3.14,
        f"\\Delta q_{joint}",
        "rad",
        f"Joint {joint}",
        step=0.01,
        when=where_joint_exists(joint),
        help="Turns this joint away from the posture chosen.",
    )


def joint_values(params: Params, prefix: str, joints: int) -> np.ndarray:
    """(joints,) the values of the knobs `prefix`1, `prefix`2, ..."""
    return np.array([getattr(params, f"{prefix}{i}") for i in range(1, joints + 1)])


def offset_posture(params: Params, robot: str, name: str) -> np.ndarray:
    """q (nq,) [rad]: the robot's posture of this name, each joint turned by its `offset_knob`, the
    fields q1, q2, ... of `params`."""
    base = posture(robot, name)
    q: np.ndarray = base + joint_values(params, "q", len(base))
    return q
