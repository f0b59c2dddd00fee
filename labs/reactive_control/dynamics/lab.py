"""Dynamics (notes, 1.1.5): the equation of motion of an arm, its terms and its two problems."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from labs.algorithms.equation_of_motion import direct_dynamics, inverse_dynamics
from labs.algorithms.integrators import INTEGRATORS
from labs.lab import Inputs, Lab, Measurement, State
from labs.models.plant import Plant, plant
from labs.params import Value
from labs.reactive_control.dynamics.equation import (
    InstantaneousDynamics,
    drive_torque,
    plant_under_gravity,
)
from labs.reactive_control.dynamics.params import DynamicsParams
from labs.reactive_control.dynamics.plots import PLOTS, plot_fields
from labs.scene import Scene
from labs.tasks.arm.torque_arcs import draw_torque_arcs
from labs.tasks.arm.trail import TRAIL_POINTS, TRAIL_STRIDE, append_row, draw_trail

SPEED_LIMIT = 100.0
"""[rad/s] a joint faster than this has left what an arm can do."""
FORCE_ARROW = 1.0 / 250.0
"""[m/N] length of the force's arrow."""
CAMERA = {
    "ur5": ((1.1, -0.95, 0.8), (0.25, 0.05, 0.42)),
    "panda": ((1.1, -1.0, 0.9), (0.2, 0.03, 0.47)),
    "double-pendulum": ((2.1, 0.6, 1.25), (0.0, 0.15, 1.1)),
}


@dataclass(kw_only=True)
class DynamicsState(State):
    """The arm, and the balance of its energy. Arrays are never written after they are made."""

    q: np.ndarray
    v: np.ndarray
    energy_drift: float = 0.0
    """[J] energy the arm has that no work explains: the integrator's error."""
    steps: int = 0
    trail: np.ndarray
    """(TRAIL_POINTS, 3) [m] where the end-effector was, the newest last."""


class ArmDynamics(Lab[DynamicsParams, DynamicsState]):
    """An arm moved by its torques, its gravity and a force."""

    title = "Dynamics"
    section = "1.1.5"
    summary = (
        "The equation of motion of an arm, term by term: what inertia, Coriolis and gravity "
        "ask of the joints, solved for the motion and for the torque."
    )
    Params = DynamicsParams
    period = 0.01
    plots = PLOTS
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
        return DynamicsState(q=q, v=v, trail=np.tile(tip, (TRAIL_POINTS, 1)))

    def step(self, params: DynamicsParams, inputs: Inputs, state: DynamicsState) -> DynamicsState:
        """10 ms of direct dynamics, the torque held during each integration step. Its work over
        such a step is tau . dq, and that of a constant force f . dp, exactly."""
        if state.trouble:
            return state
        world = _plant(params)
        q, v, f = state.q, state.v, params.force
        held = np.zeros_like(v)
        acceleration = world.acceleration(held, force=(lambda tip: f) if f.any() else None)
        integrate, h = INTEGRATORS[params.integrator].step, params.step
        before = sum(world.energy(q, v)) - float(f @ world.tip(q))
        work = 0.0
        for k in range(round(self.period / h)):
            held[:] = drive_torque(params, world, q, v, state.t + k * h)
            start = q
            q, v = integrate(acceleration, q, v, h)
            work += float(held @ (q - start))
            if not float(v @ v) <= SPEED_LIMIT**2:
                return _stop_diverged(state)
        tip = world.tip(q)
        after = sum(world.energy(q, v)) - float(f @ tip)
        steps = state.steps + 1
        due = steps % TRAIL_STRIDE == 0
        return DynamicsState(
            t=steps * self.period,
            q=q,
            v=v,
            energy_drift=state.energy_drift + after - before - work,
            steps=steps,
            trail=append_row(state.trail, tip) if due else state.trail.copy(),
        )

    def measure(self, params: DynamicsParams, state: DynamicsState) -> Measurement:
        """The equation at this instant, and its two problems undone by one another."""
        world, q, v = _plant(params), state.q, state.v
        model, data = world.model, world.data
        now = InstantaneousDynamics.of(params, world, q, v, state.t)
        kinetic, potential = world.energy(q, v)
        applied = now.torque + now.external
        inertia, coriolis = now.terms.mass @ now.acceleration, now.terms.coriolis @ v
        asked = params.accelerations(model.nv, state.t)
        found = direct_dynamics(model, data, q, v, inverse_dynamics(model, data, q, v, asked))
        again = inverse_dynamics(model, data, q, v, now.acceleration)
        return _force_acceleration_angle(params.force, world.tip_jacobian(q) @ now.acceleration) | {
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
            "drift": state.energy_drift,
            "first_inertia": float(now.terms.mass[0, 0]),
            "least_inertia": float(np.linalg.eigvalsh(now.terms.mass)[0]),
            "there_and_back": float(np.abs(found - asked).max()),
            "back_and_there": float(np.abs(again - applied).max()),
            "residual": float(np.abs(inertia + coriolis + now.terms.gravity - applied).max()),
        }

    def fields(self, params: DynamicsParams, state: DynamicsState) -> Mapping[str, np.ndarray]:
        """The terms as matrices, and the torque for the accelerations asked for."""
        return plot_fields(params, _plant(params), state.q, state.v, state.t)

    def draw(self, scene: Scene, params: DynamicsParams, state: DynamicsState) -> None:
        """The arm, where its end-effector was, the force, the payload and a torque arc at every
        joint."""
        world = _plant(params)
        arm = world.arm
        tau = drive_torque(params, world, state.q, state.v, state.t)
        tip = world.tip(state.q)
        scene.camera(*CAMERA[params.robot])
        scene.arm("robot", arm, state.q, effort=np.abs(tau) / arm.torque_limit)
        draw_torque_arcs(scene, world, state.q, tau)
        draw_trail(scene, "trail", state.trail, state.steps)
        if params.payload > 0.0:
            scene.sphere("payload", tip, 0.03 * params.payload ** (1 / 3), "muted")
        if params.force.any():
            scene.arrow("force", tip, tip + FORCE_ARROW * params.force, "reference")


def _plant(params: DynamicsParams) -> Plant:
    return plant_under_gravity(params.robot, params.payload, params.gravity)


def _force_acceleration_angle(
    force: np.ndarray, acceleration: np.ndarray
) -> dict[str, float | np.ndarray]:
    """The angle [degrees] between the force on the end-effector and its acceleration J q'', both
    (3,); none where there is no force or no acceleration."""
    sizes = float(np.linalg.norm(force) * np.linalg.norm(acceleration))
    if sizes < 1e-9:
        return {}
    cosine = float(force @ acceleration) / sizes
    return {"apart": float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))}


def _stop_diverged(state: DynamicsState) -> DynamicsState:
    stopped = copy.deepcopy(state)
    stopped.trouble = (
        f"Stopped at t = {state.t:.2f} s: a joint passed {SPEED_LIMIT:g} rad/s. Nothing brakes "
        "these joints: take torque or force away, or shorten the integration step, and start anew."
    )
    return stopped
