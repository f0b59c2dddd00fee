"""Model predictive control of robots (notes, 2.5, 2.5.4): a plan at every period, of which the
first control acts."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from labs.algorithms import mpc
from labs.algorithms.mpc import RecedingHorizonState
from labs.lab import Action, Handle, Inputs, Lab, Measurement, State
from labs.models.coordinates import coordinate_labels
from labs.models.mechanisms import mechanism
from labs.optimal_control.mpc.controller import control_step, cost_terms, planner_of
from labs.optimal_control.mpc.history import PlanningHistory
from labs.optimal_control.mpc.params import MpcParams
from labs.optimal_control.mpc.picture import draw_goal, draw_limits, draw_predictions, draw_robot
from labs.optimal_control.mpc.plots import (
    PHASES,
    PLOTS,
    TIMED_PLANS,
    horizon_note,
    limit_fields,
    prediction_fields,
    time_fields,
    time_note,
)
from labs.optimal_control.mpc.systems import dynamics
from labs.params import Value
from labs.problems.receding_horizon import Plan
from labs.scene import Scene

WORLD_PERIOD = 0.01
"""[s] of the world's clock; a period of the controller is a whole number of them."""
LARGEST_VELOCITY = 200.0
"""[rad/s; m/s] a run with a faster joint has diverged."""
ARROW_STEPS = 30
"""World steps the arrow of a push stays."""


@dataclass(kw_only=True)
class MpcState(State):
    """The robot, its controller and what was predicted."""

    x: np.ndarray
    """(nx,)"""
    hold_start: np.ndarray
    """(nx,) where the present control began to act undisturbed,"""
    hold_steps: int = 0
    """so many world steps ago."""
    period_steps: int = 0
    """World steps since the period began."""
    target: np.ndarray
    """(3,) [m] where the target was when the period began."""
    controller: RecedingHorizonState
    cost_terms: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """(3,) what position, velocity and control cost in the last period."""
    excess: float = 0.0
    """By how much the last plan exceeds soft limits."""
    gap: float | None = None
    iterations: int = 0
    history: PlanningHistory
    arrow_steps_left: int = 0
    """World steps the arrow of a push still stays."""
    clock: int = 0
    """World steps done: t = clock * WORLD_PERIOD."""


class Mpc(Lab[MpcParams, MpcState]):
    """A robot that plans its next moments anew at every period."""

    title = "Model predictive control"
    section = "2.5"
    summary = (
        "Drag a target and a UR5 replans a hundred times a second within its limits: see what it "
        "predicts, and what it then does."
    )
    Params = MpcParams
    period = WORLD_PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "UR5, a target that moves": {"turns": 0.25},
        "UR5, fast joints": {"v_limit": 3.1},
        "UR5, round an obstacle": {"obstacle": True},
        "Cart-pole": {"system": "cart-pole", "h": 0.02, "steps": 40.0, "v_limit": 3.0},
        "Double pendulum": {"system": "double-pendulum", "h": 0.02, "v_limit": 8.0},
    }
    actions = (Action("push", "Push", "Strikes the tip along y.", "World"),)
    handles = (
        Handle("target", "Where the tip, or the cart, should be."),
        Handle("obstacle", "What the tip of the UR5 must not enter."),
    )

    def init(self, params: MpcParams, rng: np.random.Generator) -> MpcState:
        at = params.robot
        return MpcState(
            x=at.x0,
            hold_start=at.x0,
            target=params.target_at(0.0),
            controller=mpc.init(params.options, at.brake(at.x0)),
            history=PlanningHistory(at.x0[None]),
        )

    def edit(
        self, params: MpcParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The balls are the target and the obstacle."""
        if handle == "obstacle":
            names = ("obstacle_x", "obstacle_y", "obstacle_z")
        elif handle == "target" and params.system == "cart-pole":
            return {"cart": params.nearest("cart", point[1])}
        elif handle == "target" and params.system == "double-pendulum":
            return {
                "tip_y": params.nearest("tip_y", point[1]),
                "tip_z": params.nearest("tip_z", point[2]),
            }
        elif handle == "target":
            names = ("target_x", "target_y", "target_z")
        else:
            return {}
        return {name: params.nearest(name, x) for name, x in zip(names, point, strict=True)}

    def step(self, params: MpcParams, inputs: Inputs, state: MpcState) -> MpcState:
        """10 ms: a plan where a period begins, and the plant under the control that acts."""
        if state.trouble:
            return state
        state = replace(state, arrow_steps_left=max(state.arrow_steps_left - 1, 0))
        if "push" in inputs.actions:
            state = _apply_impulse(params, state)
        if state.period_steps == 0:
            state = self._start_period(params, state)
        clock = state.clock + 1
        state = replace(state, clock=clock, t=clock * WORLD_PERIOD)
        if params.mode == "plan":
            return replace(state, period_steps=0, history=state.history.append_state(state.x))
        held, elapsed = state.hold_steps + 1, state.period_steps + 1
        plant = dynamics(params.system, held * WORLD_PERIOD, params.payload)
        with np.errstate(all="ignore"):
            x = plant.step(state.hold_start, state.controller.u)
        if not np.abs(x[params.robot.n :]).max() < LARGEST_VELOCITY:
            return replace(
                state,
                trouble=f"The robot went out of control at t = {state.t:.2f} s. Reset, and give it "
                "more control, a longer horizon or less delay.",
            )
        state = replace(
            state, x=x, hold_steps=held, period_steps=elapsed, history=state.history.append_state(x)
        )
        if elapsed * WORLD_PERIOD > params.h - 0.5 * WORLD_PERIOD:
            return replace(state, hold_start=x, hold_steps=0, period_steps=0)
        return state

    def _start_period(self, params: MpcParams, state: MpcState) -> MpcState:
        """The start of a period."""
        aim = params.target_at(state.t)
        reference = planner_of(params, aim).problem
        dx = state.x - reference.x_ref
        final = float(0.5 * dx @ reference.Q_f @ dx)
        history = state.history.start_period(state.x, state.t, float(state.cost_terms.sum()), final)
        at, said = control_step(params, aim, state.controller, state.x)
        if said and said.found:
            lead = params.delay * params.h if params.compensate and params.mode == "both" else 0.0
            history = history.append_plan(said, state.t + lead, params.h)
        acts = params.mode != "plan"
        terms = cost_terms(params, aim, state.x, at.u) if acts else np.zeros(3)
        return replace(
            state,
            target=aim,
            controller=at,
            history=history,
            cost_terms=terms,
            excess=said.violation if said else state.excess,
            gap=said.gap if said else state.gap,
            iterations=said.iterations if said else 0,
            seconds=_append_durations(state.seconds, said),
        )

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: MpcParams, state: MpcState) -> Measurement:
        """The robot, its limits, and numbers of plan and motion."""
        at, u, history = params.robot, state.controller.u, state.history
        goal = planner_of(params, state.target).problem.x_ref[: at.n]
        x_lower, x_upper, u_max = params.bounds
        q, v = state.x[: at.n], state.x[at.n :]
        excess = np.maximum(state.x - x_upper, x_lower - state.x).max()
        if params.ball:
            depth = params.ball.radius - np.linalg.norm(at.mechanism.tip(q) - params.ball.center)
            excess = max(float(excess), float(depth))
        wanted = state.target if params.system != "cart-pole" else at.mechanism.tip(goal)
        found: dict[str, float | np.ndarray] = {
            "q": q,
            "goal": goal,
            "v": v,
            "u": u,
            "share": np.abs(u) / u_max,
            "one": np.ones(len(u)),
            "cost_q": state.cost_terms[0] / params.h,
            "cost_v": state.cost_terms[1] / params.h,
            "cost_u": state.cost_terms[2] / params.h,
            "miss": float(np.linalg.norm(at.mechanism.tip(q) - wanted)),
            "exceeded": float(max(excess, 0.0)),
            "paid": history.cost,
            "off_first": history.deviation_from_first,
            "iterations": float(state.iterations),
            "failures": float(state.controller.failures),
        }
        plan = state.controller.plan
        if plan:
            found["active"] = float(sum(rows.sum() for rows in plan.active.values()))
            found["value"] = plan.cost
        optional = {
            "promised": history.predicted_cost,
            "over_horizon": history.horizon_cost,
            "gap": state.gap,
        }
        return found | {name: x for name, x in optional.items() if x is not None}

    def fields(self, params: MpcParams, state: MpcState) -> Mapping[str, np.ndarray]:
        """What was and is predicted, the limits that are active, and the time it took."""
        return (
            prediction_fields(state.history, state.t, params.robot.shown)
            | limit_fields(state.controller.plan, params)
            | time_fields(state.seconds, params.h)
        )

    def notes(self, params: MpcParams, state: MpcState) -> Mapping[str, str]:
        said = [
            state.controller.status or "Plans are found.",
            time_note(state.seconds, params.h),
            horizon_note(params),
        ]
        return {"said": "\n".join(filter(None, said))}

    def labels(self, params: MpcParams) -> Mapping[str, str | tuple[str, ...]]:
        words = coordinate_labels(params.robot.mechanism)
        shown = params.robot.shown
        name = words["joint"][shown]
        kinds = [f"{kind}{joint}" for kind in "qv" for joint in words["joint"]]
        return words | {
            "shown": f"joint {name}" if name.isdigit() else name,
            "shown_unit": words["q_unit"][shown],
            "limits": tuple(kinds + [f"u{motor}" for motor in words["motor"]]),
        }

    def draw(self, scene: Scene, params: MpcParams, state: MpcState) -> None:
        """The robot, the motion it predicts, those it predicted before, and its target."""
        draw_robot(scene, params, state.x, state.controller.u)
        draw_predictions(scene, params, state.history)
        draw_limits(scene, params, state.x, state.controller.u)
        draw_goal(scene, params, state.target, state.x, bool(state.arrow_steps_left))

    @classmethod
    def prepare(cls) -> None:
        """One period of each robot."""
        lab = cls()
        for name in ("ur5", "cart-pole", "double-pendulum"):
            params = MpcParams(system=name)
            lab.step(params, Inputs(), lab.init(params, np.random.default_rng(0)))


def _apply_impulse(params: MpcParams, state: MpcState) -> MpcState:
    """After the impulse [N s] along y has struck the tip."""
    n, x = params.robot.n, state.x.copy()
    body = mechanism(params.system, params.payload)
    x[n:] += body.velocity_jump(x[:n], np.array([0.0, params.push, 0.0]))
    return replace(state, x=x, hold_start=x, hold_steps=0, arrow_steps_left=ARROW_STEPS)


def _append_durations(
    before: Mapping[str, float | np.ndarray], said: Plan | None
) -> Mapping[str, float | np.ndarray]:
    """The durations of the last plans by phase, each (up to TIMED_PLANS,) [s], with those of one
    more."""
    if said is None:
        return before
    none = np.zeros(0)
    return {
        phase: np.append(before.get(phase, none), said.seconds.get(phase, 0.0))[-TIMED_PLANS:]
        for phase in PHASES
    }
