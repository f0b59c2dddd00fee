"""Model predictive control of robots (notes, 2.5, 2.5.4): a plan at every period, of which the
first control acts."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from labs.algorithms import mpc
from labs.algorithms.mpc import RecedingHorizon
from labs.lab import Action, Handle, Inputs, Lab, Measurement, State
from labs.models.coordinates import coordinate_labels
from labs.models.mechanisms import mechanism
from labs.optimal_control.mpc.controller import control, cost_terms, planner_of
from labs.optimal_control.mpc.history import PlanningHistory
from labs.optimal_control.mpc.params import MpcParams
from labs.optimal_control.mpc.picture import draw_goal, draw_limits, draw_predictions, draw_robot
from labs.optimal_control.mpc.plots import (
    PHASES,
    PLOTS,
    TIMED,
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

PERIOD = 0.01
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
    base: np.ndarray
    """(nx,) where the present control began to act undisturbed,"""
    held: int = 0
    """so many world steps ago."""
    elapsed: int = 0
    """World steps since the period began."""
    aim: np.ndarray
    """(3,) [m] where the target was when the period began."""
    controller: RecedingHorizon
    terms: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """(3,) what position, velocity and control cost in the last period."""
    excess: float = 0.0
    """By how much the last plan exceeds soft limits."""
    gap: float | None = None
    iterations: int = 0
    history: PlanningHistory
    pushed: int = 0
    """World steps the arrow of a push still stays."""
    clock: int = 0
    """World steps done: t = clock * PERIOD."""


class Mpc(Lab[MpcParams, MpcState]):
    """A robot that plans its next moments anew at every period."""

    title = "Model predictive control"
    section = "2.5"
    summary = (
        "Drag a target and a UR5 replans a hundred times a second within its limits: see what it "
        "predicts, and what it then does."
    )
    Params = MpcParams
    period = PERIOD
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
            base=at.x0,
            aim=params.target_at(0.0),
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
        state = replace(state, pushed=max(state.pushed - 1, 0))
        if "push" in inputs.actions:
            state = _pushed(params, state)
        if state.elapsed == 0:
            state = self._control(params, state)
        clock = state.clock + 1
        state = replace(state, clock=clock, t=clock * PERIOD)
        if params.mode == "plan":
            return replace(state, elapsed=0, history=state.history.moved(state.x))
        held, elapsed = state.held + 1, state.elapsed + 1
        plant = dynamics(params.system, held * PERIOD, params.payload)
        with np.errstate(all="ignore"):
            x = plant.step(state.base, state.controller.u)
        if not np.abs(x[params.robot.n :]).max() < LARGEST_VELOCITY:
            return replace(
                state,
                trouble=f"The robot went out of control at t = {state.t:.2f} s. Reset, and give it "
                "more control, a longer horizon or less delay.",
            )
        state = replace(state, x=x, held=held, elapsed=elapsed, history=state.history.moved(x))
        if elapsed * PERIOD > params.h - 0.5 * PERIOD:
            return replace(state, base=x, held=0, elapsed=0)
        return state

    def _control(self, params: MpcParams, state: MpcState) -> MpcState:
        """The start of a period."""
        aim = params.target_at(state.t)
        reference = planner_of(params, aim).problem
        dx = state.x - reference.x_ref
        final = float(0.5 * dx @ reference.Q_f @ dx)
        history = state.history.met(state.x, state.t, float(state.terms.sum()), final)
        at, said = control(params, aim, state.controller, state.x)
        if said and said.found:
            lead = params.delay * params.h if params.compensate and params.mode == "both" else 0.0
            history = history.planned(said, state.t + lead, params.h)
        acts = params.mode != "plan"
        terms = cost_terms(params, aim, state.x, at.u) if acts else np.zeros(3)
        return replace(
            state,
            aim=aim,
            controller=at,
            history=history,
            terms=terms,
            excess=said.violation if said else state.excess,
            gap=said.gap if said else state.gap,
            iterations=said.iterations if said else 0,
            seconds=_with_times(state.seconds, said),
        )

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: MpcParams, state: MpcState) -> Measurement:
        """The robot, its limits, and numbers of plan and motion."""
        at, u, history = params.robot, state.controller.u, state.history
        goal = planner_of(params, state.aim).problem.x_ref[: at.n]
        x_lower, x_upper, u_max = params.bounds
        q, v = state.x[: at.n], state.x[at.n :]
        excess = np.maximum(state.x - x_upper, x_lower - state.x).max()
        if params.ball:
            depth = params.ball.radius - np.linalg.norm(at.mechanism.tip(q) - params.ball.center)
            excess = max(float(excess), float(depth))
        wanted = state.aim if params.system != "cart-pole" else at.mechanism.tip(goal)
        found: dict[str, float | np.ndarray] = {
            "q": q,
            "goal": goal,
            "v": v,
            "u": u,
            "share": np.abs(u) / u_max,
            "one": np.ones(len(u)),
            "cost_q": state.terms[0] / params.h,
            "cost_v": state.terms[1] / params.h,
            "cost_u": state.terms[2] / params.h,
            "miss": float(np.linalg.norm(at.mechanism.tip(q) - wanted)),
            "exceeded": float(max(excess, 0.0)),
            "paid": history.paid,
            "off_first": history.off_first,
            "iterations": float(state.iterations),
            "failures": float(state.controller.failures),
        }
        plan = state.controller.plan
        if plan:
            found["active"] = float(sum(rows.sum() for rows in plan.active.values()))
            found["value"] = plan.cost
        optional = {
            "promised": history.promised,
            "over_horizon": history.over_horizon,
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
        draw_goal(scene, params, state.aim, state.x, bool(state.pushed))

    @classmethod
    def prepare(cls) -> None:
        """One period of each robot."""
        lab = cls()
        for name in ("ur5", "cart-pole", "double-pendulum"):
            params = MpcParams(system=name)
            lab.step(params, Inputs(), lab.init(params, np.random.default_rng(0)))


def _pushed(params: MpcParams, state: MpcState) -> MpcState:
    """After the impulse [N s] along y has struck the tip."""
    n, x = params.robot.n, state.x.copy()
    body = mechanism(params.system, params.payload)
    x[n:] += body.velocity_jump(x[:n], np.array([0.0, params.push, 0.0]))
    return replace(state, x=x, base=x, held=0, pushed=ARROW_STEPS)


def _with_times(
    before: Mapping[str, float | np.ndarray], said: Plan | None
) -> Mapping[str, float | np.ndarray]:
    """The durations of the last plans by phase, each (up to TIMED,) [s], with those of one more."""
    if said is None:
        return before
    none = np.zeros(0)
    return {
        phase: np.append(before.get(phase, none), said.seconds.get(phase, 0.0))[-TIMED:]
        for phase in PHASES
    }
