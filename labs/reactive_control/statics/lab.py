"""Statics (notes, 1.1.4): the joint torques a wrench at the end-effector generates."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pinocchio as pin

from labs.lab import Handle, Inputs, Lab, Measurement, State
from labs.models.plant import plant
from labs.params import Value
from labs.plots import Bars, Line, Matrix, Readout, TimeSeries
from labs.reactive_control.statics.params import StaticsParams
from labs.scene import Scene
from labs.tasks.arm.torque_arcs import FULL_ARC, LONGEST_ARC, draw_torque_arcs

FORCE_ARROW = 1.0 / 600.0
"""[m/N] length of the force's arrow."""
VELOCITY_ARROW = 0.6
"""[s] length of the velocity's arrow over the velocity."""
FULL_ARC_MOMENT = 40.0
"""[N m] whose arc is as long as that of a torque at its limit."""
NO_FORCE = 1e-9
"""[N] forces below are none."""
CAMERA = {
    "ur5": ((1.05, -0.92, 0.8), (0.3, 0.05, 0.4)),
    "panda": ((1.15, -1.05, 0.9), (0.3, 0.03, 0.5)),
    "double-pendulum": ((1.6, 0.7, 1.15), (0.0, 0.38, 0.95)),
}


@dataclass(kw_only=True)
class StaticsState(State):
    """Time: the rest follows from the parameters."""

    steps: int = 0


@dataclass(frozen=True)
class StaticLoad:
    """An arm under a wrench: tau = J(q)^T w (1.1.4)."""

    tip: np.ndarray
    """(3,) [m]"""
    jacobian: np.ndarray
    """(6, nv): the twist of the end-effector, in the world's axes, is J q'."""
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
        Bars("Torque per force, by direction", "per_force", r"\sigma_i(J_p)", "N·m/N"),
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
    handles = (Handle("pull", "The force at the end-effector."),)

    def init(self, params: StaticsParams, rng: np.random.Generator) -> StaticsState:
        """At t = 0."""
        return StaticsState()

    def step(self, params: StaticsParams, inputs: Inputs, state: StaticsState) -> StaticsState:
        """Time passes, nothing moves."""
        steps = state.steps + 1
        return StaticsState(t=steps * self.period, steps=steps)

    def edit(
        self, params: StaticsParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The arrow's tip, dragged to x_h, makes the force (x_h - p_e) / FORCE_ARROW."""
        if handle != "pull":
            return {}
        force = (np.array(point) - plant(params.robot).tip(params.q)) / FORCE_ARROW
        return {
            name: params.nearest(name, f) for name, f in zip(("fx", "fy", "fz"), force, strict=True)
        }

    def measure(self, params: StaticsParams, state: StaticsState) -> Measurement:
        """Torque, and the power reckoned at the joints and at the end-effector."""
        load = _static_load(params)
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
        if force > NO_FORCE:
            measured["arm_length"] = _norm(load.jacobian[:3].T @ load.wrench[:3]) / force
        return measured

    def fields(self, params: StaticsParams, state: StaticsState) -> Mapping[str, np.ndarray]:
        """J^T, its torque, and the singular values of J_p: |tau| for a force of 1 N along each
        of the three main directions of the force ellipsoid, the dearest first."""
        load = _static_load(params)
        return {
            "torque": load.torque,
            "torque_limit": plant(params.robot).arm.torque_limit,
            "transposed": load.jacobian.T,
            "per_force": np.linalg.svd(load.jacobian[:3], compute_uv=False),
        }

    def draw(self, scene: Scene, params: StaticsParams, state: StaticsState) -> None:
        """The arm, the wrench, and a torque arc at every joint, red beyond the motor's limit."""
        load, world = _static_load(params), plant(params.robot)
        arm, tau, tip = world.arm, load.torque, load.tip
        scene.camera(*CAMERA[params.robot])
        scene.arm("robot", arm, params.q, effort=np.abs(tau) / arm.torque_limit)
        draw_torque_arcs(scene, world, params.q, tau)
        end = tip + FORCE_ARROW * load.wrench[:3]
        if np.linalg.norm(end - tip) > 0.01:
            scene.arrow("force", tip, end)
        if (moment := _norm(params.moment)) > 0.01:
            angle = min(FULL_ARC * moment / FULL_ARC_MOMENT, LONGEST_ARC)
            scene.arc("moment", tip, params.moment / moment, angle, 0.1, "reference")
        velocity = VELOCITY_ARROW * (load.jacobian[:3] @ params.dq)
        if np.linalg.norm(velocity) > 0.01:
            scene.arrow("velocity", tip, tip + velocity, "actual")
        directions = np.linalg.svd(load.jacobian[:3], full_matrices=False)[0]
        cheapest = 0.3 * directions[:, -1]
        scene.trail("cheapest direction", np.array([tip - cheapest, tip + cheapest]), "muted")
        scene.handle("pull", end, 0.04)


def _static_load(params: StaticsParams) -> StaticLoad:
    world = plant(params.robot)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    tip = world.tip(params.q)
    jacobian = pin.computeFrameJacobian(
        world.model, world.data, params.q, world.arm.tip, axes
    ).copy()
    wrench = np.concatenate([params.force, params.moment])
    return StaticLoad(tip, jacobian, wrench)


def _norm(vector: np.ndarray) -> float:
    return float(np.sqrt(vector @ vector))
