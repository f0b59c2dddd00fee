"""The run under MPC: at every period a plan, of which the first control acts, and V* on the way."""

from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms import mpc
from labs.algorithms.mpc import MpcOptions, RecedingHorizonState
from labs.optimal_control.mpc_stability.formulation import Formulation
from labs.resumable import run_to_completion
from labs.tasks.phase_plane.systems import SIMULATION_STEP

OPTIONS = MpcOptions()
DIVERGENCE_FACTOR = 1.2
"""Beyond so many times the window a run ends."""
KEPT_PERIODS = 600
"""Periods of a run that are kept."""


@dataclass(frozen=True, eq=False)
class ClosedLoopRun:
    """From its start. Arrays are never written after they are made."""

    x: np.ndarray
    """(2,)"""
    steps: int
    """Since the start, of SIMULATION_STEP."""
    controller: RecedingHorizonState
    path: np.ndarray
    """(k, 2) the errors at the beginning of every period, the present one the last; the states
    where nothing is followed."""
    V: np.ndarray
    """(k,) V* there; 0 where there is no plan."""
    found: np.ndarray
    """(k,) whether there is one."""
    stage_costs: np.ndarray
    """(k,) l(x, u) of each period."""
    end_reason: str = ""
    """Why it goes no further, in a sentence."""

    @property
    def k(self) -> int:
        """The present period, from 0."""
        return self.controller.period - 1

    @property
    def decrease_excess(self) -> np.ndarray:
        """V*(x+) - V*(x) + l(x, u) of every period that is over and had a plan, as the next."""
        both = self.found[1:] & self.found[:-1]
        return np.asarray((np.diff(self.V) + self.stage_costs[:-1])[both])


def start_run(formulation: Formulation, x: np.ndarray) -> ClosedLoopRun:
    """At x (2,), with the first plan; none where there is no such problem."""
    controller, nothing = mpc.init(OPTIONS, np.zeros(1)), np.zeros(0)
    run = ClosedLoopRun(
        x, 0, controller, np.zeros((0, 2)), nothing, nothing > 0.0, nothing, formulation.trouble
    )
    return run if run.end_reason else _start_period(formulation, run)


def advance_run(formulation: Formulation, run: ClosedLoopRun) -> ClosedLoopRun:
    """SIMULATION_STEP later. Far outside the window a run ends."""
    if run.end_reason:
        return run
    A, B = formulation.step
    run = replace(run, x=A @ run.x + B @ applied_control(formulation, run), steps=run.steps + 1)
    if (np.abs(run.x) > DIVERGENCE_FACTOR * formulation.window.h[:2]).any():
        seconds = run.steps * SIMULATION_STEP
        return replace(run, end_reason=f"After {seconds:.2f} s it is far out: begin elsewhere.")
    if run.steps % round(formulation.settings.period / SIMULATION_STEP):
        return run
    return _start_period(formulation, run)


def applied_control(formulation: Formulation, run: ClosedLoopRun) -> np.ndarray:
    """(1,) what acts: the plan's, on top of the reference's."""
    return np.asarray(run.controller.u + formulation.reference.controls(np.array(max(run.k, 0))))


def _start_period(formulation: Formulation, run: ClosedLoopRun) -> ClosedLoopRun:
    """At the beginning of a period."""
    k, model = run.k + 1, formulation.problem.step
    error = run.x - formulation.reference.states(np.array(k))
    planner, brake = formulation.planner_at(k), np.zeros(1)
    work = mpc.step(planner, model, OPTIONS, run.controller, error, brake)
    controller = run_to_completion(work)
    plan = controller.plan
    found = plan is not None and not controller.status
    paid = float(formulation.stage_cost(error, controller.u))
    return replace(
        run,
        controller=controller,
        path=np.vstack([run.path, error])[-KEPT_PERIODS:],
        V=np.append(run.V, plan.cost if plan and found else 0.0)[-KEPT_PERIODS:],
        found=np.append(run.found, found)[-KEPT_PERIODS:],
        stage_costs=np.append(run.stage_costs, paid)[-KEPT_PERIODS:],
    )
