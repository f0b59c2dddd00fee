"""Tunables that labs of robot arms share: which arm, and a knob for each of its joints."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from labs.models.arms import TITLES
from labs.params import Effect, Group, Params

MAX_JOINTS = 7
"""Knobs a group has for the joints; an arm with fewer joints ignores the last ones."""


def robot_choice(group: Group, names: Sequence[str], *, effect: Effect | None = None) -> Any:
    """One of the arms of these names (`labs.models.arms`), at first the first."""
    titles = {name: TITLES[name] for name in names}
    return group.choice(names[0], titles, "Robot", effect=effect)


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
        help="Turns this joint away from the posture chosen. Without effect where the robot has "
        "no such joint.",
    )


def joint_values(params: Params, prefix: str, joints: int) -> np.ndarray:
    """(joints,) the values of the knobs `prefix`1, `prefix`2, ..."""
    return np.array([getattr(params, f"{prefix}{i}") for i in range(1, joints + 1)])
