"""Kinematics (notes, 1.1 to 1.1.2): a chain of frames, and how to write down an orientation."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from labs.algorithms.frame_chain import multiply_poses
from labs.algorithms.orientation import gimbal_lock_sine, matrix_to_angle_axis, matrix_to_quaternion
from labs.lab import Inputs, Lab, Measurement, State
from labs.params import Value
from labs.reactive_control.kinematics.gimbal import Gimbal
from labs.reactive_control.kinematics.params import KinematicsParams
from labs.reactive_control.kinematics.picture import draw_arm, draw_gimbal
from labs.reactive_control.kinematics.plots import PLOTS, chain_fields
from labs.scene import Scene
from labs.tasks.arm.params import MAX_JOINTS

PERTURBATION = 1e-7
"""[rad] the rotation whose effect on the angles is measured."""
MAX_AMPLIFICATION = 1000.0
"""What is larger, up to infinity at the lock, is shown as this."""


@dataclass(kw_only=True)
class KinematicsState(State):
    """The arm is where its sliders say; what evolves is the body in the gimbal."""

    sliders: np.ndarray
    """(MAX_JOINTS,) [rad] as the last step saw them."""
    moved: int = 1
    """The joint whose slider moved last, from 1."""
    phase: float = 0.0
    """Of the wobble [cycles]."""
    rotation: np.ndarray
    """(3, 3) the orientation of the body in the gimbal."""
    gimbal: Gimbal
    """The settings the two peaks are of, with the frequency."""
    frequency: float
    rate: float = 0.0
    """[rad/s] the mean over the last step of the Euler angle that changed fastest, jumps between
    pi and -pi taken out."""
    speed: float = 0.0
    """[rad/s] the mean angular speed of the body over the last step."""
    peak_rate: float = 0.0
    peak_speed: float = 0.0
    """[rad/s] the largest of both since these settings."""


class Kinematics(Lab[KinematicsParams, KinematicsState]):
    """An arm as a chain of frames, and a body in a gimbal."""

    title = "Kinematics"
    section = "1.1"
    summary = (
        "Pose an arm and watch its chain of homogeneous matrices; write one orientation in five "
        "ways, and lock a gimbal."
    )
    Params = KinematicsParams
    period = 0.01
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "All angles zero": {f"q{i}": 0.0 for i in range(1, MAX_JOINTS + 1)},
        "Panda": {
            "robot": "panda",
            "q1": 0.3,
            "q2": -0.6,
            "q3": 0.0,
            "q4": -2.2,
            "q5": 0.4,
            "q6": 1.9,
            "q7": 0.8,
        },
        "Far from the lock": {"distance": 1.2, "size": 0.3},
    }

    def init(self, params: KinematicsParams, rng: np.random.Generator) -> KinematicsState:
        """The body at the middle of its wobble."""
        return KinematicsState(
            sliders=params.sliders,
            rotation=params.gimbal.rotation(0.0),
            gimbal=params.gimbal,
            frequency=params.frequency,
        )

    def step(
        self, params: KinematicsParams, inputs: Inputs, state: KinematicsState
    ) -> KinematicsState:
        """Notes which slider moved, and turns the body in the gimbal on."""
        gimbal = params.gimbal
        changes = np.abs(params.sliders - state.sliders)
        phase = state.phase + params.frequency * self.period
        before, rotation = gimbal.rotation(state.phase), gimbal.rotation(phase)
        turned, _ = matrix_to_angle_axis(before.T @ rotation)
        angles = _wrap(gimbal.angles(rotation) - gimbal.angles(before))
        rate, speed = float(np.abs(angles).max()) / self.period, turned / self.period
        same = gimbal == state.gimbal and params.frequency == state.frequency
        return KinematicsState(
            t=round(state.t / self.period + 1.0) * self.period,
            sliders=params.sliders,
            moved=int(changes.argmax()) + 1 if changes.any() else state.moved,
            phase=phase % 1.0,
            rotation=rotation,
            gimbal=gimbal,
            frequency=params.frequency,
            rate=rate,
            speed=speed,
            peak_rate=max(state.peak_rate * same, rate),
            peak_speed=max(state.peak_speed * same, speed),
        )

    def measure(self, params: KinematicsParams, state: KinematicsState) -> Measurement:
        """Of the body in the gimbal: its angles, its quaternion, and how much faster than itself
        its angles turn now (`amplification`) and at most in any direction (`law`). Of the
        end-effector: how far its R is from orthonormal, and the same law."""
        gimbal = params.gimbal
        rotation = multiply_poses(params.chain.factors(params.q))[:3, :3]
        tool = gimbal_lock_sine(params.sequence, gimbal.angles(rotation)[1])
        phi, theta, psi = gimbal.angles(state.rotation)
        perturbed = gimbal.angles(gimbal.turn(PERTURBATION) @ state.rotation)
        change = float(np.abs(_wrap(perturbed - (phi, theta, psi))).max())
        w, x, y, z = matrix_to_quaternion(state.rotation)  # w > 0: it never gets near a half turn
        return {
            "shown": float(params.shown(state.moved)),
            "orthogonality": float(np.linalg.norm(rotation.T @ rotation - np.eye(3))),
            "determinant": float(np.linalg.det(rotation)),
            "tool_law": _amplification(tool),
            "phi": phi,
            "theta": theta,
            "psi": psi,
            "qw": w,
            "qx": x,
            "qy": y,
            "qz": z,
            "amplification": min(change / PERTURBATION, MAX_AMPLIFICATION),
            "law": _amplification(gimbal_lock_sine(params.sequence, theta)),
            "quaternion_gain": 0.5,
            "rate": state.rate,
            "speed": state.speed,
            "peak_rate": state.peak_rate,
            "peak_speed": state.peak_speed,
        }

    def fields(self, params: KinematicsParams, state: KinematicsState) -> Mapping[str, np.ndarray]:
        """The chain, and the end-effector's orientation in five ways."""
        return chain_fields(params, params.shown(state.moved))

    def draw(self, scene: Scene, params: KinematicsParams, state: KinematicsState) -> None:
        """The arm and its frames, the shown factor's highlighted, and the body in its gimbal."""
        draw_arm(scene, params, params.shown(state.moved))
        draw_gimbal(scene, params.gimbal, state.rotation)


def _wrap(angles: np.ndarray) -> np.ndarray:
    """The same angles [rad] within (-pi, pi]."""
    return np.pi - (np.pi - angles) % (2.0 * np.pi)


def _amplification(sine: float) -> float:
    """1 / sine, at most MAX_AMPLIFICATION."""
    return 1.0 / max(sine, 1.0 / MAX_AMPLIFICATION)
