"""Reaching, to be learned: a UR5 that moves its shoulder and elbow, the other joints locked, for
deep Q-learning and Gymnasium.

Each of the two motors holds its arm against gravity and adds a torque to be chosen, held for a
period. A step costs

    l = w_p |p(q) - p*| + w_v |v|^2 + w_u |u / u_max|^2

with p the tip and p* = p(q*) its target. The posture q* differs from episode to episode and is
part of the state, x = (q, v, q*); the network is told p* - p(q). No state ends the task.
"""

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import pinocchio as pin

from labs.models.arms import Arm, load_arm
from labs.models.two_link import (
    TwoLink,
    joint_direction_features,
    sample_postures,
    simulate_two_link,
    two_link,
)
from labs.random_numbers import uniform
from labs.tasks.environments.torque_task import CONTROL_PERIOD, SUBSTEPS, TorqueTask

MOVING_JOINTS = (1, 2)
"""Shoulder lift and elbow."""
JOINT_RANGES = np.array([[-2.2, -0.6], [0.4, 2.2]])
"""[rad] of each, within which episodes begin and targets lie: clear of the floor."""

VELOCITY_LIMIT = np.pi
"""[rad/s]"""
WEIGHTS = (1.0, 0.01, 0.01)
"""w_p [1/m], w_v [s^2/rad^2], w_u."""


@dataclass(frozen=True, eq=False)
class Reach(TorqueTask):
    """An `Environment`."""

    dynamics: TwoLink
    """Of the two joints, held against gravity."""
    tip: np.ndarray
    """(5, 3) [m]: the tip, from its directions and 1."""
    torques: np.ndarray
    """(nu, 2) [N m] beyond gravity's."""
    largest: np.ndarray
    """u_max (2,) [N m]"""

    nx = 6
    observation_size = 8
    horizon = 60

    def tips(self, Q: np.ndarray) -> np.ndarray:
        """(k, 3) [m] at joint angles Q (k, 2)."""
        return np.asarray(joint_direction_features(Q) @ self.tip[:4] + self.tip[4])

    def initial_states(self, random: np.ndarray, many: int) -> np.ndarray:
        drawn = np.array([[uniform(random) for _ in range(4)] for _ in range(many)])
        low, size = JOINT_RANGES[:, 0], JOINT_RANGES[:, 1] - JOINT_RANGES[:, 0]
        return np.hstack(
            [low + size * drawn[:, :2], np.zeros((many, 2)), low + size * drawn[:, 2:]]
        )

    def observe(self, X: np.ndarray) -> np.ndarray:
        """Angles about the middle of their ranges, velocities in parts of their limit, and the way
        to the target: (3,) [m], and its length."""
        way = self.tips(X[:, 4:]) - self.tips(X[:, :2])
        parts = [
            (X[:, :2] - JOINT_RANGES.mean(axis=1)) / np.pi,
            X[:, 2:4] / VELOCITY_LIMIT,
            way,
            np.linalg.norm(way, axis=1, keepdims=True),
        ]
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def cost(self, X: np.ndarray, torques: np.ndarray) -> np.ndarray:
        w_p, w_v, w_u = WEIGHTS
        distance = np.linalg.norm(self.tips(X[:, 4:]) - self.tips(X[:, :2]), axis=1)
        effort = ((torques / self.largest) ** 2).sum(axis=1)
        return np.asarray(w_p * distance + w_v * (X[:, 2:4] ** 2).sum(axis=1) + w_u * effort)

    def integrate(self, X: np.ndarray, torques: np.ndarray, parts: int = SUBSTEPS) -> np.ndarray:
        body, h, limits = self.dynamics, CONTROL_PERIOD / SUBSTEPS, np.full(2, VELOCITY_LIMIT)
        return simulate_two_link(2, body.inertia, body.gravity, X, torques, limits, h, parts)


@cache
def reach() -> Reach:
    """With three torques a joint."""
    arm = load_arm("ur5")
    locked = [i + 1 for i in range(arm.model.nq) if i not in MOVING_JOINTS]
    model = pin.buildReducedModel(arm.model, locked, arm.home)
    model.armature = arm.model.armature[list(MOVING_JOINTS)]
    largest = np.array([30.0, 15.0])
    torques = largest * np.array(list(product((-1.0, 0.0, 1.0), repeat=2)))
    return Reach(two_link(model).without_gravity(), _tip(arm, model), torques, largest)


def _tip(arm: Arm, model: pin.Model) -> np.ndarray:
    """(5, 3) [m]: what `Reach.tips` takes of it."""
    data, frame, Q = model.createData(), arm.model.frames[arm.tip].name, sample_postures()
    places = np.empty((len(Q), 3))
    for q, place in zip(Q, places, strict=True):
        pin.framesForwardKinematics(model, data, q)
        place[:] = data.oMf[model.getFrameId(frame)].translation
    known = np.hstack([joint_direction_features(Q), np.ones((len(Q), 1))])
    return np.asarray(np.linalg.lstsq(known, places, rcond=None)[0])
