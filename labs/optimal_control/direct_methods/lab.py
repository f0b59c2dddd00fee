"""Direct methods compared (notes, 2.3.5): single shooting, multiple shooting and collocation solve
one problem, side by side."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.algorithms import riccati, sqp
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot
from labs.optimal_control.direct_methods.method_runs import (
    MethodRuns,
    initial_runs,
    outcome_message,
    run_methods,
)
from labs.optimal_control.direct_methods.methods import SHORT_NAMES, TRANSCRIPTIONS
from labs.optimal_control.direct_methods.params import DirectMethodsParams
from labs.optimal_control.direct_methods.picture import draw_plans
from labs.optimal_control.direct_methods.plots import (
    PLOTS,
    STRUCTURE_ROWS,
    comparison_fields,
    iteration_fields,
    method_readouts,
    plan_fields,
)
from labs.params import Value
from labs.scene import Scene
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


@dataclass(kw_only=True)
class DirectMethodsState(DirectState):
    """The race, and whose motion is being played."""

    race: MethodRuns
    played: str


class DirectMethodsLab(Lab[DirectMethodsParams, DirectMethodsState]):
    """Solves one problem by the three direct methods, and compares them."""

    title = "Direct methods"
    section = "2.3.5"
    summary = (
        "Single shooting, multiple shooting and collocation race on the same problem: count what "
        "each has to solve, see which of them fails and why, and play what they planned."
    )
    Params = DirectMethodsParams
    period = WORLD_PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Upright": {"system": "upright"},
        "Double pendulum": {"system": "double-pendulum", "limit": 1.0, "segments": 10.0},
        "Cart-pole": {"system": "cart-pole"},
        "Mass, least time": {"system": "mass", "objective": "least-time", "limit": 1.0},
        "UR5 reach": {"system": "ur5", "horizon": 1.0, "pieces": 10.0},
        "UR5 past an obstacle": {
            "system": "ur5",
            "horizon": 1.0,
            "pieces": 10.0,
            "obstacle": True,
        },
    }
    choice_settings = CHOICE_SETTINGS
    handles = (
        Handle("target", "The UR5's target."),
        Handle("obstacle", "The ball that the UR5's tip must not enter."),
    )

    def init(self, params: DirectMethodsParams, rng: np.random.Generator) -> DirectMethodsState:
        """The first guess is the first motion of all three."""
        race = initial_runs(params)
        entrant = race[params.played]
        plan = nominal_trajectory(params, entrant.motion)
        return DirectMethodsState(
            motion=entrant.motion,
            plan=plan,
            history=entrant.history,
            playback=start_playback(plan),
            goal_errors=np.zeros(0),
            race=race,
            played=params.played,
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(
        self, params: DirectMethodsParams, state: DirectMethodsState
    ) -> Iterator[Snapshot | None]:
        """A snapshot is an iteration of each method that has not stopped."""
        seconds = dict[str, float]()
        for race in run_methods(params, state.race, seconds):
            if race is None:
                yield None
                continue
            done = outcome_message(race) if all(at.stopped for at in race.values()) else ""
            iteration = max(1, *(at.history.iterations for at in race.values()))
            yield Snapshot(iteration, {"race": race, "seconds": dict(seconds)}, done)

    def accept(
        self, params: DirectMethodsParams, state: DirectMethodsState, snapshot: Snapshot
    ) -> DirectMethodsState:
        """Whatever is taken in is played from its start."""
        seconds = snapshot.data.get("seconds", {})
        state = replace(state, race=snapshot.data["race"], seconds=seconds)
        return _play_method(params, state)

    def edit(
        self, params: DirectMethodsParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The balls are the UR5's target and its obstacle."""
        return edit_balls(params, handle, point)

    # The world's clock ------------------------------------------------------------------------

    def step(
        self, params: DirectMethodsParams, inputs: Inputs, state: DirectMethodsState
    ) -> DirectMethodsState:
        """10 ms of the motion; at its end a rest, and then from the start."""
        if state.played != params.played:
            state = _play_method(params, state)
        return advance_player(params, state)

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: DirectMethodsParams, state: DirectMethodsState) -> Measurement:
        """The run beside its plan, and how each method ended."""
        return measure_player(params, state) | method_readouts(state.race)

    def fields(
        self, params: DirectMethodsParams, state: DirectMethodsState
    ) -> Mapping[str, np.ndarray]:
        """The iterations of all three, their motions, and what is compared."""
        return (
            iteration_fields(state.race)
            | plan_fields(state.race, params.task.shown, params.task.u_0)
            | comparison_fields(state.race, state.seconds)
        )

    def notes(self, params: DirectMethodsParams, state: DirectMethodsState) -> Mapping[str, str]:
        """How each method fares, a line each."""
        lines = [
            f"{TRANSCRIPTIONS[name]}: {at.stopped or f'{at.history.iterations} iterations so far.'}"
            for name, at in state.race.items()
        ]
        return {"verdicts": "\n".join(lines)}

    def labels(self, params: DirectMethodsParams) -> Mapping[str, str | tuple[str, ...]]:
        return plan_labels(params) | {"methods": SHORT_NAMES, "rows": STRUCTURE_ROWS}

    def draw(self, scene: Scene, params: DirectMethodsParams, state: DirectMethodsState) -> None:
        """The three robots by their plans; or the one played, with its open-loop ghost."""
        if params.view == "plans":
            draw_plans(scene, params, state.race, state.playback.clock)
        else:
            draw_robots(scene, params, state)
            draw_paths(scene, params, state)
            draw_goal(scene, params)

    @classmethod
    def prepare(cls) -> None:
        """The solver, the regulator's recursion, and an iteration of each method."""
        sqp.prepare()
        riccati.prepare()
        params = DirectMethodsParams(pieces=4.0, segments=2.0, steps=1.0)
        race = initial_runs(params)
        next(at for at in run_methods(params, race, {}) if at)


def _play_method(params: DirectMethodsParams, state: DirectMethodsState) -> DirectMethodsState:
    """With the plan that is to be played, from its start."""
    entrant = state.race[params.played]
    plan = nominal_trajectory(params, entrant.motion)
    state = play_motion(state, entrant.motion, plan, entrant.history, entrant.failed)
    return replace(state, played=params.played)
