"""Tracking with the linear quadratic regulator (notes, 2.4.3 to 2.4.5): gains that vary with time,
the affine term k_t, and what it is worth to know the reference before it moves."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from labs.algorithms.riccati import prepare
from labs.lab import Action, Handle, Inputs, Lab, Measurement, State
from labs.models.coordinates import coordinate_labels
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import Mechanism, mechanism
from labs.optimal_control.lqr_tracking.laps import (
    CONTROL_PERIOD,
    INTEGRATION_METHOD,
    side_force,
    tracked_point,
)
from labs.optimal_control.lqr_tracking.params import TrackingParams
from labs.optimal_control.lqr_tracking.picture import CART_TRAIL, draw_tracking
from labs.optimal_control.lqr_tracking.plots import PLOTS, preview_fields
from labs.optimal_control.lqr_tracking.tracking import COSTED_JOINT, full_preview, reference_lap
from labs.params import Value
from labs.scene import Scene

LARGEST_DEVIATION = np.pi / 2
"""[rad; m] off its reference a joint is lost: a linearisation says nothing there."""
PUSH_STEPS = 10
"""World steps a push lasts: 0.2 s."""
ACROSS, UPWARD = 1, 2
"""The world's axes of a cart and of a path in the horizontal plane, and of the others."""


@dataclass(kw_only=True)
class TrackingState(State):
    """The robot and its ghost. Arrays are never written after they are made."""

    x: np.ndarray
    ghost: np.ndarray
    """(nx,) each: under u_ref + K dx + k, and under u_ref + K dx."""
    phase: float = 0.0
    """Of the lap [cycles]."""
    cost_settings: str = ""
    """What the costs below were paid for."""
    costs: np.ndarray
    """(2, steps) of robot and ghost in the last steps, at most those of a lap."""
    push_left: int = 0
    """World steps the push still lasts."""
    force: float = 0.0
    """[N] along y in the last step: wind and push."""
    trails: np.ndarray
    """(2, k, 3) [m] where robot and ghost were, the newest last."""


class LqrTracking(Lab[TrackingParams, TrackingState]):
    """A robot follows a reference that it sees some way ahead; its ghost, only the present."""

    title = "LQR along a reference"
    section = "2.4.3"
    summary = (
        "Linearise along a motion and follow it: time-varying gains, the affine term, and a "
        "policy that moves before its reference does."
    )
    Params = TrackingParams
    period = CONTROL_PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Square with cut corners": {
            "path": "square",
            "feed_forward": "inverse-dynamics",
            "effort_weight": 300.0,
        },
        "Inverse dynamics": {"feed_forward": "inverse-dynamics", "lap_time": 1.5},
        "Cart-pole, jumping reference": {"robot": "cart-pole", "path": "square", "lap_time": 4.0},
        "Cart-pole, sine": {"robot": "cart-pole"},
    }
    actions = (
        Action("push", "Push", "Pushes robot and ghost for 0.2 s; nobody knows before.", "World"),
    )
    handles = (Handle("size", "Makes the path larger or smaller."),)

    @classmethod
    def prepare(cls) -> None:
        """Compiles the recursion and loads both robots."""
        prepare()
        for robot in COSTED_JOINT:
            full_preview(TrackingParams(robot=robot).settings)

    def init(self, params: TrackingParams, rng: np.random.Generator) -> TrackingState:
        """Robot and ghost on the reference."""
        lap = reference_lap(params.settings)
        x = lap.x_ref[0].copy()
        return TrackingState(
            x=x,
            ghost=x.copy(),
            cost_settings=str(params.settings),
            costs=np.zeros((2, 0)),
            trails=np.tile(lap.points[0], (2, 1, 1)),
        )

    def step(self, params: TrackingParams, inputs: Inputs, state: TrackingState) -> TrackingState:
        """One control period. Where one diverges both stay where they were, and the world stops."""
        if state.trouble:
            return state
        now = params.policy_at(state.phase)
        world = mechanism(params.robot, params.payload)
        push_left = PUSH_STEPS if "push" in inputs.actions else state.push_left
        force = params.wind + (params.push_force if push_left > 0 else 0.0)
        after, costs = [], []
        for x, k in ((state.x, now.k), (state.ghost, np.zeros_like(now.k))):
            dx = x - now.x_ref
            du = now.gain @ dx + k
            after.append(_next_state(world, x, now.u_ref + du, force))
            costs.append(now.cost(dx, du))
        phase = now.index + 1
        x_ref = now.lap.x_ref[phase % params.samples]
        if trouble := _divergence_message(state.t, after, x_ref):
            stopped = copy.deepcopy(state)
            stopped.trouble = trouble
            return stopped

        settings = str(params.settings)
        paid = state.costs if settings == state.cost_settings else np.zeros((2, 0))
        tips = np.stack([tracked_point(world, x[: world.nq]) for x in after])
        return TrackingState(
            t=state.t + self.period,
            x=after[0],
            ghost=after[1],
            phase=phase / params.samples % 1.0,
            cost_settings=settings,
            costs=np.column_stack([paid, costs])[:, -params.samples :],
            push_left=max(push_left - 1, 0),
            force=force,
            trails=np.concatenate([state.trails, tips[:, None]], axis=1)[:, -CART_TRAIL:],
        )

    def measure(self, params: TrackingParams, state: TrackingState) -> Measurement:
        """At the state's time, with the control of the step to come. Errors are those of the
        end-effector, or the cart; p is its height, or y where it stays at one height. Costs are
        sums over the last lap, or as much of it as was driven since the settings changed."""
        now = params.policy_at(state.phase)
        world = mechanism(params.robot)
        q, ghost, q_ref = (x[: world.nq] for x in (state.x, state.ghost, now.x_ref))
        goal = now.lap.points[now.index]
        tip, ghost_tip = tracked_point(world, q), tracked_point(world, ghost)
        axis = UPWARD if params.robot == "ur5" and params.plane != "horizontal" else ACROSS
        feedback = now.gain @ (state.x - now.x_ref)
        cost, ghost_cost = state.costs.sum(axis=1)
        measured: dict[str, float | np.ndarray] = {
            "q": q,
            "q_ref": q_ref,
            "p": float(tip[axis]),
            "p_ref": float(goal[axis]),
            "p_ghost": float(ghost_tip[axis]),
            "error": float(np.linalg.norm(tip - goal)),
            "ghost_error": float(np.linalg.norm(ghost_tip - goal)),
            "u": now.u_ref + feedback + now.k,
            "u_ref": now.u_ref,
            "feedback": feedback,
            "affine": now.k,
            "lap_cost": float(cost),
            "ghost_lap_cost": float(ghost_cost),
            "optimum": round(full_preview(params.settings).lap_cost, 10),  # no rounding errors
        }
        if state.costs.shape[1] == params.samples:
            measured |= {"lap_paid": float(cost), "ghost_lap_paid": float(ghost_cost)}
        return measured

    def fields(self, params: TrackingParams, state: TrackingState) -> Mapping[str, np.ndarray]:
        """The gain now, and over the preview k and the gains of one motor."""
        return preview_fields(params.policy_at(state.phase), COSTED_JOINT[params.robot])

    def labels(self, params: TrackingParams) -> Mapping[str, str | tuple[str, ...]]:
        first = "cart" if params.robot == "cart-pole" else "shoulder"
        return coordinate_labels(mechanism(params.robot)) | {"first_motor": first}

    def edit(
        self, params: TrackingParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The ball on the path makes it larger or smaller."""
        if handle != "size":
            return {}
        if params.robot == "cart-pole":
            return {"stroke": params.nearest("stroke", abs(point[1]))}
        arm = mechanism("ur5")
        distance = np.linalg.norm(np.array(point) - arm.tip(arm.arm.home))
        return {"radius": params.nearest("radius", float(distance))}

    def draw(self, scene: Scene, params: TrackingParams, state: TrackingState) -> None:
        """Robot and ghost, the reference, the plan, and the past."""
        now = params.policy_at(state.phase)
        states = (state.x, state.ghost)
        draw_tracking(scene, params, now, states, state.force, state.trails)


def _next_state(world: Mechanism, x: np.ndarray, u: np.ndarray, force: float) -> np.ndarray:
    """x+ under the control and a force [N] along y."""
    held = u + side_force(world, x[: world.nq], force)
    return DiscreteMechanism(world, CONTROL_PERIOD, INTEGRATION_METHOD).step(x, held)


def _divergence_message(t: float, after: list[np.ndarray], x_ref: np.ndarray) -> str:
    """A sentence once robot or ghost are too far off for any linearisation; else empty."""
    nq = len(x_ref) // 2
    for name, x in zip(("robot", "ghost"), after, strict=True):
        off = np.abs(x - x_ref)[:nq]
        if not (np.isfinite(x).all() and off.max() <= LARGEST_DEVIATION):
            joint = int(np.argmax(off)) + 1
            return (
                f"Lost at t = {t:.2f} s: joint {joint} of the {name} is more than "
                f"{LARGEST_DEVIATION:.2f} rad or m off its reference, where the linearisation says "
                "nothing. Make the reference slower or smaller, the forces weaker, or the weight "
                "of the effort lower, and reset."
            )
    return ""
