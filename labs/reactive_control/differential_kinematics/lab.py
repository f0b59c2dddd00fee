"""Differential kinematics (notes, 1.1.3): from joint velocities to the end-effector's, and back."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from labs.algorithms.inverse_kinematics import REACH_TOLERANCE, joint_rates, scale_to_speed_limit
from labs.algorithms.jacobian import (
    analytical_jacobian,
    geometric_jacobian,
    geometric_jacobian_rate,
)
from labs.lab import Handle, Inputs, Lab, Measurement, State
from labs.models.arms import Arm
from labs.params import Value
from labs.reactive_control.differential_kinematics.params import DifferentialParams
from labs.reactive_control.differential_kinematics.picture import (
    CAMERA,
    draw_columns,
    draw_ellipsoids,
    draw_out_of_reach,
    draw_twist,
    draw_warning,
)
from labs.reactive_control.differential_kinematics.plots import (
    PLOTS,
    jacobian_fields,
    reach_note,
    singular_values,
)
from labs.reactive_control.differential_kinematics.target import (
    TARGET_PERIOD,
    nearest_reachable,
    target_motion,
    task_velocity,
)
from labs.scene import Scene

SINGULARITY_WARNING = 0.05
"""A smallest singular value below this is called near a singularity."""
REACH_CHECK_DELAY = 10
"""World steps a target's way stays as it is before it is asked whether it is within reach."""
MAX_CONDITION = 1e6
"""Shown for any condition number beyond it."""


@dataclass(kw_only=True)
class DifferentialState(State):
    """The arm and its target. Arrays are never written after they are made."""

    q: np.ndarray
    posture: np.ndarray
    """(n,) what the sliders last said: when they say something else, the arm goes there."""
    commanded: np.ndarray
    """(n,) [rad/s] what inverse kinematics asked for."""
    applied: np.ndarray
    """(n,) [rad/s] what of it the motors and end stops let through."""
    task_speed: float = 0.0
    """|v| of the task velocity [m/s, with rad/s]."""
    anchor: np.ndarray
    """(3,) [m] where the target was put last."""
    orientation: np.ndarray
    """(3, 3) the target's orientation."""
    clock: float = 0.0
    """Time since the target was put there [s]."""
    peak: float = 0.0
    """Largest |q'| commanded so far [rad/s]."""
    farthest: np.ndarray
    """(3,) [m] where the target's way leads to; where it is, if it rests."""
    settled: int = 0
    """World steps since that changed."""
    nearest: float = 0.0
    """[m] how near to it the frame can come, as far as is known."""


class DifferentialKinematics(Lab[DifferentialParams, DifferentialState]):
    """An arm, its Jacobians, and a target it follows."""

    title = "Differential kinematics"
    section = "1.1.3"
    summary = (
        "See how every joint moves the end-effector: geometric and analytical Jacobian, "
        "manipulability, and inverse kinematics near a singularity."
    )
    Params = DifferentialParams
    period = 0.01
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Follow the ball": {"mode": "follow", "columns": "none"},
        "Panda, seven joints": {"robot": "panda", "dq1": 0.0, "dq3": 0.5},
        "SCARA": {"robot": "scara", "dq3": 0.2},
        "Stretched arm": {"q2": 0.7, "q3": -1.55},
        "Wrist of the UR5 aligned": {"task": "pose", "q5": 1.57},
    }
    handles = (Handle("target", "The end-effector's target."),)

    def init(self, params: DifferentialParams, rng: np.random.Generator) -> DifferentialState:
        """As posed, the target at the frame."""
        q = params.posture
        here = params.kinematics.at(q).placement
        still = np.zeros_like(q)
        return DifferentialState(
            q=q,
            posture=q,
            commanded=still,
            applied=still,
            anchor=here.translation.copy(),
            orientation=here.rotation.copy(),
            farthest=here.translation.copy(),
        )

    def step(
        self, params: DifferentialParams, inputs: Inputs, state: DifferentialState
    ) -> DifferentialState:
        """10 ms of resolved-rate inverse kinematics, or of the velocities on the sliders."""
        posture = params.posture
        q = _posture(params, state)
        chain = params.kinematics.at(q)
        anchor, orientation, clock = state.anchor, state.orientation, state.clock
        held = inputs.handles.get("target")
        if params.mode != "follow" or q is not state.q:
            anchor, orientation, clock = chain.placement.translation, chain.placement.rotation, 0.0
        elif held is not None:
            anchor, clock = np.array(held), 0.0

        v, commanded = np.zeros(params.rows), np.zeros_like(q)
        applied = commanded
        if params.mode == "follow":
            v = task_velocity(params, chain, anchor, orientation, clock)[: params.rows]
            jacobian = geometric_jacobian(chain)[: params.rows]
            commanded = joint_rates(params.method, jacobian, v, params.damping)
            applied = scale_to_speed_limit(commanded, params.fastest)
        elif params.mode == "velocity":
            commanded = applied = params.rates
        applied = _stop_at_limits(params.arm, q, applied)
        model = params.arm.model
        moved = q + self.period * applied
        speed = float(np.linalg.norm(commanded))
        farthest, _ = target_motion(params, anchor, TARGET_PERIOD / 2)
        settled = state.settled + 1 if np.array_equal(farthest, state.farthest) else 0
        nearest = state.nearest if settled else 0.0
        if settled == REACH_CHECK_DELAY and params.mode == "follow":
            nearest = nearest_reachable(params, farthest, q)
        return DifferentialState(
            t=state.t + self.period,
            q=np.clip(moved, model.lowerPositionLimit, model.upperPositionLimit),
            posture=posture,
            commanded=commanded,
            applied=applied,
            task_speed=float(np.linalg.norm(v)),
            anchor=anchor.copy(),
            orientation=orientation.copy(),
            clock=clock + self.period if params.mode == "follow" and held is None else 0.0,
            peak=max(state.peak, speed) if params.mode == "follow" else 0.0,
            farthest=farthest,
            settled=settled,
            nearest=nearest,
        )

    def measure(self, params: DifferentialParams, state: DifferentialState) -> Measurement:
        """Velocities are those on the sliders unless a target is followed. Singular values mix
        rows in m and in rad: they weigh 1 m as 1 rad."""
        chain = params.kinematics.at(_posture(params, state))
        jacobian = geometric_jacobian(chain)
        sigma, product = singular_values(params, chain, jacobian)
        rates = _joint_velocities(params, state)
        follows = params.mode == "follow"
        commanded = state.commanded if follows else rates
        target, _ = target_motion(params, state.anchor, state.clock)
        bias = geometric_jacobian_rate(chain, rates)[:3] @ rates
        short = {"short": state.nearest} if follows and state.nearest > REACH_TOLERANCE else {}
        return short | {
            "q": _posture(params, state),
            "rates": commanded,
            "speed": float(np.linalg.norm(commanded)),
            "speed_given": float(np.linalg.norm(rates)),
            "bound": state.task_speed / (2.0 * params.damping),
            "error": float(np.linalg.norm(target - chain.placement.translation))
            if follows
            else 0.0,
            "tip_speed": float(np.linalg.norm(jacobian[:3] @ rates)),
            "omega": float(np.linalg.norm(jacobian[3:] @ rates)),
            "rpy": float(np.linalg.norm(analytical_jacobian(chain, jacobian)[3:] @ rates)),
            "sigma_min": float(sigma[-1]),
            "near": SINGULARITY_WARNING,
            "manipulability": product,
            "condition": min(float(sigma[0]) / max(float(sigma[-1]), 1e-12), MAX_CONDITION),
            "peak": state.peak,
            "bias": float(np.linalg.norm(bias)),
        }

    def fields(
        self, params: DifferentialParams, state: DifferentialState
    ) -> Mapping[str, np.ndarray]:
        """The Jacobians, (6, n); the twist and the rate of the pose, (6, 2)."""
        chain = params.kinematics.at(_posture(params, state))
        return jacobian_fields(params, chain, _joint_velocities(params, state))

    def notes(self, params: DifferentialParams, state: DifferentialState) -> Mapping[str, str]:
        """Whether the target can be reached."""
        return {"within_reach": reach_note(params, state.nearest)}

    def draw(self, scene: Scene, params: DifferentialParams, state: DifferentialState) -> None:
        """The arm, the Jacobian's columns, the twist, ellipsoids, the target and a warning."""
        q = _posture(params, state)
        chain = params.kinematics.at(q)
        jacobian = geometric_jacobian(chain)
        tip = chain.placement.translation
        scene.camera(*CAMERA)
        scene.arm("robot", params.arm, q)
        scene.frame("frame", chain.placement, 0.12)
        draw_columns(scene, params.columns, chain, jacobian)
        draw_twist(scene, tip, jacobian @ _joint_velocities(params, state))
        draw_ellipsoids(scene, params.ellipsoid, tip, jacobian[:3])
        if params.mode == "follow":
            target, _ = target_motion(params, state.anchor, state.clock)
            scene.handle("target", target)
            if state.nearest > REACH_TOLERANCE:
                draw_out_of_reach(scene, state.farthest, state.nearest)
            if params.reach > 0.0:
                end, _ = target_motion(params, state.anchor, TARGET_PERIOD / 2)
                scene.trail("path", np.array([state.anchor, end]), "reference")
        sigma, _ = singular_values(params, chain, jacobian)
        if sigma[-1] < SINGULARITY_WARNING:
            draw_warning(scene, tip, float(sigma[-1]))


def _posture(params: DifferentialParams, state: DifferentialState) -> np.ndarray:
    """Where the arm is: where a slider moved it if one has moved since the last step."""
    posture = params.posture
    return state.q if np.array_equal(posture, state.posture) else posture


def _joint_velocities(params: DifferentialParams, state: DifferentialState) -> np.ndarray:
    """(n,) [rad/s; m/s] the joint velocities the twist belongs to."""
    match params.mode:
        case "follow":
            return state.applied
        case "velocity":
            return _stop_at_limits(params.arm, _posture(params, state), params.rates)
        case _:
            return params.rates


def _stop_at_limits(arm: Arm, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """`rates` (n,) but zero where a joint stands at its end stop and would go on."""
    model = arm.model
    stuck = (q >= model.upperPositionLimit) & (rates > 0.0)
    stuck |= (q <= model.lowerPositionLimit) & (rates < 0.0)
    return np.where(stuck, 0.0, rates)
