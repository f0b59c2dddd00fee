"""Stability of MPC (notes, 2.5.3): V*_N as a Lyapunov function, over the plane and along a run."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.algorithms.polygons import area
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.number_texts import count_text
from labs.optimal_control.mpc_stability import closed_loop, picture
from labs.optimal_control.mpc_stability.assumptions import assumptions_note
from labs.optimal_control.mpc_stability.closed_loop import ClosedLoopRun
from labs.optimal_control.mpc_stability.formulation import Formulation
from labs.optimal_control.mpc_stability.params import MpcStabilityParams
from labs.optimal_control.mpc_stability.plots import (
    CHANGE_NAMES,
    PLOTS,
    run_fields,
    surface_fields,
)
from labs.optimal_control.mpc_stability.value_surface import (
    FALLS,
    RESOLUTIONS,
    RISES,
    ValueSurface,
    value_surface,
)
from labs.params import Value
from labs.resumable import run_to_completion
from labs.scene import Scene
from labs.tasks.phase_plane.systems import SIMULATION_STEP, plane_system


@dataclass(kw_only=True)
class MpcStabilityState(State):
    """The run, and the surface of V*."""

    steps: int = 0
    """World steps done: t = steps * period."""
    run: ClosedLoopRun
    run_key: str
    """The problem and the start that the run is of."""
    surface: ValueSurface


class MpcStability(Lab[MpcStabilityParams, MpcStabilityState]):
    """A linear system under MPC, with the terminal ingredients one by one."""

    title = "Stability of MPC"
    section = "2.5.3"
    summary = (
        "Watch the optimal cost as a landscape that the run slides down, or not: terminal cost and "
        "terminal set make a stabilising controller of plans that look only a few steps ahead."
    )
    Params = MpcStabilityParams
    period = SIMULATION_STEP
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Short-sighted": {"terminal_cost": "none", "terminal_set": "none", "limited": False},
        "To the origin": {
            "terminal_cost": "none",
            "terminal_set": "origin",
            "N": 3.0,
            "q0": 0.1,
        },
        "Cart": {
            "system": "cart",
            "q0": -0.5,
            "r": 0.1,
            "N": 10.0,
        },
        "Follow a motion": {"task": "track", "N": 10.0},
        "Economic cost": {
            "system": "cart",
            "task": "economic",
            "price": 0.5,
            "q0": -0.3,
            "v0": 0.7,
            "r": 0.1,
            "N": 20.0,
            "u_max": 1.0,
            "terminal_cost": "none",
            "terminal_set": "none",
        },
    }
    handles = (Handle("state", "Where a run begins: drag it anywhere in the plane."),)

    @classmethod
    def prepare(cls) -> None:
        run_to_completion(value_surface(MpcStabilityParams().formulation, RESOLUTIONS[0]))

    def init(self, params: MpcStabilityParams, rng: np.random.Generator) -> MpcStabilityState:
        run = closed_loop.start_run(params.formulation, params.start)
        return MpcStabilityState(run=run, run_key=_run_key(params), surface=ValueSurface.empty())

    # The world's clock ------------------------------------------------------------------------

    def step(
        self, params: MpcStabilityParams, inputs: Inputs, state: MpcStabilityState
    ) -> MpcStabilityState:
        """10 ms; another problem or start begins another run."""
        steps, key = state.steps + 1, _run_key(params)
        if key == state.run_key:
            run = closed_loop.advance_run(params.formulation, state.run)
        else:
            run = closed_loop.start_run(params.formulation, params.start)
        return replace(state, t=steps * self.period, steps=steps, run=run, run_key=key)

    def edit(
        self, params: MpcStabilityParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The ball is the start of a run."""
        x = picture.plane_of(params.system).state_at(point)
        return {name: params.nearest(name, v) for name, v in zip(("q0", "v0"), x, strict=True)}

    # The solver's clock -----------------------------------------------------------------------

    def solve(
        self, params: MpcStabilityParams, state: MpcStabilityState
    ) -> Iterator[Snapshot | None]:
        """V* over the plane, coarse and then fine."""
        formulation = params.formulation
        for iteration, size in enumerate(RESOLUTIONS, 1):
            surface = yield from value_surface(formulation, size)
            done = (
                ""
                if iteration < len(RESOLUTIONS) and surface.V.size
                else _summary(formulation, surface)
            )
            yield Snapshot(iteration, {"surface": surface}, done)
            if done:
                return

    def accept(
        self, params: MpcStabilityParams, state: MpcStabilityState, snapshot: Snapshot
    ) -> MpcStabilityState:
        return replace(state, surface=snapshot.data["surface"])

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: MpcStabilityParams, state: MpcStabilityState) -> Measurement:
        formulation, run = params.formulation, state.run
        reference = formulation.reference.states(np.array(run.steps * self.period / params.period))
        measured: dict[str, float | np.ndarray] = {
            "q": float(run.x[0]),
            "v": float(run.x[1]),
            "q_ref": float(reference[0]),
            "v_ref": float(reference[1]),
            "u": float(closed_loop.applied_control(formulation, run)[0]),
            "u_max": params.u_max,
            "u_min": -params.u_max,
        }
        if run.found[-1:].any():
            measured["V"] = float(run.V[-1])
        if len(run.found) > 1 and run.found[-2:].all():
            measured["change"] = float(run.V[-1] - run.V[-2])
            measured["minus_l"] = -float(run.stage_costs[-2])
        if len(run.decrease_excess):
            measured["worst"] = float(run.decrease_excess.max())
        if state.surface.V.size:
            shares = 100.0 * state.surface.shares()
            measured |= {"falls": float(shares[FALLS]), "rises": float(shares[RISES])}
        if formulation.settings.task != "track":
            measured["area"] = area(formulation.feasible_polygon)
        if formulation.problem.terminal_set is not None:
            measured["terminal_area"] = area(formulation.terminal_polygon)
        return measured

    def fields(
        self, params: MpcStabilityParams, state: MpcStabilityState
    ) -> Mapping[str, np.ndarray]:
        return {**run_fields(state.run), **surface_fields(state.surface)}

    def notes(self, params: MpcStabilityParams, state: MpcStabilityState) -> Mapping[str, str]:
        return {"assumptions": assumptions_note(params.formulation), "run": _run_note(state.run)}

    def labels(self, params: MpcStabilityParams) -> Mapping[str, str | tuple[str, ...]]:
        system = plane_system(params.system)
        q_unit, v_unit = system.units
        return {
            "q_unit": q_unit,
            "v_unit": v_unit,
            "u_unit": system.control_unit,
            "area_unit": f"{q_unit}·{v_unit}",
            "changes": CHANGE_NAMES,
        }

    def draw(self, scene: Scene, params: MpcStabilityParams, state: MpcStabilityState) -> None:
        """The plane with X_0, X_f, V* and the run, beside the body."""
        picture.draw_stability(scene, params.formulation, state.surface, state.run)


def _run_key(params: MpcStabilityParams) -> str:
    """Of what a run depends on."""
    return repr((params.formulation.settings, params.q0, params.v0))


def _summary(formulation: Formulation, surface: ValueSurface) -> str:
    """Said when the surface is complete."""
    if formulation.trouble:
        return formulation.trouble
    if formulation.settings.task == "track":
        return "What is followed moves the limits, and V* with them: see it along the run."
    if not surface.V.size:
        return "X₀ has no inside: from hardly any state is there a plan."
    falls, less, rises, lost = 100.0 * surface.shares()
    return (
        f"V* falls by l or more on {falls:.0f} % of X₀, by less on {less:.0f} %, rises on "
        f"{rises:.0f} %; from {lost:.0f} % the next problem is infeasible."
    )


def _run_note(run: ClosedLoopRun) -> str:
    """How the run fares."""
    if run.end_reason or run.controller.status:
        return "\n".join(filter(None, [run.controller.status, run.end_reason]))
    count = run.controller.failures
    plans = run.controller.period - count
    said = f"{count_text(plans, 'plan')}, each solved to optimality."
    return said if not count else f"{said} In {count_text(count, 'period')} there was none."
