"""Postures worth starting from, the same three for every arm.

In the two straight ones an arm has lost a direction of motion, or almost so: the Panda's elbow
does not open all the way, and stays a little bent.
"""

from collections.abc import Mapping
from functools import cache
from math import atan2, pi

import numpy as np

from labs.errors import LabError
from labs.models.arms import load_arm
from labs.models.plant import plant

POSED_ARMS = ("ur5", "panda", "double-pendulum")
"""The arms that have them."""
POSTURES: Mapping[str, str] = {
    "home": "Home, bent",
    "outstretched": "Outstretched",
    "upright": "Upright",
}
STRAIGHT: Mapping[tuple[str, str], tuple[float, ...]] = {
    ("ur5", "outstretched"): (0.0, 0.0, 0.0, -pi / 2, 0.0, 0.0),
    ("ur5", "upright"): (0.0, -pi / 2, 0.0, -pi / 2, 0.0, 0.0),
    ("panda", "outstretched"): (0.0, 1.45, 0.0, -0.07, 0.0, 3.0, 0.785),
    ("panda", "upright"): (0.0, -0.1, 0.0, -0.07, 0.0, 3.0, 0.785),
    ("double-pendulum", "outstretched"): (pi / 2, 0.0),
    ("double-pendulum", "upright"): (pi, 0.0),
}
"""[rad]"""


@cache
def posture(robot: str, name: str) -> np.ndarray:
    """The joint angles (nq,) [rad] of this arm in one of POSTURES; do not write into them.

    Outstretched, a six-axis arm is turned about the vertical until its end-effector is over the
    x axis: the direction it has lost is then x itself. Raises LabError."""
    if name not in POSTURES:
        raise LabError(f"no posture is named {name!r}; there are {', '.join(POSTURES)}")
    if name == "home":
        return load_arm(robot).home
    q = np.array(STRAIGHT[robot, name])
    if name == "outstretched" and robot != "double-pendulum":
        x, y, _ = plant(robot).tip(q)
        q[0] = -atan2(y, x)
    return q
