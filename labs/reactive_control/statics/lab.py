"""Statics (notes, 1.1.4): the joint torques a wrench at the end-effector generates."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from labs.lab import Action, Handle, Inputs, Lab, Measurement, State
from labs.models.arms import load
from labs.models.plant import plant
from labs.models.postures import POSTURES, ROBOTS, posture
from labs.params import Group, Params, Value
from labs.plots import Bars, Line, Matrix, Readout, TimeSeries
from labs.scene import Color, Scene

ARROW = 1.0 / 600.0
"""[m/N] length of the force's arrow."""
TWIST = 0.6
"""[s] length of the velocity's arrow over the velocity."""
STRONGEST = 500.0
"""[N] beyond which dragging pulls no harder."""
FULL_ARC = 4.5
"""[rad] an arc at its torque limit spans; a moment of `FULL_MOMENT` as much."""
LONGEST_ARC = 6.0
FULL_MOMENT = 40.0
"""[N m]"""
FEWEST = 1e-9
"""[N] forces below are none."""
CAMERA = {
    "ur5": ((1.05, -0.92, 0.8), (0.3, 0.05, 0.4)),
    "panda": ((1.15, -1.05, 0.9), (0.3, 0.03, 0.5)),
    "double-pendulum": ((1.6, 0.7, 1.15), (0.0, 0.38, 0.95)),
}


POSTURE = Group("Posture")
VELOCITY_OF_THE_JOINTS = Group("Velocity of the joints")
WRENCH_AT_THE_END_EFFECTOR = Group("Wrench at the end-effector")


def _turn(joint: int) -> Any:
    return POSTURE.knob(
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


def _speed(joint: int, default: float = 0.0) -> Any:
    return VELOCITY_OF_THE_JOINTS.knob(
        default,
        -2.0,
        2.0,
        f"\\dot q_{joint}",
        "rad/s",
        f"Joint {joint}",
        step=0.01,
        help="The motion whose power is reckoned; the arm itself stays where it is.",
    )


def _force(axis: str, default: float) -> Any:
    return WRENCH_AT_THE_END_EFFECTOR.knob(
        default,
        -300.0,
        300.0,
        f"f_{axis}",
        "N",
        f"Force {axis}",
        step=1.0,
        help="In the world's axes. What was dragged in the scene adds to it.",
    )


def _moment(axis: str) -> Any:
    return WRENCH_AT_THE_END_EFFECTOR.knob(
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

    robot: str = POSTURE.choice(
        "ur5", {name: load(name).title for name in ROBOTS}, "Robot", effect="restart"
    )
    """The arm that is pulled at."""
    posture: str = POSTURE.choice("home", POSTURES, "Posture")
    """What the joint sliders turn."""
    q1: float = _turn(1)
    q2: float = _turn(2)
    q3: float = _turn(3)
    q4: float = _turn(4)
    q5: float = _turn(5)
    q6: float = _turn(6)
    q7: float = _turn(7)
    fx: float = _force("x", 60.0)
    fy: float = _force("y", 0.0)
    fz: float = _force("z", -120.0)
    mx: float = _moment("x")
    my: float = _moment("y")
    mz: float = _moment("z")
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
        base = posture(self.robot, self.posture)
        turned = (self.q1, self.q2, self.q3, self.q4, self.q5, self.q6, self.q7)
        q: np.ndarray = base + np.array(turned[: len(base)])
        return q

    @property
    def dq(self) -> np.ndarray:
        """q' (nv,) [rad/s]."""
        speeds = (self.dq1, self.dq2, self.dq3, self.dq4, self.dq5, self.dq6, self.dq7)
        return np.array(speeds[: load(self.robot).model.nv])

    @property
    def force(self) -> np.ndarray:
        """(3,) [N] what the sliders say."""
        return np.array([self.fx, self.fy, self.fz])

    @property
    def moment(self) -> np.ndarray:
        """(3,) [N m]"""
        return np.array([self.mx, self.my, self.mz])


@dataclass(kw_only=True)
class StaticsState(State):
    """What the hand did: the rest follows from the parameters."""

    pulled: np.ndarray
    """(3,) [N] dragged at the arrow's tip, on top of the sliders."""
    steps: int = 0


@dataclass(frozen=True)
class Load:
    """An arm under a wrench: tau = J(q)^T w (1.1.4)."""

    tip: np.ndarray
    """(3,) [m]"""
    jacobian: np.ndarray
    """(6, nv): the twist of the end-effector, in the world's axes, is J q'."""
    joints: np.ndarray
    """(nv, 3) [m] where the joints are."""
    wrench: np.ndarray
    """(6,) [N, N m] force and moment at the end-effector, in the world's axes."""

    @property
    def torque(self) -> np.ndarray:
        """J^T w (nv,) [N m]."""
        tau: np.ndarray = self.jacobian.T @ self.wrench
        return tau


class Statics(Lab[StaticsParams, StaticsState]):
    """An arm at rest, pulled and twisted at its end-effector."""

    title = "Statics"
    section = "1.1.4"
    summary = (
        "Pull at the end-effector of an arm and see what its joints feel: the torques, the two "
        "powers that must be equal, and the direction in which an arm carries for nothing."
    )
    Params = StaticsParams
    period = 0.01
    plots = (
        Bars("Joint torques", "torque", r"\tau = J^T w", "N·m", limit="torque_limit"),
        TimeSeries(
            "Power",
            "W",
            Line("joint_power", r"P_\tau = \tau^T \dot q"),
            Line("tip_power", "P_e = w^T v", "dash"),
        ),
        Matrix(
            "Transposed Jacobian",
            "transposed",
            "J(q)^T",
            shade=True,
        ),
        Bars("Torque per force, along each main direction", "per_force", r"\sigma_i(J_p)", "N·m/N"),
        TimeSeries("Torques over time", "N·m", Line("tau", r"\tau"), select="joint"),
        Readout("force", "Force |f|", "N"),
        Readout("effort", "Torque |τ|", "N·m"),
        Readout("joint_power", "Power at the joints", "W"),
        Readout("tip_power", "Power at the end-effector", "W"),
        Readout("power_gap", "Their difference", "W"),
        Readout("arm_length", "Torque per force", "N·m/N"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Outstretched, pulled along itself": {
            "posture": "outstretched",
            "fx": 300.0,
            "fz": 0.0,
        },
        "Upright, a load on top": {"posture": "upright", "fx": 0.0, "fz": -300.0},
        "A moment alone": {"fx": 0.0, "fz": 0.0, "mz": 25.0},
        "Panda": {"robot": "panda"},
        "Double pendulum": {"robot": "double-pendulum", "fx": 0.0, "fy": 60.0, "fz": -40.0},
    }
    actions = (
        Action(
            "let_go",
            "Let go",
            "Takes away the force that was dragged; the sliders' stays.",
            group="Wrench at the end-effector",
        ),
    )
    handles = (Handle("pull", "The force at the end-effector."),)

    def init(self, params: StaticsParams, rng: np.random.Generator) -> StaticsState:
        """Nothing dragged yet."""
        return StaticsState(pulled=np.zeros(3))

    def step(self, params: StaticsParams, inputs: Inputs, state: StaticsState) -> StaticsState:
        """Time passes, nothing moves. While the arrow's tip is held at x_h the whole force is
        (x_h - p_e) / ARROW; released, what differs from the sliders' force stays."""
        pulled = np.zeros(3) if "let_go" in inputs.actions else state.pulled.copy()
        if (held := inputs.handles.get("pull")) is not None:
            wanted = (np.array(held) - plant(params.robot).tip(params.q)) / ARROW
            size = float(wanted @ wanted) ** 0.5
            pulled = wanted * (STRONGEST / max(size, STRONGEST)) - params.force
        steps = state.steps + 1
        return StaticsState(t=steps * self.period, pulled=pulled, steps=steps)

    def measure(self, params: StaticsParams, state: StaticsState) -> Measurement:
        """Torque, and the power reckoned at the joints and at the end-effector."""
        load = _load(params, state)
        tau, dq = load.torque, params.dq
        twist = load.jacobian @ dq
        joint_power, tip_power = float(tau @ dq), float(load.wrench @ twist)
        force = _norm(load.wrench[:3])
        measured: dict[str, float | np.ndarray] = {
            "tau": tau,
            "wrench": load.wrench,
            "twist": twist,
            "joint_power": joint_power,
            "tip_power": tip_power,
            "power_gap": abs(joint_power - tip_power),
            "force": force,
            "moment": _norm(load.wrench[3:]),
            "effort": _norm(tau),
        }
        if force > FEWEST:
            measured["arm_length"] = _norm(load.jacobian[:3].T @ load.wrench[:3]) / force
        return measured

    def fields(self, params: StaticsParams, state: StaticsState) -> Mapping[str, np.ndarray]:
        """J^T, its torque, and the singular values of J_p: |tau| for a force of 1 N along each
        of the three main directions of the force ellipsoid, the dearest first."""
        load = _load(params, state)
        return {
            "torque": load.torque,
            "torque_limit": plant(params.robot).arm.torque_limit,
            "transposed": load.jacobian.T,
            "per_force": np.linalg.svd(load.jacobian[:3], compute_uv=False),
        }

    def draw(self, scene: Scene, params: StaticsParams, state: StaticsState) -> None:
        """The arm, the wrench, and a torque arc at every joint, red beyond the motor's limit."""
        load, arm = _load(params, state), plant(params.robot).arm
        tau, tip = load.torque, load.tip
        scene.camera(*CAMERA[params.robot])
        scene.arm("robot", arm, params.q, effort=np.abs(tau) / arm.torque_limit)
        for i, share in enumerate(tau / arm.torque_limit):
            if abs(angle := FULL_ARC * share) > 0.03:
                angle = float(np.clip(angle, -LONGEST_ARC, LONGEST_ARC))
                color: Color = "warning" if abs(share) >= 1.0 else "force"
                axis = load.jacobian[3:, i]
                scene.arc(f"torque {i + 1}", load.joints[i], axis, angle, 0.14, color)
        end = tip + ARROW * load.wrench[:3]
        if np.linalg.norm(end - tip) > 0.01:
            scene.arrow("force", tip, end)
        if (moment := _norm(params.moment)) > 0.01:
            angle = min(FULL_ARC * moment / FULL_MOMENT, LONGEST_ARC)
            scene.arc("moment", tip, params.moment / moment, angle, 0.1, "reference")
        velocity = TWIST * (load.jacobian[:3] @ params.dq)
        if np.linalg.norm(velocity) > 0.01:
            scene.arrow("velocity", tip, tip + velocity, "actual")
        main = np.linalg.svd(load.jacobian[:3], full_matrices=False)[0]
        cheapest = 0.45 * main[:, -1]
        scene.trail("cheapest direction", np.array([tip - cheapest, tip + cheapest]), "muted")
        scene.handle("pull", end, 0.04)


def _load(params: StaticsParams, state: StaticsState) -> Load:
    world = plant(params.robot)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    tip = world.tip(params.q)
    jacobian = pin.computeFrameJacobian(
        world.model, world.data, params.q, world.arm.tip, axes
    ).copy()
    joints = np.array([world.data.oMi[j].translation for j in range(1, world.model.njoints)])
    wrench = np.concatenate([params.force + state.pulled, params.moment])
    return Load(tip, jacobian, joints, wrench)


def _norm(vector: np.ndarray) -> float:
    return float(np.sqrt(vector @ vector))
