"""The four families of optimal control (notes, 2.1.3) side by side on one problem."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.algorithms import sqp
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.optimal_control.families.params import FamiliesParams
from labs.optimal_control.families.picture import draw_bodies, draw_values, state_at
from labs.optimal_control.families.plots import (
    PLOTS,
    method_notes,
    motion_fields,
    study_fields,
    table_fields,
)
from labs.optimal_control.families.side_by_side import (
    FAMILY_NAMES,
    UNKNOWN_GAP,
    Results,
    no_results,
    solve_side_by_side,
)
from labs.params import Value
from labs.scene import Scene

REST_DURATION = 0.8
"""[s] between the end of a motion and its start anew."""


@dataclass(kw_only=True)
class FamiliesState(State):
    """How far the four methods have come, and how far their motions are played."""

    results: Results
    clock: int = 0
    """World steps since the motions began."""
    steps: int = 0
    """World steps done: t = steps * period."""


class Families(Lab[FamiliesParams, FamiliesState]):
    """One problem solved by all four families, and what ties their answers together."""

    title = "Four families of optimal control"
    section = "2.1.3"
    summary = (
        "Hamilton-Jacobi-Bellman, dynamic programming, Pontryagin and a direct method solve one "
        "pendulum side by side; costates, gradients and multipliers turn out to be one curve."
    )
    Params = FamiliesParams
    period = 0.01
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "From the middle": {"moment": 0.3},
        "Weak motor": {"u_max": 2.5},
        "Limited angle": {"u_max": 3.0, "limited": True},
    }
    handles = (Handle("start", "The state to start from, on the surface."),)

    def init(self, params: FamiliesParams, rng: np.random.Generator) -> FamiliesState:
        return FamiliesState(results=no_results(params))

    # The solver's clock -----------------------------------------------------------------------

    def solve(self, params: FamiliesParams, state: FamiliesState) -> Iterator[Snapshot | None]:
        """A round of all four a snapshot."""
        seconds = dict.fromkeys(FAMILY_NAMES, 0.0)
        rounds = 0
        for at in solve_side_by_side(params, state.results.motions, seconds):
            if at is None:
                yield None
                continue
            rounds += 1
            parts = list(at.progress.values())
            if params.study != "none":
                parts.append(1.0 if at.over else at.study.progress(params.study))
            progress = sum(parts) / len(parts)
            data = {"results": at, "seconds": dict(seconds)}
            yield Snapshot(rounds, data, outcome_message(at) if at.over else "", progress)

    def accept(
        self, params: FamiliesParams, state: FamiliesState, snapshot: Snapshot
    ) -> FamiliesState:
        """What is known of the motions is played from the start."""
        results = snapshot.data["results"]
        return replace(state, results=results, seconds=snapshot.data["seconds"], clock=0)

    def edit(
        self, params: FamiliesParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The ball is the state to start from."""
        if handle != "start":
            return {}
        q, v = state_at(params, point)
        name = "angle" if params.system == "pendulum" else "place"
        return {name: params.nearest(name, q), "velocity": params.nearest("velocity", v)}

    # The world's clock ------------------------------------------------------------------------

    def step(self, params: FamiliesParams, inputs: Inputs, state: FamiliesState) -> FamiliesState:
        """10 ms of all motions; at their end a rest, and then from the start."""
        steps, clock = state.steps + 1, state.clock + 1
        if clock * self.period > params.horizon + REST_DURATION:
            clock = 0
        return replace(state, t=steps * self.period, steps=steps, clock=clock)

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: FamiliesParams, state: FamiliesState) -> Measurement:
        """Of each method its cost, and how close their answers are."""
        at = state.results
        costs = {f"cost_{name}": motion.cost for name, motion in at.motions.items() if motion.known}
        gaps = {name: value for name, value in at.gaps.items() if value != UNKNOWN_GAP}
        return costs | gaps

    def fields(self, params: FamiliesParams, state: FamiliesState) -> Mapping[str, np.ndarray]:
        at, now = state.results, state.clock * self.period
        return (
            motion_fields(params, at, now)
            | table_fields(params, at)
            | study_fields(params, at, state.seconds)
        )

    def notes(self, params: FamiliesParams, state: FamiliesState) -> Mapping[str, str]:
        return {"account": method_notes(state.results)}

    def labels(self, params: FamiliesParams) -> Mapping[str, str | tuple[str, ...]]:
        slides = params.system == "mass"
        return {
            "methods": tuple(FAMILY_NAMES.values()),
            "unit": "m" if slides else "rad",
            "control_unit": "N" if slides else "N·m",
        }

    def draw(self, scene: Scene, params: FamiliesParams, state: FamiliesState) -> None:
        now = min(state.clock * self.period, params.horizon)
        draw_bodies(scene, params, state.results, now)
        draw_values(scene, params, state.results, now)

    @classmethod
    def prepare(cls) -> None:
        """All that is compiled, on the smallest grids."""
        sqp.prepare()
        params = FamiliesParams(nodes=21.0, hjb_steps=5.0, dp_steps=5.0, horizon=0.5)
        for _ in solve_side_by_side(
            params, no_results(params).motions, dict.fromkeys(FAMILY_NAMES, 0.0)
        ):
            pass


def outcome_message(at: Results) -> str:
    """In a sentence: who has found what."""
    failed = [name for name, motion in at.motions.items() if not motion.converged]
    costs = [motion.cost for motion in at.motions.values() if motion.converged]
    span = f"{min(costs):.4g} to {max(costs):.4g}" if costs else "none"
    if not failed:
        return f"All four have ended, with costs of {span}."
    why = " ".join(f"{FAMILY_NAMES[name]}: {at.motions[name].message}" for name in failed)
    return f"{len(costs)} of four have found a motion, with costs of {span}. {why}"
