"""The target an arm follows: its motion, and the velocity asked of the end-effector for it."""

import numpy as np
import pinocchio as pin

from labs.algorithms.inverse_kinematics import nearest_distance, pose_error
from labs.algorithms.jacobian import PosedChain
from labs.arrays import clip_norm
from labs.reactive_control.differential_kinematics.params import DifferentialParams

MAX_CORRECTION, MAX_CORRECTION_TURN = 0.5, 1.0
"""[m/s], [rad/s] what the feedback of the error may ask of the end-effector."""
TARGET_PERIOD = 8.0
"""[s] the target's way out and back."""
SEARCH_STARTS = 5
"""Postures the search for the nearest one begins at, besides the present one."""


def target_motion(
    params: DifferentialParams, anchor: np.ndarray, clock: float
) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and velocity [m/s] of the target, each (3,):
    p* = anchor + A (1 - cos(2 pi t / TARGET_PERIOD)) / 2 d, with d pointing away from the base
    axis."""
    outward = np.array([anchor[0], anchor[1], 0.0])
    length = float(np.linalg.norm(outward))
    direction = outward / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    phase = 2 * np.pi * clock / TARGET_PERIOD
    distance = params.reach * (1.0 - np.cos(phase)) / 2.0
    speed = params.reach * np.pi / TARGET_PERIOD * np.sin(phase)
    return anchor + distance * direction, speed * direction


def task_velocity(
    params: DifferentialParams,
    chain: PosedChain,
    anchor: np.ndarray,
    orientation: np.ndarray,
    clock: float,
) -> np.ndarray:
    """v (6,) = (p*' + k e_p, k e_o), what the error adds cut at MAX_CORRECTION and, of the turn,
    at MAX_CORRECTION_TURN."""
    target, velocity = target_motion(params, anchor, clock)
    error = params.gain * pose_error(chain.placement, pin.SE3(orientation, target))
    linear = velocity + clip_norm(error[:3], MAX_CORRECTION)
    return np.concatenate([linear, clip_norm(error[3:], MAX_CORRECTION_TURN)])


def nearest_reachable(params: DifferentialParams, target: np.ndarray, q: np.ndarray) -> float:
    """[m] how near the frame can come to a place (3,), looked for from q (n,) and SEARCH_STARTS
    other postures."""
    model = params.arm.model
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    bounds = np.maximum(lower, -np.pi), np.minimum(upper, np.pi)
    others = np.random.default_rng(0).uniform(*bounds, (SEARCH_STARTS, len(q)))
    return nearest_distance(params.kinematics, target, [q, *others], lower, upper)
