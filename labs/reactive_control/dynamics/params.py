"""The tunables of dynamics: an arm, what drives and pulls it, and how its motion is integrated."""

from math import cos, pi
from typing import Any

import numpy as np

from labs.algorithms.integrators import INTEGRATORS
from labs.params import Group, Params
from labs.tasks.arm.params import (
    joint_values,
    offset_knob,
    offset_posture,
    robot_choice,
    where_joint_exists,
)
from labs.tasks.arm.postures import POSED_ARMS, POSTURES

DRIVES = {
    "balanced": "Gravity balanced",
    "inverse": "Inverse dynamics",
    "none": "Nothing: free fall",
}
INTEGRATION_STEPS = {0.0005: "0.5 ms", 0.001: "1 ms", 0.002: "2 ms", 0.005: "5 ms", 0.01: "10 ms"}

ROBOT = Group("Robot")
TORQUES = Group("Torques")
ACCELERATIONS = Group("Accelerations asked for")
FORCE = Group("External force")
START = Group("Start", effect="restart")
SIMULATION = Group("Simulation")


def _torque(joint: int) -> Any:
    return TORQUES.knob(
        0.0,
        -30.0,
        30.0,
        f"\\tau_{joint}",
        "N·m",
        f"Joint {joint}",
        step=0.1,
        when=where_joint_exists(joint),
        help="Added to what drives the joints.",
    )


def _acceleration(joint: int, default: float = 0.0) -> Any:
    return ACCELERATIONS.knob(
        default,
        -10.0,
        10.0,
        f"a_{joint}",
        "rad/s²",
        f"Joint {joint}",
        step=0.1,
        when=where_joint_exists(joint),
        help="Inverse dynamics finds the torque for it.",
    )


def _force(axis: str) -> Any:
    return FORCE.knob(
        0.0,
        -100.0,
        100.0,
        f"f_{axis}",
        "N",
        f"Force {axis}",
        step=1.0,
        help="On the end-effector, in the world's axes: a wrench w without a moment.",
    )


class DynamicsParams(Params):
    """What the user can turn."""

    robot: str = robot_choice(ROBOT, POSED_ARMS, effect="restart", key=True)
    """The arm that moves."""
    payload: float = ROBOT.knob(0.0, 0.0, 10.0, "m_{load}", "kg", "Payload", step=0.1, key=True)
    """A point mass at the end-effector, known to all that is computed here."""
    gravity: bool = ROBOT.toggle(True, "Gravity", key=True)
    """Off: g(q) = 0."""
    drive: str = TORQUES.choice("inverse", DRIVES, "Drive", key=True)
    """What the motors do: carry the arm's weight g(q), what inverse dynamics says for the
    accelerations asked for, or nothing. The sliders add to it."""
    tau1: float = _torque(1)
    tau2: float = _torque(2)
    tau3: float = _torque(3)
    tau4: float = _torque(4)
    tau5: float = _torque(5)
    tau6: float = _torque(6)
    tau7: float = _torque(7)
    damping: float = TORQUES.knob(0.0, 0.0, 10.0, "b", "N·m·s/rad", "Damping", step=0.1, key=True)
    """The motors brake with -b q' on top of all else: under a constant torque the joints then reach
    a constant speed."""
    a1: float = _acceleration(1, 1.5)
    a2: float = _acceleration(2, 2.0)
    a3: float = _acceleration(3, -3.0)
    a4: float = _acceleration(4)
    a5: float = _acceleration(5)
    a6: float = _acceleration(6)
    a7: float = _acceleration(7)
    swing: float = ACCELERATIONS.knob(2.0, 0.5, 10.0, "T_a", "s", "Period", step=0.1)
    """The accelerations come and go as a cos(2 pi t / T_a), so that the arm stays near."""
    fx: float = _force("x")
    fy: float = _force("y")
    fz: float = _force("z")
    posture: str = START.choice("home", POSTURES, "Posture", key=True)
    """Where the arm starts; the joint sliders turn it."""
    q1: float = offset_knob(START, 1)
    q2: float = offset_knob(START, 2)
    q3: float = offset_knob(START, 3)
    q4: float = offset_knob(START, 4)
    q5: float = offset_knob(START, 5)
    q6: float = offset_knob(START, 6)
    q7: float = offset_knob(START, 7)
    speed: float = START.knob(0.0, -3.0, 3.0, "\\dot q(0)", "rad/s", "Velocity", step=0.05)
    """How fast every joint turns at the start."""
    integrator: str = SIMULATION.choice(
        "rk4", {name: method.title for name, method in INTEGRATORS.items()}, "Integrator"
    )
    """The method that integrates the motion."""
    step: float = SIMULATION.choice(0.001, INTEGRATION_STEPS, "Integration step", "h", "s")
    """Length of one step; the torque is held during it."""

    @property
    def start(self) -> np.ndarray:
        """q(0), (nq,) [rad]."""
        return offset_posture(self, self.robot, self.posture)

    def torques(self, n: int) -> np.ndarray:
        """Of the sliders (n,) [N m]."""
        return joint_values(self, "tau", n)

    def accelerations(self, n: int, t: float) -> np.ndarray:
        """a cos(2 pi t / T_a), (n,) [rad/s^2], asked for at t [s]."""
        accelerations: np.ndarray = cos(2 * pi * t / self.swing) * joint_values(self, "a", n)
        return accelerations

    @property
    def force(self) -> np.ndarray:
        """(3,) [N] on the end-effector."""
        return np.array([self.fx, self.fy, self.fz])
