"""The scene of kinematics: the arm with its frames, and beside it the body in its gimbal."""

import numpy as np
import pinocchio as pin

from labs.algorithms.orientation import gimbal_lock_direction
from labs.models.arms import load_arm
from labs.reactive_control.kinematics.gimbal import Gimbal
from labs.reactive_control.kinematics.params import KinematicsParams
from labs.scene import Scene

AXES, SHOWN_AXES = 0.12, 0.25
"""[m] length of a frame's axes, and of the shown frame's."""
CAMERA = {
    "ur5": ((0.82, -0.88, 0.7), (0.1, -0.13, 0.3)),
    "panda": ((1.0, -1.1, 0.95), (0.1, -0.13, 0.44)),
}
GIMBAL_CENTER = np.array([-0.2, -0.45, 0.36])
"""[m] where the body in the gimbal is."""
RING_RADII = (0.2, 0.17)
"""[m] of the outer and the inner ring."""


def draw_arm(scene: Scene, params: KinematicsParams, shown: int) -> None:
    """The arm and its frames, that of the factor shown, from 1, longer."""
    arm, q = load_arm(params.robot), params.q
    scene.camera(*CAMERA[params.robot])
    scene.arm("robot", arm, q, ghost=params.translucent)
    placement = np.eye(4)
    scene.frame("frame 0", pin.SE3.Identity(), AXES)
    for i, factor in enumerate(params.chain.factors(q), start=1):
        placement = placement @ factor
        scene.frame(f"frame {i}", pin.SE3(placement), SHOWN_AXES if i == shown else AXES)
        name, text = ("shown", f"frame {i}") if i == shown else (f"name of {i}", f"{i}")
        scene.label(name, text, placement[:3, 3])


def draw_gimbal(scene: Scene, gimbal: Gimbal, rotation: np.ndarray) -> None:
    """The axes of the three angles, the rings that carry the second and the third, and the
    direction that is lost where they lie in a plane."""
    outer, inner = gimbal.rings(rotation)
    scene.trail("outer ring", GIMBAL_CENTER + RING_RADII[0] * outer, "reference")
    scene.trail("inner ring", GIMBAL_CENTER + RING_RADII[1] * inner)
    first, second, third = gimbal.axes(rotation)
    for symbol, place in (("φ", 1.35 * first), ("θ", 1.2 * second), ("ψ", 1.15 * third)):
        scene.label(symbol, symbol, GIMBAL_CENTER + RING_RADII[0] * place)
    scene.frame("body", pin.SE3(rotation, GIMBAL_CENTER), 0.13)
    lost = gimbal_lock_direction(gimbal.sequence, gimbal.angles(rotation)[0])
    scene.arrow("lost", GIMBAL_CENTER, GIMBAL_CENTER + 0.28 * lost, "warning")
