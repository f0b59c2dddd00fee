"""MPC under uncertainty (notes, 2.5.5): a cart stops before a wall, and something pushes it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from typing import ClassVar

import numpy as np

from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.optimal_control.mpc_uncertainty.controllers import (
    CONTROL_PERIOD,
    CONTROLLER_NAMES,
    controllers,
)
from labs.optimal_control.mpc_uncertainty.params import UncertaintyParams
from labs.optimal_control.mpc_uncertainty.picture import (
    CAMERA,
    draw_carts,
    draw_limits,
    draw_plan,
    draw_runs,
    draw_sets,
    phase_plane,
)
from labs.optimal_control.mpc_uncertainty.plots import (
    PLOTS,
    design_fields,
    guarantee_note,
    outcome_message,
    run_fields,
    run_readouts,
)
from labs.optimal_control.mpc_uncertainty.runs import RUN_STEPS, DisturbedRuns, simulate_runs
from labs.optimal_control.mpc_uncertainty.statistics import Counts, run_statistics
from labs.params import Value
from labs.scene import Scene

TICKS_PER_STEP = 10
"""World steps in a period of the controllers."""
REST_TICKS = 60
"""World steps between the end of the runs and their start anew."""


@dataclass(kw_only=True)
class UncertaintyState(State):
    """The runs, what was counted, and how far they are played."""

    runs: DisturbedRuns
    counts: Counts
    clock: int = 0
    """World steps since the runs began."""
    steps: int = 0
    """World steps done: t = steps * period."""


class MpcUncertainty(Lab[UncertaintyParams, UncertaintyState]):
    """Runs a cart many times towards a wall, under three controllers and the same disturbances."""

    title = "MPC under uncertainty"
    section = "2.5.5"
    summary = (
        "A hundred carts stop before a wall while something pushes them: count how many hit it "
        "under nominal, stochastic and robust MPC, and what their caution costs."
    )
    Params = UncertaintyParams
    period = CONTROL_PERIOD / TICKS_PER_STEP
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Gaussian": {"kind": "gaussian"},
        "The worst disturbance": {"kind": "worst"},
        "Stiff gain": {"r_K": 0.01},
        "Press on": {"target": 1.0, "source": "measured"},
    }
    handles = (Handle("start", "The state that all runs start from."),)

    def init(self, params: UncertaintyParams, rng: np.random.Generator) -> UncertaintyState:
        """At the start; the disturbances have a seed of their own."""
        runs = DisturbedRuns.start(params)
        return UncertaintyState(runs=runs, counts=run_statistics(params, controllers(params), runs))

    # The solver's clock -----------------------------------------------------------------------

    def solve(
        self, params: UncertaintyParams, state: UncertaintyState
    ) -> Iterator[Snapshot | None]:
        """One step of all runs a snapshot."""
        chosen = controllers(params)
        yield None
        for runs in simulate_runs(params, chosen):
            if runs is None:
                yield None
                continue
            counts = run_statistics(params, chosen, runs)
            done = outcome_message(params, counts) if runs.steps == RUN_STEPS else ""
            data = {"runs": runs, "counts": counts}
            yield Snapshot(runs.steps, data, done, runs.steps / RUN_STEPS)

    def accept(
        self, params: UncertaintyParams, state: UncertaintyState, snapshot: Snapshot
    ) -> UncertaintyState:
        """The playing goes on, as far as there are runs to play."""
        runs = snapshot.data["runs"]
        clock = min(state.clock, runs.steps * TICKS_PER_STEP)
        return replace(state, runs=runs, counts=snapshot.data["counts"], clock=clock)

    def edit(
        self, params: UncertaintyParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The ball in the plane is the start."""
        if handle != "start":
            return {}
        p, v = phase_plane(params).state_at(point)
        return {"p_0": params.nearest("p_0", p), "v_0": params.nearest("v_0", v)}

    # The world's clock ------------------------------------------------------------------------

    def step(
        self, params: UncertaintyParams, inputs: Inputs, state: UncertaintyState
    ) -> UncertaintyState:
        """20 ms of all runs; at their end a rest, and then from the start."""
        steps, clock = state.steps + 1, state.clock + 1
        if clock > RUN_STEPS * TICKS_PER_STEP + REST_TICKS:
            clock = 0
        return replace(state, t=steps * self.period, steps=steps, clock=clock)

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: UncertaintyParams, state: UncertaintyState) -> Measurement:
        """Shares of all runs, once they are complete."""
        return run_readouts(params, state.runs, state.counts)

    def fields(
        self, params: UncertaintyParams, state: UncertaintyState
    ) -> Mapping[str, np.ndarray]:
        design = design_fields(params, controllers(params))
        return design | run_fields(params, state.runs, state.counts)

    def notes(self, params: UncertaintyParams, state: UncertaintyState) -> Mapping[str, str]:
        return {"promise": guarantee_note(params, controllers(params), state.runs, state.counts)}

    def labels(self, params: UncertaintyParams) -> Mapping[str, str | tuple[str, ...]]:
        return {"controllers": CONTROLLER_NAMES}

    def draw(self, scene: Scene, params: UncertaintyParams, state: UncertaintyState) -> None:
        chosen, runs, plane = controllers(params), state.runs, phase_plane(params)
        shown = [i for i, name in enumerate(CONTROLLER_NAMES) if params.shown in ("all", name)]
        states, k = _interpolate_runs(state)
        plane.draw_axes(scene)
        scene.camera(*CAMERA)
        draw_carts(scene, params, states[:, 0])
        draw_sets(scene, plane, chosen, shown)
        draw_limits(scene, plane, params)
        for i in shown:
            if k < runs.steps and runs.planned[i, k, 0]:
                draw_plan(scene, plane, chosen, i, runs.plans[i, k])
        draw_runs(scene, plane, states, shown)

    @classmethod
    def prepare(cls) -> None:
        """All that is compiled, in two steps of few runs."""
        for source in ("predicted", "measured"):
            params = UncertaintyParams(count=20.0, source=source)
            lab = cls()
            state = lab.init(params, np.random.default_rng(0))
            snapshots = (snapshot for snapshot in lab.solve(params, state) if snapshot)
            for snapshot in islice(snapshots, 2):
                state = lab.accept(params, state, snapshot)
            lab.fields(params, state)


def _interpolate_runs(state: UncertaintyState) -> tuple[np.ndarray, int]:
    """All states (3, runs, 2) now, on straight lines between steps, and the number of the step."""
    X, ticks = state.runs.X, min(state.clock, state.runs.steps * TICKS_PER_STEP)
    k, tick = divmod(ticks, TICKS_PER_STEP)
    if not tick:
        return X[:, k], k
    share = tick / TICKS_PER_STEP
    return (1.0 - share) * X[:, k] + share * X[:, k + 1], k
