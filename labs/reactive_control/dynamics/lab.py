"""Dynamics (notes, 1.1.5): the equation of motion of an arm, its terms and its two problems."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import cos, pi
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from labs.algorithms.equation_of_motion import (
    EquationTerms,
    direct_dynamics,
    equation_terms,
    inverse_dynamics,
)
from labs.algorithms.integrators import INTEGRATORS
from labs.lab import Inputs, Lab, Measurement, State
from labs.models.arms import load
from labs.models.plant import Plant, plant
from labs.models.postures import POSTURES, ROBOTS, posture
from labs.params import Group, Params, Value
from labs.plots import Bars, Line, Matrix, Readout, TimeSeries
from labs.scene import Scene

FASTEST = 100.0
"""[rad/s] a joint faster than this has left what an arm can do."""
ARROW = 1.0 / 250.0
"""[m/N] length of the force's arrow."""
TRAIL, TRAIL_EVERY = 150, 2
"""Points of a trail, and world steps between two: 3 s."""
FULL_ARC, LONGEST_ARC = 4.5, 6.0
"""[rad] an arc at its torque limit spans, and spans at most."""
CAMERA = {
    "ur5": ((1.1, -0.95, 0.8), (0.25, 0.05, 0.42)),
    "panda": ((1.1, -1.0, 0.9), (0.2, 0.03, 0.47)),
    "double-pendulum": ((2.1, 0.6, 1.25), (0.0, 0.15, 1.1)),
}
DRIVES = {
    "balanced": "Gravity balanced",
    "inverse": "Inverse dynamics",
    "none": "Nothing: free fall",
}
STEPS = {0.0005: "0.5 ms", 0.001: "1 ms", 0.002: "2 ms", 0.005: "5 ms", 0.01: "10 ms"}


TORQUES = Group("Torques")
ACCELERATIONS_ASKED_FOR = Group("Accelerations asked for")
START = Group("Start", effect="restart")
EXTERNAL_FORCE = Group("External force")
ROBOT = Group("Robot")
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
        help="Added to what drives the joints. Without effect where there is no such joint.",
    )


def _acceleration(joint: int, default: float = 0.0) -> Any:
    return ACCELERATIONS_ASKED_FOR.knob(
        default,
        -10.0,
        10.0,
        f"a_{joint}",
        "rad/s²",
        f"Joint {joint}",
        step=0.1,
        help="Inverse dynamics finds the torque for it. Without effect where there is no such "
        "joint.",
    )


def _turn(joint: int) -> Any:
    return START.knob(
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


def _force(axis: str) -> Any:
    return EXTERNAL_FORCE.knob(
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

    robot: str = ROBOT.choice(
        "ur5", {name: load(name).title for name in ROBOTS}, "Robot", effect="restart"
    )
    """The arm that moves."""
    payload: float = ROBOT.knob(0.0, 0.0, 10.0, "m_{load}", "kg", "Payload", step=0.1)
    """A point mass at the end-effector, known to all that is computed here."""
    gravity: bool = ROBOT.toggle(True, "Gravity")
    """Off: g(q) = 0."""
    drive: str = TORQUES.choice("inverse", DRIVES, "Drive")
    """What the motors do: carry the arm's weight g(q), what inverse dynamics says for the
    accelerations asked for, or nothing. The sliders add to it."""
    tau1: float = _torque(1)
    tau2: float = _torque(2)
    tau3: float = _torque(3)
    tau4: float = _torque(4)
    tau5: float = _torque(5)
    tau6: float = _torque(6)
    tau7: float = _torque(7)
    damping: float = TORQUES.knob(0.0, 0.0, 10.0, "b", "N·m·s/rad", "Damping", step=0.1)
    """The motors brake with -b q' on top of all else: under a constant torque the joints then reach
    a constant speed."""
    a1: float = _acceleration(1, 1.5)
    a2: float = _acceleration(2, 2.0)
    a3: float = _acceleration(3, -3.0)
    a4: float = _acceleration(4)
    a5: float = _acceleration(5)
    a6: float = _acceleration(6)
    a7: float = _acceleration(7)
    swing: float = ACCELERATIONS_ASKED_FOR.knob(2.0, 0.5, 10.0, "T_a", "s", "Period", step=0.1)
    """The accelerations come and go as a cos(2 pi t / T_a), so that the arm stays near."""
    fx: float = _force("x")
    fy: float = _force("y")
    fz: float = _force("z")
    posture: str = START.choice("home", POSTURES, "Posture")
    """Where the arm starts; the joint sliders turn it."""
    q1: float = _turn(1)
    q2: float = _turn(2)
    q3: float = _turn(3)
    q4: float = _turn(4)
    q5: float = _turn(5)
    q6: float = _turn(6)
    q7: float = _turn(7)
    speed: float = START.knob(0.0, -3.0, 3.0, "\\dot q(0)", "rad/s", "Velocity", step=0.05)
    """How fast every joint turns at the start."""
    integrator: str = SIMULATION.choice(
        "rk4", {name: method.title for name, method in INTEGRATORS.items()}, "Integrator"
    )
    """The method that integrates the motion."""
    step: float = SIMULATION.choice(0.001, STEPS, "Integration step", "h", "s")
    """Length of one step; the torque is held during it."""

    @property
    def start(self) -> np.ndarray:
        """q(0), (nq,) [rad]."""
        base = posture(self.robot, self.posture)
        turned = (self.q1, self.q2, self.q3, self.q4, self.q5, self.q6, self.q7)
        q: np.ndarray = base + np.array(turned[: len(base)])
        return q

    def torques(self, n: int) -> np.ndarray:
        """Of the sliders (n,) [N m]."""
        return np.array(
            (self.tau1, self.tau2, self.tau3, self.tau4, self.tau5, self.tau6, self.tau7)[:n]
        )

    def accelerations(self, n: int, t: float) -> np.ndarray:
        """a cos(2 pi t / T_a), (n,) [rad/s^2], asked for at t [s]."""
        asked = (self.a1, self.a2, self.a3, self.a4, self.a5, self.a6, self.a7)[:n]
        return cos(2 * pi * t / self.swing) * np.array(asked)

    @property
    def force(self) -> np.ndarray:
        """(3,) [N] on the end-effector."""
        return np.array([self.fx, self.fy, self.fz])


@dataclass(kw_only=True)
class DynamicsState(State):
    """The arm, and the book kept of its energy. Arrays are never written after they are made."""

    q: np.ndarray
    v: np.ndarray
    gained: float = 0.0
    """[J] energy the arm has that no work explains: the integrator's error."""
    steps: int = 0
    trail: np.ndarray
    """(TRAIL, 3) [m] where the end-effector was, the newest last."""


@dataclass(frozen=True, eq=False)
class Instant:
    """All of the equation at one instant."""

    equation_terms: EquationTerms
    torque: np.ndarray
    """tau (nv,) [N m]"""
    external: np.ndarray
    """J^T w (nv,) [N m]"""
    acceleration: np.ndarray
    """q'' (nv,) [rad/s^2], by direct dynamics."""


class Dynamics(Lab[DynamicsParams, DynamicsState]):
    """An arm moved by its torques, its gravity and a force."""

    title = "Dynamics"
    section = "1.1.5"
    summary = (
        "The equation of motion of an arm, term by term: what inertia, Coriolis and gravity "
        "ask of the joints, solved for the motion and for the torque."
    )
    Params = DynamicsParams
    period = 0.01
    plots = (
        TimeSeries(
            "What the torque of a joint is spent on",
            "N·m",
            Line("inertia", r"M \ddot q"),
            Line("coriolis", r"C \dot q"),
            Line("gravity", "g"),
            Line("applied", r"\tau + J^T w", "dash"),
            select="joint",
            stacked=True,
            lead=1,
        ),
        Matrix("Mass matrix", "mass", "M(q)", "kg·m²", shade=True),
        Bars("Eigenvalues of the mass matrix", "eigenvalues", r"\lambda(M)", "kg·m²"),
        Matrix("Coriolis matrix", "coriolis_matrix", r"C(q, \dot q)", "kg·m²/s", shade=True),
        Matrix("Bias torques, column by column", "bias", r"C \dot q, \; g, \; h", "N·m"),
        Bars(
            "Torque for the accelerations asked for",
            "asked_torque",
            r"\tau = M a + h - J^T w",
            "N·m",
            limit="torque_limit",
        ),
        TimeSeries(
            "Energy", "J", Line("kinetic", "T"), Line("potential", "U"), Line("total", "T + U")
        ),
        TimeSeries("Acceleration", "rad/s²", Line("acceleration", r"\ddot q"), select="joint"),
        TimeSeries("Velocity", "rad/s", Line("v", r"\dot q"), select="joint"),
        Readout("there_and_back", "Inverse, then direct", "rad/s²"),
        Readout("back_and_there", "Direct, then inverse", "N·m"),
        Readout("residual", "Left − right side", "N·m"),
        Readout("total", "Energy T + U", "J"),
        Readout("power", "Power τ·q̇ + w·v", "W"),
        Readout("drift", "Energy no work explains", "J"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Free fall, double pendulum": {
            "robot": "double-pendulum",
            "drive": "none",
            "posture": "outstretched",
        },
        "Free fall, UR5": {"drive": "none"},
        "Torque sliders on a balanced arm": {"drive": "balanced", "damping": 5.0, "tau1": 4.0},
        "No gravity, set spinning": {"drive": "none", "gravity": False, "speed": 0.5},
        "Pulled by a force": {"drive": "balanced", "damping": 5.0, "fy": 15.0},
        "Panda": {"robot": "panda"},
    }

    def init(self, params: DynamicsParams, rng: np.random.Generator) -> DynamicsState:
        """At the posture chosen, every joint at the velocity chosen."""
        q = params.start
        tip = plant(params.robot).tip(q)
        v = np.full(len(q), params.speed)
        return DynamicsState(q=q, v=v, trail=np.tile(tip, (TRAIL, 1)))

    def step(self, params: DynamicsParams, inputs: Inputs, state: DynamicsState) -> DynamicsState:
        """10 ms of direct dynamics, the torque held during each integration step. Its work over
        such a step is tau . dq, and that of a constant force f . dp, exactly."""
        if state.trouble:
            return state
        world = _world(params.robot, params.payload, params.gravity)
        q, v, f = state.q, state.v, params.force
        held = np.zeros_like(v)
        acceleration = world.acceleration(held, force=(lambda tip: f) if f.any() else None)
        integrate, h = INTEGRATORS[params.integrator].step, params.step
        before = sum(world.energy(q, v)) - float(f @ world.tip(q))
        work = 0.0
        for k in range(round(self.period / h)):
            held[:] = _driving(params, world, q, v, state.t + k * h)
            start = q
            q, v = integrate(acceleration, q, v, h)
            work += float(held @ (q - start))
            if not float(v @ v) <= FASTEST**2:
                return _stopped(state)
        tip = world.tip(q)
        after = sum(world.energy(q, v)) - float(f @ tip)
        steps = state.steps + 1
        trail = state.trail.copy()
        if steps % TRAIL_EVERY == 0:
            trail[:-1], trail[-1] = state.trail[1:], tip
        return DynamicsState(
            t=steps * self.period,
            q=q,
            v=v,
            gained=state.gained + after - before - work,
            steps=steps,
            trail=trail,
        )

    def measure(self, params: DynamicsParams, state: DynamicsState) -> Measurement:
        """The equation at this instant, and its two problems undone by one another."""
        world, q, v = _world(params.robot, params.payload, params.gravity), state.q, state.v
        model, data = world.model, world.data
        now = _instant(params, world, state)
        kinetic, potential = world.energy(q, v)
        applied = now.torque + now.external
        inertia, coriolis = now.terms.mass @ now.acceleration, now.terms.coriolis @ v
        asked = params.accelerations(model.nv, state.t)
        found = direct_dynamics(model, data, q, v, inverse_dynamics(model, data, q, v, asked))
        again = inverse_dynamics(model, data, q, v, now.acceleration)
        return {
            "q": q,
            "v": v,
            "acceleration": now.acceleration,
            "torque": now.torque,
            "inertia": inertia,
            "coriolis": coriolis,
            "gravity": now.terms.gravity,
            "applied": applied,
            "kinetic": kinetic,
            "potential": potential,
            "total": kinetic + potential,
            "power": float(applied @ v),
            "drift": state.gained,
            "least_inertia": float(np.linalg.eigvalsh(now.terms.mass)[0]),
            "there_and_back": float(np.abs(found - asked).max()),
            "back_and_there": float(np.abs(again - applied).max()),
            "residual": float(np.abs(inertia + coriolis + now.terms.gravity - applied).max()),
        }

    def fields(self, params: DynamicsParams, state: DynamicsState) -> Mapping[str, np.ndarray]:
        """The terms as matrices, and the torque for the accelerations asked for."""
        world = _world(params.robot, params.payload, params.gravity)
        now = _instant(params, world, state)
        asked = params.accelerations(world.model.nv, state.t)
        needed = inverse_dynamics(world.model, world.data, state.q, state.v, asked) - now.external
        coriolis, gravity = now.terms.coriolis @ state.v, now.terms.gravity
        return {
            "mass": now.terms.mass,
            "coriolis_matrix": now.terms.coriolis,
            "bias": np.stack([coriolis, gravity, now.terms.bias(state.v)], axis=1),
            "eigenvalues": np.linalg.eigvalsh(now.terms.mass)[::-1],
            "asked_torque": needed,
            "torque_limit": world.arm.torque_limit,
        }

    def draw(self, scene: Scene, params: DynamicsParams, state: DynamicsState) -> None:
        """The arm, where its end-effector was, the force, the payload and a torque arc at every
        joint."""
        world = _world(params.robot, params.payload, params.gravity)
        arm = world.arm
        tau = _driving(params, world, state.q, state.v, state.t)
        tip = world.tip(state.q)
        jacobians = pin.computeJointJacobians(world.model, world.data, state.q)
        scene.camera(*CAMERA[params.robot])
        scene.arm("robot", arm, state.q, effort=np.abs(tau) / arm.torque_limit)
        for i, share in enumerate(tau / arm.torque_limit):
            if abs(angle := FULL_ARC * share) > 0.03:
                angle = float(np.clip(angle, -LONGEST_ARC, LONGEST_ARC))
                center = world.data.oMi[i + 1].translation
                scene.arc(f"torque {i + 1}", center, jacobians[3:, i], angle, 0.13)
        if state.steps >= TRAIL_EVERY:
            scene.trail("trail", state.trail[-min(state.steps // TRAIL_EVERY + 1, TRAIL) :])
        if params.payload > 0.0:
            scene.sphere("payload", tip, 0.03 * params.payload ** (1 / 3), "muted")
        if params.force.any():
            scene.arrow("force", tip, tip + ARROW * params.force, "reference")


@lru_cache(maxsize=16)
def _world(robot: str, payload: float, gravity: bool) -> Plant:
    world = plant(robot, payload)
    if gravity:
        return world
    model = world.model.copy()
    model.gravity = pin.Motion.Zero()
    return Plant(world.arm, model, model.createData())


def _driving(
    params: DynamicsParams, world: Plant, q: np.ndarray, v: np.ndarray, t: float
) -> np.ndarray:
    """tau (nv,) [N m]: the sliders, and what drives the joints."""
    model, data = world.model, world.data
    tau = params.torques(model.nv) - params.damping * v
    if params.drive == "balanced":
        tau += pin.computeGeneralizedGravity(model, data, q)
    elif params.drive == "inverse":
        tau += inverse_dynamics(model, data, q, v, params.accelerations(model.nv, t))
        if params.force.any():
            tau -= world.tip_jacobian(q).T @ params.force
    return tau


def _instant(params: DynamicsParams, world: Plant, state: DynamicsState) -> Instant:
    q, v = state.q, state.v
    torque = _driving(params, world, q, v, state.t)
    external = world.tip_jacobian(q).T @ params.force
    return Instant(
        equation_terms(world.model, world.data, q, v),
        torque,
        external,
        direct_dynamics(world.model, world.data, q, v, torque + external),
    )


def _stopped(state: DynamicsState) -> DynamicsState:
    stopped = copy.deepcopy(state)
    stopped.trouble = (
        f"Stopped at t = {state.t:.2f} s: a joint passed {FASTEST:g} rad/s. Nothing brakes these "
        "joints: take torque or force away, or shorten the integration step, and start anew."
    )
    return stopped
