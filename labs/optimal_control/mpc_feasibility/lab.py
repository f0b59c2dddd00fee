"""Feasibility of MPC (notes, 2.5.1 and 2.5.2): the sets in which it stays, and runs that leave."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np

from labs.algorithms import mpc
from labs.algorithms.linear_mpc import LinearPlanner
from labs.algorithms.mpc import RecedingHorizonState
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.optimal_control.mpc_feasibility.params import MpcFeasibilityParams
from labs.optimal_control.mpc_feasibility.picture import (
    draw_feasibility,
    draw_impact_speed,
    plane_of,
)
from labs.optimal_control.mpc_feasibility.plots import PLOTS, set_fields, system_labels
from labs.optimal_control.mpc_feasibility.problem import (
    FeasibilitySettings,
    feasibility,
    feasibility_system,
)
from labs.optimal_control.mpc_feasibility.sets import (
    AdmissibleSetGrowth,
    compute_sets,
    grow_admissible_set,
    signed_distance,
)
from labs.params import Value
from labs.problems.receding_horizon import Plan, Planner
from labs.resumable import Resumable, run_to_completion
from labs.scene import Scene

PENALTY = 1e3
"""Of softened limits, beside costs of natural size."""
WALL_TOLERANCE = 0.02
"""Natural units past the wall at which it has run into it."""
LOST_POSITION = 3.0
"""Natural units at which it ends where there is no wall."""
PATH_POINTS = 1500
"""Points of a path: 30 s."""


@dataclass(kw_only=True)
class MpcFeasibilityState(State):
    """The run and the admissible set as far as it is known."""

    z: np.ndarray
    """(2,) deviation of the state from the rest."""
    controller: RecedingHorizonState
    """With the plan of the last period, and what acts until the next."""
    path: np.ndarray
    """(k, 2) z so far."""
    steps: int = 0
    """World steps done."""
    first_failed_period: int = -1
    """The first period without a plan that keeps the limits; -1: none so far."""
    failure_reason: str = ""
    """Why there was none then."""
    failures: int = 0
    """Periods without one."""
    ended: bool = False
    """Whether it ran into the wall, or is lost where there is none: it stays where it is then."""
    growth: AdmissibleSetGrowth


class MpcFeasibility(Lab[MpcFeasibilityParams, MpcFeasibilityState]):
    """MPC of a system whose states fill a plane, with all its sets drawn there."""

    title = "MPC: feasibility"
    section = "2.5.2"
    summary = (
        "Drive a cart between walls by MPC: see from which states a plan exists, run into a dead "
        "end, and let a terminal set keep you out of it."
    )
    Params = MpcFeasibilityParams
    period = 0.02
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Dead end": {"u_max": 0.5},
        "Invariant terminal set": {"u_max": 0.5, "terminal": "invariant"},
        "Pendulum, upright": {
            "system": "unstable", "x1": 0.4, "goal": 0.0, "terminal": "admissible"
        },
        "Joint that stops": {
            "system": "joint", "x1": 0.3, "x2": 0.4, "goal": 0.0, "p_max": 0.5, "u_max": 1.2,
            "terminal": "still",
        },
        "Joint in blocks": {
            "system": "joint", "x1": 0.28, "x2": 0.74, "goal": 0.2, "p_max": 0.5, "u_max": 1.2,
            "horizon": 8.0, "terminal": "admissible", "block": "4",
        },
    }  # fmt: skip
    handles = (
        Handle("state", "Where the system is: a run begins anew from there."),
        Handle("goal", "Where it should come to rest."),
    )

    def init(self, params: MpcFeasibilityParams, rng: np.random.Generator) -> MpcFeasibilityState:
        """At the start, with the first plan made."""
        system = feasibility_system(params.system)
        z = np.array([params.x1, params.x2]) * system.x_max
        state = MpcFeasibilityState(
            z=z,
            controller=mpc.init(mpc.MpcOptions(), np.zeros(1)),
            path=z[None],
            growth=AdmissibleSetGrowth(),
        )
        return _start_period(params, state)

    # The solver's clock: the admissible set ---------------------------------------------------

    def solve(
        self, params: MpcFeasibilityParams, state: MpcFeasibilityState
    ) -> Iterator[Snapshot | None]:
        """One t of the notes' algorithm a snapshot."""
        t = 0
        for found in grow_admissible_set(params.setup):
            if found is None:
                yield None
                continue
            t += 1
            yield Snapshot(t, {"growth": found[0]}, found[1])

    def accept(
        self, params: MpcFeasibilityParams, state: MpcFeasibilityState, snapshot: Snapshot
    ) -> MpcFeasibilityState:
        return replace(state, growth=snapshot.data["growth"])

    def edit(
        self, params: MpcFeasibilityParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The balls in the plane: a new start, or a new goal."""
        system = feasibility_system(params.system)
        x = (plane_of(system).state_at(point) - system.x_eq) / system.x_max
        if handle == "goal":
            return {"goal": params.nearest("goal", x[0])}
        return {"x1": params.nearest("x1", x[0]), "x2": params.nearest("x2", x[1])}

    # The world's clock ------------------------------------------------------------------------

    def step(
        self, params: MpcFeasibilityParams, inputs: Inputs, state: MpcFeasibilityState
    ) -> MpcFeasibilityState:
        """20 ms under the control of this period; at its end a plan from where that led."""
        steps = state.steps + 1
        state = replace(state, t=steps * self.period, steps=steps)
        if state.ended:
            return state
        A, B, _ = feasibility_system(params.system).linear(self.period)
        z = A @ state.z + B @ state.controller.u
        reach = params.p_max + WALL_TOLERANCE if params.state_limits else LOST_POSITION
        over = bool(abs(z[0]) > reach * feasibility_system(params.system).x_max[0])
        state = replace(state, z=z, ended=over, path=np.vstack([state.path, z])[-PATH_POINTS:])
        at_end = steps % round(params.period / self.period) == 0
        return _start_period(params, state) if at_end and not over else state

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: MpcFeasibilityParams, state: MpcFeasibilityState) -> Measurement:
        """States and controls in their units, distances to the sets' edges in natural ones."""
        system, sets = feasibility_system(params.system), compute_sets(params.setup)
        at = feasibility(params.setup)
        x_max = np.array(system.x_max)
        u_max = system.u_max * params.u_max
        measured: dict[str, float | np.ndarray] = {
            "position": float(state.z[0] + system.x_eq[0]),
            "velocity": float(state.z[1]),
            "control": float(state.controller.u[0] + system.u_eq),
            "goal": float(at.goal[0] + system.x_eq[0]),
            "u_high": u_max,
            "u_low": -u_max,
            "failures": float(state.failures),
            "share": 100.0 * sets.feasible_share,
            "decided": float(len(params.setup.holds)),
        }
        if state.first_failed_period >= 0:
            measured["failed"] = float(state.first_failed_period)
        if state.growth.found:
            measured["t_star"] = float(len(state.growth.J) - 1)
        if np.isfinite(sets.dead_end_share):
            measured |= {"dead": 100.0 * sets.dead_end_share, "leak": 100.0 * sets.leak_share}
        if sets.rows:
            reach = params.p_max * x_max[0]
            measured |= {
                "p_high": float(system.x_eq[0] + reach),
                "p_low": float(system.x_eq[0] - reach),
                "v_high": params.v_max * x_max[1],
                "v_low": -params.v_max * x_max[1],
                "depth_feasible": signed_distance(sets.rows[0], state.z / x_max),
                "depth_invariant": signed_distance(sets.rows[1], state.z / x_max),
            }
            if state.ended:
                measured["impact"] = abs(float(state.z[1]))
        return measured

    def fields(
        self, params: MpcFeasibilityParams, state: MpcFeasibilityState
    ) -> Mapping[str, np.ndarray]:
        return set_fields(params.setup, state.growth)

    def notes(self, params: MpcFeasibilityParams, state: MpcFeasibilityState) -> Mapping[str, str]:
        """What was planned now, and why the first period without a plan had none."""
        sentences = [state.controller.status or "This period has a plan that keeps all limits."]
        if state.ended:
            sentences = [_end_message(params, state)]
        if state.first_failed_period >= 0:
            k = state.first_failed_period
            when = f"period {k}, t = {k * params.period:.2f} s"
            sentences.append(f"The first without one was {when}. {state.failure_reason}")
        sticks_out = compute_sets(params.setup).excess
        if sticks_out > 1e-6:
            sentences.append(
                f"The terminal set is not control invariant: it sticks out by {sticks_out:.2g}, in "
                "natural units, of the states from which it is reached in a period."
            )
        elif np.isfinite(sticks_out):
            sentences.append("The terminal set is control invariant: once in it, one can stay.")
        return {"planner": "\n".join(sentences)}

    def labels(self, params: MpcFeasibilityParams) -> Mapping[str, str | tuple[str, ...]]:
        return system_labels(feasibility_system(params.system))

    def draw(self, scene: Scene, params: MpcFeasibilityParams, state: MpcFeasibilityState) -> None:
        """The body, and the plane with the sets, the plan and the way so far."""
        draw_feasibility(scene, params, state.z, state.controller, state.path, state.growth)
        if state.ended:
            draw_impact_speed(scene, params, state.z)

    @classmethod
    def prepare(cls) -> None:
        """One of each computation."""
        for params in (
            MpcFeasibilityParams(terminal="admissible"),
            MpcFeasibilityParams(fallback="soft"),
        ):
            compute_sets(params.setup)
            cls().init(params, np.random.default_rng(0))


class NoPlanner:
    """Plans nothing, for a reason."""

    def __init__(self, reason: str) -> None:
        self.reason = reason

    def plan(self, x: np.ndarray, guess: Plan | None, N: int | None = None) -> Resumable[Plan]:
        """What was not found."""
        return Plan(x[None], np.zeros((0, 1)), np.nan, False, self.reason)
        yield


@lru_cache(maxsize=16)
def _planner(setup: FeasibilitySettings, soft: bool) -> Planner:
    at = feasibility(setup)
    if at.trouble:
        return NoPlanner(at.trouble)
    if soft:
        return LinearPlanner(at.problem, penalty=PENALTY)
    return LinearPlanner(at.problem, holds=setup.holds if setup.block > 1 else None)


def _start_period(params: MpcFeasibilityParams, state: MpcFeasibilityState) -> MpcFeasibilityState:
    """A new period."""
    setup, soft = params.setup, params.fallback == "soft"
    problem = feasibility(setup).problem
    A, B, U = problem.A, problem.B, problem.control_set
    options = mpc.MpcOptions(fallback="tail" if params.fallback == "tail" else "brake")
    # The control after which the velocity is zero, or as near to it as U allows.
    brake = np.clip(-(A[1] @ state.z) / B[1], -U.h[1], U.h[0])
    at = run_to_completion(
        mpc.step(_planner(setup, soft), problem.step, options, state.controller, state.z, brake)
    )
    status, why = at.status, at.why
    if soft and not status and at.plan is not None and at.plan.violation > 0.0:
        status = why = at.plan.message
    if not status:
        return replace(state, controller=at)
    first = state.first_failed_period < 0
    return replace(
        state,
        controller=replace(at, status=status),
        failures=state.failures + 1,
        first_failed_period=at.period - 1 if first else state.first_failed_period,
        failure_reason=why if first else state.failure_reason,
    )


def _end_message(params: MpcFeasibilityParams, state: MpcFeasibilityState) -> str:
    """What became of a run that is over."""
    unit, speed = feasibility_system(params.system).units[1], abs(float(state.z[1]))
    if not params.state_limits:
        return "It is lost: U is too small to bring it back. Start nearer to the goal."
    return (
        f"It ran into the limit of its position at {speed:.2g} {unit}. Drag the ball, or change "
        "what leads there and reset."
    )
