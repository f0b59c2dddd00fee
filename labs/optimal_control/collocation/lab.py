"""Collocation (notes, 2.3.3): states and controls are the variables, the dynamics are constraints
that the first iterations may miss."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from labs.algorithms import riccati, sqp
from labs.algorithms.collocation import Collocation
from labs.algorithms.sqp import PrimalDualPoint, SqpIterate
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot
from labs.optimal_control.collocation.params import CollocationParams
from labs.optimal_control.collocation.plots import (
    PLOTS,
    costate_fields,
    iteration_fields,
    motion_fields,
    structure_fields,
    study_fields,
)
from labs.optimal_control.collocation.structure import SparsityPattern, sparsity_pattern
from labs.optimal_control.collocation.studies import (
    NO_STUDY,
    ConvergenceStudy,
    study_linear_solves,
    study_order,
)
from labs.optimal_control.collocation.transcription import Costates, costates
from labs.params import Value
from labs.resumable import Resumable, run_to_completion
from labs.scene import Scene
from labs.tasks.direct.guesses import first_guess, is_warm_start, start_guess
from labs.tasks.direct.history import IterationHistory
from labs.tasks.direct.motions import collocation_motion
from labs.tasks.direct.picture import draw_goal, draw_paths, draw_robots
from labs.tasks.direct.plan_params import CHOICE_SETTINGS
from labs.tasks.direct.player import (
    DirectState,
    advance_player,
    edit_balls,
    measure_player,
    plan_labels,
    play_motion,
)
from labs.tasks.direct.tracking import nominal_trajectory
from labs.tasks.motion.playback import start_playback
from labs.tasks.motion.player import WORLD_PERIOD

SNAPSHOT_FIELDS = ("reusable", "variables", "structure", "costates", "study")
"""Of the state, beside what is played."""


@dataclass(kw_only=True)
class CollocationState(DirectState):
    """The motion with what its programme looks like."""

    variables: PrimalDualPoint
    structure: SparsityPattern
    costates: Costates
    study: ConvergenceStudy = NO_STUDY


class CollocationLab(Lab[CollocationParams, CollocationState]):
    """Plans a motion with its states as variables, and shows how the gaps between them close."""

    title = "Collocation"
    section = "2.3.3"
    summary = (
        "Plan states and controls together: watch the gaps of a motion close, look at matrices "
        "that are nearly empty, and see what a finer grid or a better rule buys."
    )
    Params = CollocationParams
    period = WORLD_PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Mass, least time": {"system": "mass", "objective": "least-time", "limit": 1.0},
        "Weak motor": {"limited": True, "limit": 0.3, "horizon": 3.0, "guess": "controls"},
        "Double pendulum": {"system": "double-pendulum", "limit": 1.0},
        "Cart-pole": {"system": "cart-pole"},
        "UR5 reach": {"system": "ur5", "horizon": 1.0},
        "UR5 past an obstacle": {"system": "ur5", "horizon": 1.0, "obstacle": True},
    }
    choice_settings = CHOICE_SETTINGS
    handles = (
        Handle("target", "The UR5's target."),
        Handle("obstacle", "The ball that the UR5's tip must not enter."),
    )

    def init(self, params: CollocationParams, rng: np.random.Generator) -> CollocationState:
        """The first guess is the first motion, with its gaps."""
        program = params.program
        at = sqp.init(program, program.variables(*first_guess(params, params.N)), params.options)
        motion = collocation_motion(program, at)
        plan = nominal_trajectory(params, motion)
        at = replace(at, derivatives=program.derivatives(at.y))
        return CollocationState(
            motion=motion,
            plan=plan,
            history=IterationHistory.start(params, at, motion),
            playback=start_playback(plan),
            goal_errors=np.zeros(0),
            variables=PrimalDualPoint(at.y, at.lam, at.mu, at.nu),
            structure=run_to_completion(_sparsity_pattern(program, at)),
            costates=costates(program, at),
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(
        self, params: CollocationParams, state: CollocationState
    ) -> Iterator[Snapshot | None]:
        """One iteration a snapshot, and what is measured besides with the last."""
        program, seconds = params.program, dict[str, Any]()
        at = _initial_iterate(params, program, state)
        if at.stopped:
            kept = replace(state, failed=True, reusable=False)
            yield Snapshot(1, _snapshot_data(kept, seconds), at.stopped)
            return
        history = IterationHistory.start(params, at, collocation_motion(program, at))
        structure = state.structure if state.structure.variables == program.n else None
        while not at.stopped:
            at = yield from sqp.resumable_step(program, params.options, at)
            yield None
            motion = collocation_motion(program, at)
            history = history.append(params, at, motion)
            yield None
            if at.derivatives is None:
                at = replace(at, derivatives=program.derivatives(at.y))
            if structure is None or at.stopped:
                structure = yield from _sparsity_pattern(program, at)
            after = replace(
                state,
                motion=motion,
                plan=nominal_trajectory(params, motion),
                history=history,
                failed=bool(at.stopped) and not at.converged,
                reusable=at.reusable,
                variables=PrimalDualPoint(at.y, at.lam, at.mu, at.nu),
                structure=structure,
                costates=costates(program, at),
                study=NO_STUDY,
            )
            if at.converged and params.study == "order":
                after.study = yield from study_order(params, motion)
            if at.converged and params.study == "sizes":
                after.study = yield from study_linear_solves(params, motion, seconds)
            yield Snapshot(max(at.iteration, 1), _snapshot_data(after, seconds), at.stopped)

    def accept(
        self, params: CollocationParams, state: CollocationState, snapshot: Snapshot
    ) -> CollocationState:
        """Whatever is taken in is played from its start."""
        data = snapshot.data
        names = ("motion", "plan", "history", "failed")
        state = play_motion(state, *(data[name] for name in names))
        return replace(
            state,
            **{name: data[name] for name in SNAPSHOT_FIELDS},
            seconds=data.get("seconds", {}),
        )

    def edit(
        self, params: CollocationParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The balls are the UR5's target and its obstacle."""
        return edit_balls(params, handle, point)

    # The world's clock ------------------------------------------------------------------------

    def step(
        self, params: CollocationParams, inputs: Inputs, state: CollocationState
    ) -> CollocationState:
        """10 ms of both runs; at the end of the motion a rest, and then from the start."""
        return advance_player(params, state)

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: CollocationParams, state: CollocationState) -> Measurement:
        """The runs, the iterations, and the size of the programme."""
        structure, study = state.structure, state.study
        found = measure_player(params, state) | {
            "variables": float(structure.variables),
            "constraints": float(structure.constraints),
            "nonzeros": float(structure.nonzeros),
            "density": 100.0 * structure.density,
            "hessian_density": 100.0 * structure.hessian_density,
        }
        order = study.order_of(params.scheme)
        return found | ({} if np.isnan(order) else {"order": order})

    def fields(
        self, params: CollocationParams, state: CollocationState
    ) -> Mapping[str, np.ndarray]:
        """Gaps, motion, matrices, costates and what was measured besides."""
        joint = params.task.shown
        return (
            iteration_fields(state.history, state.motion.T)
            | motion_fields(state, joint, params.task.u_0)
            | structure_fields(state.structure)
            | costate_fields(state.costates, joint)
            | study_fields(state.study, state.seconds)
        )

    def labels(self, params: CollocationParams) -> Mapping[str, str | tuple[str, ...]]:
        return plan_labels(params)

    def draw(self, scene: Scene, params: CollocationParams, state: CollocationState) -> None:
        """The robot, its open-loop ghost, and the pieces of the path."""
        draw_robots(scene, params, state)
        draw_paths(scene, params, state)
        draw_goal(scene, params)

    @classmethod
    def prepare(cls) -> None:
        """The solver, and the regulator's recursion."""
        sqp.prepare()
        riccati.prepare()


def _initial_iterate(
    params: CollocationParams, program: Collocation, state: CollocationState
) -> SqpIterate:
    """From the present solution, if there is one and it is wanted, with its multipliers if the grid
    is the same."""
    if is_warm_start(params, state.reusable) and len(state.variables.y) == program.n:
        return sqp.warm_start(program, state.variables, params.options)
    guess = start_guess(params, state.motion, state.reusable, params.N)
    return sqp.init(program, program.variables(*guess), params.options)


def _sparsity_pattern(program: Collocation, at: SqpIterate) -> Resumable[SparsityPattern]:
    assert at.derivatives
    L_yy = yield from program.hessian(at.y, at.lam, at.mu, exact=True)
    return sparsity_pattern(at.derivatives.c_y, L_yy)


def _snapshot_data(state: CollocationState, seconds: Mapping[str, Any]) -> dict[str, Any]:
    names = ("motion", "plan", "history", "failed", *SNAPSHOT_FIELDS)
    return {name: getattr(state, name) for name in names} | {"seconds": seconds}
