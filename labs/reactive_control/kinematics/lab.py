"""Kinematics (notes, 1.1 to 1.1.2): a chain of frames, and how to write down an orientation."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from labs.algorithms.frame_chain import FrameChain, multiply_poses
from labs.algorithms.orientation import (
    SEQUENCES,
    lock_sine,
    lost_direction,
    matrix_to_angle_axis,
    matrix_to_euler,
    matrix_to_quaternion,
    matrix_to_rpy,
)
from labs.lab import Inputs, Lab, Measurement, State
from labs.models.arms import load
from labs.params import Group, Params, Value
from labs.plots import Line, Matrix, Readout, TimeSeries
from labs.reactive_control.kinematics.gimbal import Gimbal
from labs.scene import Scene

JOINTS = 7
"""Sliders; a robot with fewer joints ignores the last ones."""
NUDGE = 1e-7
"""[rad] the rotation whose effect on the angles is measured."""
HIGHEST = 1000.0
"""What is larger, up to infinity at the lock, is shown as this."""
SMALL, LARGE = 0.12, 0.25
"""[m] length of a frame's axes, and of the highlighted frame's."""
CAMERAS = {
    "ur5": ((0.82, -0.88, 0.7), (0.1, -0.13, 0.3)),
    "panda": ((1.0, -1.1, 0.95), (0.1, -0.13, 0.44)),
}
GIMBAL = np.array([-0.2, -0.45, 0.36])
"""[m] where the body in the gimbal is."""
RINGS = (0.2, 0.17)
"""[m] radii of the outer and the inner ring."""


JOINTS_GROUP = Group("Joints")
CHAIN = Group("Chain")
ORIENTATION = Group("Orientation")
GIMBAL_GROUP = Group("Gimbal")


def _angle(i: int, default: float) -> Any:
    """The slider of joint i."""
    return JOINTS_GROUP.knob(
        default,
        -3.14,
        3.14,
        f"q_{i}",
        "rad",
        step=0.01,
        help=f"Angle of joint {i}. The robot stops at its own limits"
        + ("; the UR5 has no seventh joint." if i == JOINTS else "."),
    )


class KinematicsParams(Params):
    """What the user can turn."""

    robot: str = CHAIN.choice("ur5", {"ur5": "UR5", "panda": "Franka Panda"}, "Robot")
    """The arm: six joints or seven."""
    factor: str = CHAIN.choice(
        "moved",
        {"moved": "of the joint moved last", **{str(i): str(i) for i in range(1, JOINTS + 1)}},
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
        "zyx", {name: name.upper() for name in SEQUENCES}, "Euler sequence"
    )
    """About which axes the three Euler angles turn, each in the frame turned so far."""
    distance: float = GIMBAL_GROUP.knob(
        0.035, 0.0, 1.57, r"\delta", "rad", "Distance from the lock", scale="log"
    )
    """How far the middle angle of the body in the gimbal is from where it locks."""
    direction: str = GIMBAL_GROUP.choice(
        "lost",
        {"lost": "the lost direction", "first": "the first axis", "second": "the second axis"},
        "Wobble about",
    )
    """The fixed axis about which the body in the gimbal turns to and fro."""
    size: float = GIMBAL_GROUP.knob(0.1, 0.0, 0.5, "A", "rad", "Size of the wobble", step=0.005)
    """The body turns this far, to either side."""
    frequency: float = GIMBAL_GROUP.knob(0.25, 0.0, 2.0, "f", "Hz", "Frequency", step=0.01)
    """Of the wobble. Its fastest angular speed is 2 pi f A."""

    @property
    def sliders(self) -> np.ndarray:
        """(JOINTS,) [rad]"""
        return np.array([self.q1, self.q2, self.q3, self.q4, self.q5, self.q6, self.q7])

    @property
    def q(self) -> np.ndarray:
        """(n,) [rad]: the sliders of the robot's joints, within its limits."""
        model = load(self.robot).model
        low, high = model.lowerPositionLimit, model.upperPositionLimit
        q: np.ndarray = np.clip(self.sliders[: model.nq], low, high)
        return q

    def shown(self, moved: int) -> int:
        """The factor shown, from 1 to n."""
        wanted = moved if self.factor == "moved" else int(self.factor)
        return min(wanted, int(load(self.robot).model.nq))

    @property
    def gimbal(self) -> Gimbal:
        return Gimbal(self.sequence, self.distance, self.direction, self.size)


@dataclass(kw_only=True)
class KinematicsState(State):
    """The arm is where its sliders say; what evolves is the body in the gimbal."""

    sliders: np.ndarray
    """(JOINTS,) [rad] as the last step saw them."""
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
    plots = (
        Matrix("One factor of the chain", "factor", "H_i^{i-1}(q_i)", shade=True),
        Matrix("The whole chain", "product", "H_n^0(q)", shade=True),
        Matrix("Who depends on whom", "dependence", r"\|\partial H / \partial q_j\|", shade=True),
        Matrix("Rotation matrix: 9 numbers", "rotation", "R_n^0"),
        Matrix("Euler angles: 3 numbers", "euler", r"(\varphi, \theta, \psi)", "rad"),
        Matrix(
            "Roll, pitch, yaw: 3 numbers", "rpy", r"(\text{roll}, \text{pitch}, \text{yaw})", "rad"
        ),
        Matrix("Angle and axis: 4 numbers", "angle_axis", r"(\alpha, u)"),
        Matrix("Quaternion: 4 numbers", "quaternion", "(w, x, y, z)"),
        TimeSeries(
            "Gimbal: Euler angles",
            "rad",
            Line("phi", r"\varphi"),
            Line("theta", r"\theta"),
            Line("psi", r"\psi", "dash"),
        ),
        TimeSeries(
            "Gimbal: quaternion",
            "",
            Line("qw", "w"),
            Line("qx", "x"),
            Line("qy", "y"),
            Line("qz", "z"),
        ),
        TimeSeries(
            "Gimbal: amplification",
            "",
            Line("amplification", r"\max|\dot\varphi_i| / |\omega|"),
            Line("law", r"1 / |\cos\theta|", "dash"),
            Line("quaternion_gain", r"|\dot Q| / |\omega|"),
        ),
        TimeSeries(
            "Gimbal: fastest angle and body",
            "rad/s",
            Line("rate", r"\max|\dot\varphi_i|"),
            Line("speed", r"|\omega|"),
        ),
        Readout("shown", "Factor shown, i", "", whole=True),
        Readout("orthogonality", "‖RᵀR − I‖", ""),
        Readout("determinant", "det R", ""),
        Readout("tool_law", "End-effector: worst amplification", ""),
        Readout("peak_rate", "Gimbal: fastest Euler angle", "rad/s"),
        Readout("peak_speed", "Gimbal: fastest rotation", "rad/s"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "All angles zero": {f"q{i}": 0.0 for i in range(1, JOINTS + 1)},
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
        angles = _wrapped(gimbal.angles(rotation) - gimbal.angles(before))
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
        rotation = multiply_poses(_chain(params.robot).factors(params.q))[:3, :3]
        tool = lock_sine(params.sequence, gimbal.angles(rotation)[1])
        phi, theta, psi = gimbal.angles(state.rotation)
        nudged = gimbal.angles(gimbal.turn(NUDGE) @ state.rotation)
        change = float(np.abs(_wrapped(nudged - (phi, theta, psi))).max())
        w, x, y, z = matrix_to_quaternion(state.rotation)  # w > 0: it never gets near a half turn
        return {
            "shown": float(params.shown(state.moved)),
            "orthogonality": float(np.linalg.norm(rotation.T @ rotation - np.eye(3))),
            "determinant": float(np.linalg.det(rotation)),
            "tool_law": _gain(tool),
            "phi": phi,
            "theta": theta,
            "psi": psi,
            "qw": w,
            "qx": x,
            "qy": y,
            "qz": z,
            "amplification": min(change / NUDGE, HIGHEST),
            "law": _gain(lock_sine(params.sequence, theta)),
            "quaternion_gain": 0.5,
            "rate": state.rate,
            "speed": state.speed,
            "peak_rate": state.peak_rate,
            "peak_speed": state.peak_speed,
        }

    def fields(self, params: KinematicsParams, state: KinematicsState) -> Mapping[str, np.ndarray]:
        """The chain, and the end-effector's orientation in five ways."""
        chain = _chain(params.robot)
        factors = chain.factors(params.q)
        pose = multiply_poses(factors)
        rotation = pose[:3, :3]
        angle, axis = matrix_to_angle_axis(rotation)
        return {
            "factor": factors[params.shown(state.moved) - 1],
            "product": pose,
            "dependence": chain.derivative_norms(params.q),
            "rotation": rotation,
            "euler": matrix_to_euler(params.sequence, rotation)[None],
            "rpy": matrix_to_rpy(rotation)[None],
            "angle_axis": np.array([[angle, *axis]]),
            "quaternion": matrix_to_quaternion(rotation)[None],
        }

    def draw(self, scene: Scene, params: KinematicsParams, state: KinematicsState) -> None:
        """The arm and its frames, the shown factor's highlighted, and the body in its gimbal."""
        arm, q = load(params.robot), params.q
        scene.camera(*CAMERAS[params.robot])
        scene.arm("robot", arm, q, ghost=params.translucent)
        shown = params.shown(state.moved)
        placement = np.eye(4)
        scene.frame("frame 0", pin.SE3.Identity(), SMALL)
        for i, factor in enumerate(_chain(params.robot).factors(q), start=1):
            placement = placement @ factor
            scene.frame(f"frame {i}", pin.SE3(placement), LARGE if i == shown else SMALL)
            if i == shown:
                scene.label("shown", f"frame {i}", placement[:3, 3] + [0.0, 0.0, 0.06])
        self._draw_gimbal(scene, params, state)

    def _draw_gimbal(self, scene: Scene, params: KinematicsParams, state: KinematicsState) -> None:
        """The axes of the three angles, the rings that carry the second and the third, and the
        direction that is lost where they lie in a plane."""
        gimbal, rotation = params.gimbal, state.rotation
        outer, inner = gimbal.rings(rotation)
        scene.trail("outer ring", GIMBAL + RINGS[0] * outer, "reference")
        scene.trail("inner ring", GIMBAL + RINGS[1] * inner)
        first, second, third = gimbal.axes(rotation)
        for symbol, place in (("φ", 1.35 * first), ("θ", 1.2 * second), ("ψ", 1.15 * third)):
            scene.label(symbol, symbol, GIMBAL + RINGS[0] * place)
        scene.frame("body", pin.SE3(rotation, GIMBAL), 0.13)
        lost = lost_direction(params.sequence, gimbal.angles(rotation)[0])
        scene.arrow("lost", GIMBAL, GIMBAL + 0.28 * lost, "warning")


@cache
def _chain(robot: str) -> FrameChain:
    arm = load(robot)
    return FrameChain(arm.model, arm.tip)


def _wrapped(angles: np.ndarray) -> np.ndarray:
    """The same angles [rad] within (-pi, pi]."""
    return np.pi - (np.pi - angles) % (2.0 * np.pi)


def _gain(sine: float) -> float:
    """1 / sine, at most HIGHEST."""
    return 1.0 / max(sine, 1.0 / HIGHEST)
