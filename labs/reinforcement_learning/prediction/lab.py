"""Model-free prediction (notes, 3.5.1 to 3.5.4): what a policy costs, learned from episodes."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.arrays import episodes_done
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.random_numbers import random_states
from labs.reinforcement_learning.prediction import batch, corners, online
from labs.reinforcement_learning.prediction.live_learner import (
    LiveLearner,
    advance_live_learner,
    start_live_learner,
)
from labs.reinforcement_learning.prediction.params import PREDICTION_METHODS, PredictionParams
from labs.reinforcement_learning.prediction.picture import (
    clicked_state,
    draw_backup_diagrams,
    draw_batch,
    draw_world,
)
from labs.reinforcement_learning.prediction.plots import (
    PLOTS,
    batch_curves,
    error_curves,
    error_maps,
    estimate_curves,
    target_curves,
    update_curves,
)
from labs.scene import Scene
from labs.tasks.grid_world.picture import BOARD
from labs.tasks.random_walk.picture import ROW

INITIAL_TRAINING = {
    "online": online.initial_training,
    "batch": batch.initial_training,
    "corners": corners.initial_training,
}
LEARN = {"online": online.learn, "batch": batch.learn, "corners": corners.learn}


@dataclass(kw_only=True)
class PredictionState(State):
    """What was learned by many, and one who learns while one watches."""

    training: Mapping[str, np.ndarray]
    """Of the study (`online`, `batch` or `corners`)."""
    live: LiveLearner
    random: np.ndarray
    """(4,) uint64: of the targets that are sampled to be looked at."""


class PredictionLab(Lab[PredictionParams, PredictionState]):
    """Monte Carlo and TD(0) learn the value of one policy."""

    title = "Model-free prediction"
    section = "3.5"
    summary = (
        "What does a policy cost? Monte Carlo waits for the end and averages, TD(0) trusts its own "
        "guesses: bias, variance and batches, measured on a hundred learners."
    )
    Params = PredictionParams
    period = 0.02
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Five states": {},
        "Nineteen states": {"world": "nineteen", "v0": 0.0},
        "Grid world": {"world": "grid", "v0": 0.0},
        # Of 651 states an episode meets few: long steps, and many episodes.
        "Pendulum under PD": {
            "world": "pendulum",
            "gamma": 0.95,
            "v0": 0.0,
            "alpha_mc": 1.0,
            "alpha_td": 1.0,
            "omega": 0.6,
            "episodes": 2000.0,
            "shown": "all",
        },
        "You are the predictor": {"study": "batch", "v0": 0.0},
        "Four kinds of update": {"study": "corners"},
    }

    handles = (
        Handle(ROW, "A click on a cell of the walk looks at its state."),
        Handle(BOARD, "A click on a cell of the grid looks at its state."),
    )

    def init(self, params: PredictionParams, rng: np.random.Generator) -> PredictionState:
        random = random_states(rng, 2)
        return PredictionState(
            training=INITIAL_TRAINING[params.study](params, rng),
            live=start_live_learner(params.prediction, random[0], params.v0),
            random=random[1],
        )

    def step(
        self, params: PredictionParams, inputs: Inputs, state: PredictionState
    ) -> PredictionState:
        """The walker, who takes no part in a batch."""
        live = state.live
        if params.study != "batch":
            part, first = params.pace * self.period, params.visits == "first"
            live = advance_live_learner(params.prediction, params.rules, first, live, part)
        return replace(state, t=state.t + self.period, live=live)

    def solve(self, params: PredictionParams, state: PredictionState) -> Iterator[Snapshot]:
        """Some episodes, or a sweep, an iteration."""
        return LEARN[params.study](params, state.training)

    def accept(
        self, params: PredictionParams, state: PredictionState, snapshot: Snapshot
    ) -> PredictionState:
        return replace(state, training=snapshot.data)

    def edit(
        self, params: PredictionParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The state looked at is the one clicked."""
        world = params.prediction
        x = clicked_state(world, handle, point) if params.study == "online" else None
        return {} if x is None else {"state": float(world.states.tolist().index(x) + 1)}

    def measure(self, params: PredictionParams, state: PredictionState) -> Measurement:
        training = state.training
        if params.study == "corners":
            return _latest_values(
                {"error": training["error"], "looked": training["looked"]}, range(4)
            )
        if params.study == "batch":
            measured = _latest_values({"misfit": training["misfit"][:, None]}, PREDICTION_METHODS)
            measured |= _latest_values(
                {"residual": training["residual"][:, None]}, PREDICTION_METHODS
            )
            if params.data == "predictor":
                measured |= _latest_values(
                    {"V_A": training["V"][:, 0, batch.A, None]}, PREDICTION_METHODS
                )
            return measured
        x = params.looked_at
        return {
            "trained": float(episodes_done(training)),
            "walked": float(state.live.episodes),
            "walker_mc": float(state.live.V[0, x]),
            "walker_td": float(state.live.V[1, x]),
            "walker_true": float(params.prediction.truth[x]),
        } | _latest_values({name: training[name] for name in online.CURVES}, PREDICTION_METHODS)

    def fields(self, params: PredictionParams, state: PredictionState) -> Mapping[str, np.ndarray]:
        training, world = state.training, params.prediction
        if params.study == "corners":
            return update_curves(training, world.truth)
        if params.study == "batch":
            truth = None if params.data == "predictor" else world.truth
            return batch_curves(training, truth)
        V, spread = _shown_values(params, state)
        return {
            **error_curves(training),
            **estimate_curves(world, V, spread),
            **target_curves(world, params.looked_at, V[1], state.random),
            **error_maps(world, V),
        }

    def labels(self, params: PredictionParams) -> Mapping[str, str | tuple[str, ...]]:
        pendulum = params.world == "pendulum"
        angle = "angle from upright [rad]"
        return {
            "axis": f"{angle}, at rest" if pendulum else "state",
            "across": angle if pendulum else "column",
            "up": "velocity [rad/s]" if pendulum else "row from below",
        }

    def draw(self, scene: Scene, params: PredictionParams, state: PredictionState) -> None:
        world = params.prediction
        if params.study == "corners":
            draw_backup_diagrams(scene, world, state.live, state.training["V"].mean(axis=1))
        elif params.study == "batch":
            truth = None if params.data == "predictor" else world.truth
            draw_batch(scene, params.place, state.training["V"][:, 0], truth)
        else:
            shown = _shown_values(params, state)
            draw_world(scene, world, state.live, *shown, params.method, params.looked_at)

    @classmethod
    def prepare(cls) -> None:
        """Compiles the loops of both methods, of a batch and of the walker."""
        lab, rng = cls(), np.random.default_rng(0)
        for params in (
            PredictionParams(),
            PredictionParams(visits="first", pace=50.0),
            PredictionParams(study="batch", data="five"),
            PredictionParams(world="pendulum", gamma=0.95),
        ):
            state = lab.init(params, rng)
            state = lab.accept(params, state, next(iter(lab.solve(params, state))))
            lab.fields(params, state)
            for _ in range(100):
                state = lab.step(params, Inputs(), state)


def _shown_values(
    params: PredictionParams, state: PredictionState
) -> tuple[np.ndarray, np.ndarray | None]:
    """V (2, X) of the walker; or the mean of all learners, and their standard deviation."""
    if params.shown == "walker":
        return state.live.V, None
    V = state.training["V"]
    return V.mean(axis=1), V.std(axis=1)


def _latest_values(curves: Mapping[str, np.ndarray], names: Iterable[object]) -> dict[str, float]:
    """The last of each curve (n, k), if there is any, of each of the names."""
    return {
        f"{name}_{which}": float(curve[m, -1])
        for name, curve in curves.items()
        for m, which in enumerate(names)
        if curve.shape[1]
    }
