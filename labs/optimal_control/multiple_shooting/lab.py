"""Multiple shooting (notes, 2.3.4): a motion in segments that are integrated on their own, and
joined by the solver."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from labs.algorithms import sqp
from labs.algorithms.multiple_shooting import MultipleShooting
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot
from labs.models.coordinates import coordinate_labels
from labs.optimal_control.multiple_shooting.params import MultipleShootingParams
from labs.optimal_control.multiple_shooting.picture import draw_segments
from labs.optimal_control.multiple_shooting.plots import (
    PLOTS,
    iteration_fields,
    segment_fields,
    study_fields,
)
from labs.optimal_control.multiple_shooting.structure import ShootingStructure, shooting_structure
from labs.optimal_control.multiple_shooting.study import SegmentSweep, no_study, study_segments
from labs.params import Value
from labs.resumable import run_to_completion
from labs.scene import Scene
from labs.tasks.direct.guesses import first_guess, start_guess
from labs.tasks.direct.history import IterationHistory
from labs.tasks.direct.motions import multiple_shooting_motion
from labs.tasks.direct.picture import draw_current_position, draw_goal, draw_robots
from labs.tasks.direct.plan_params import CHOICE_SETTINGS
from labs.tasks.direct.player import (
    DirectState,
    advance_player,
    edit_balls,
    measure_player,
    play_motion,
)
from labs.tasks.direct.tracking import nominal_trajectory
from labs.tasks.motion.playback import start_playback
from labs.tasks.motion.player import WORLD_PERIOD


@dataclass(kw_only=True)
class MultipleShootingState(DirectState):
    """With the segments of its motion, and what was compared."""

    anatomy: ShootingStructure
    study: SegmentSweep


class MultipleShootingLab(Lab[MultipleShootingParams, MultipleShootingState]):
    """Plans a motion in segments whose starts are variables as well, and shows them join."""

    title = "Multiple shooting"
    section = "2.3.4"
    summary = (
        "Begin the integration anew now and then: watch broken arcs join up, start from a line "
        "that no motion follows, and balance where single shooting fails."
    )
    Params = MultipleShootingParams
    period = WORLD_PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Single shooting": {"segments": 1.0},
        "Upright": {"system": "upright", "horizon": 4.0, "pieces": 40.0, "segments": 20.0},
        "Double pendulum": {
            "system": "double-pendulum",
            "limit": 1.0,
            "horizon": 1.5,
            "segments": 20.0,
        },
        "Cart-pole": {"system": "cart-pole"},
        "UR5": {"system": "ur5", "horizon": 1.0, "obstacle": True},
    }
    choice_settings = CHOICE_SETTINGS
    handles = (
        Handle("target", "Where the tip of the UR5 should end."),
        Handle("obstacle", "What the tip of the UR5 must not enter."),
    )

    def init(
        self, params: MultipleShootingParams, rng: np.random.Generator
    ) -> MultipleShootingState:
        """The first guess is the first motion; to stay at the start, where it diverges."""
        shooting, guess = params.shooting(params.m), first_guess(params, params.N)
        z = shooting.variables(guess.X, guess.U, guess.T)
        if not np.isfinite(shooting.values(z).f):
            guess = params.resting_guess()
            z = shooting.variables(guess.X, guess.U, guess.T)
        at, motion = sqp.init(shooting, z, params.options), multiple_shooting_motion(shooting, z)
        plan = nominal_trajectory(params, motion)
        return MultipleShootingState(
            motion=motion,
            plan=plan,
            history=IterationHistory.start(params, at, motion),
            playback=start_playback(plan),
            goal_errors=np.zeros(0),
            anatomy=run_to_completion(shooting_structure(shooting, z, params.task.u_0)),
            study=no_study(),
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(
        self, params: MultipleShootingParams, state: MultipleShootingState
    ) -> Iterator[Snapshot | None]:
        """One iteration a snapshot. A first guess that diverges leaves what there was."""
        shooting, options = params.shooting(params.m), params.options
        at = sqp.init(shooting, _initial_variables(params, shooting, state), options)
        if at.stopped:
            yield Snapshot(1, _failed_snapshot_data(state), at.stopped)
            return
        motion = multiple_shooting_motion(shooting, at.y)
        history = IterationHistory.start(params, at, motion)
        while not at.stopped:
            at = yield from sqp.resumable_step(shooting, options, at)
            yield None
            motion = multiple_shooting_motion(shooting, at.y)
            history = history.append(params, at, motion)
            yield None
            found = yield from shooting_structure(shooting, at.y, params.task.u_0)
            data = {
                "motion": motion,
                "plan": nominal_trajectory(params, motion),
                "history": history,
                "failed": bool(at.stopped) and not at.converged,
                "reusable": at.reusable,
                "anatomy": found,
                "study": no_study(),
            }
            if not (at.stopped and params.compares):
                yield Snapshot(at.iteration, data, at.stopped)
        if params.compares:
            yield from _compare_segments(params, Snapshot(at.iteration, data, at.stopped))

    def accept(
        self, params: MultipleShootingParams, state: MultipleShootingState, snapshot: Snapshot
    ) -> MultipleShootingState:
        """Whatever is taken in is played from its start."""
        data = snapshot.data
        parts = (data[name] for name in ("motion", "plan", "history", "failed"))
        state = play_motion(state, *parts)
        own = {name: data[name] for name in ("anatomy", "study", "reusable")}
        return replace(state, **own)

    def edit(
        self, params: MultipleShootingParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The balls are the target and the obstacle of the UR5."""
        return edit_balls(params, handle, point)

    # The world's clock ------------------------------------------------------------------------

    def step(
        self, params: MultipleShootingParams, inputs: Inputs, state: MultipleShootingState
    ) -> MultipleShootingState:
        """10 ms of the motion; at its end a rest, and then from the start."""
        return advance_player(params, state)

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: MultipleShootingParams, state: MultipleShootingState) -> Measurement:
        """Where both runs are beside the plan, and numbers of the solve."""
        at = state.anatomy
        found = measure_player(params, state) | {
            "variables": float(at.variables),
            "nonzeros": float(at.nonzeros),
            "density": 100.0 * at.density,
            "growth": float(at.growth.max()),
        }
        return found | ({"condition": at.condition} if at.condition else {})

    def fields(
        self, params: MultipleShootingParams, state: MultipleShootingState
    ) -> Mapping[str, np.ndarray]:
        """The iterations, the segments and what was compared."""
        return (
            iteration_fields(state.history, state.anatomy.cuts)
            | segment_fields(state.history, state.anatomy, state.motion.T)
            | study_fields(state.study)
        )

    def labels(self, params: MultipleShootingParams) -> Mapping[str, str | tuple[str, ...]]:
        words, at = coordinate_labels(params.task.mechanism), params.task
        name = words["joint"][at.shown]
        if name.isdigit():
            name = f"angle {name}" if at.mechanism.nq > 1 else "angle"
        return words | {"shown": name, "shown_unit": words["q_unit"][at.shown]}

    def draw(
        self, scene: Scene, params: MultipleShootingParams, state: MultipleShootingState
    ) -> None:
        """The robot, its open-loop ghost and the segments of the path."""
        draw_robots(scene, params, state)
        draw_goal(scene, params)
        bead = 0.016 if params.task.planar else 0.009
        draw_segments(scene, state.history, state.anatomy, state.failed, bead)
        draw_current_position(scene, params, state)

    @classmethod
    def prepare(cls) -> None:
        """The solver, and one iteration of each kind."""
        sqp.prepare()
        for hessian in ("gauss-newton", "exact"):
            params = MultipleShootingParams(pieces=4.0, segments=2.0, steps=1.0, hessian=hessian)
            lab = cls()
            state = lab.init(params, np.random.default_rng(0))
            next(snapshot for snapshot in lab.solve(params, state) if snapshot)


def _initial_variables(
    params: MultipleShootingParams, shooting: MultipleShooting, state: MultipleShootingState
) -> np.ndarray:
    """z to start from: the present solution, if there is one and it is wanted."""
    guess = start_guess(params, state.motion, state.reusable, params.N)
    return shooting.variables(guess.X, guess.U, guess.T)


def _compare_segments(params: MultipleShootingParams, last: Snapshot) -> Iterator[Snapshot | None]:
    """The solver's last snapshot, and one more for each other number of segments; the sentence
    with the last of all."""
    yield replace(last, done="")
    latest, count = no_study(), last.iteration
    for study in study_segments(params):
        if study:
            latest, count = study, count + 1
            yield Snapshot(count, {**last.data, "study": latest}, "")
        else:
            yield None
    yield Snapshot(count + 1, {**last.data, "study": latest}, last.done)


def _failed_snapshot_data(state: MultipleShootingState) -> dict[str, Any]:
    """What there is already, where the first guess diverges."""
    names = ("motion", "plan", "history", "anatomy", "study")
    kept = {name: getattr(state, name) for name in names}
    return kept | {"failed": True, "reusable": False}
