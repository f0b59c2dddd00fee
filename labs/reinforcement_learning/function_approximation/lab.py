"""Function approximation (notes, 3.7, 3.8.1, 3.8.2): values as weighted sums of features."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.arrays import Training
from labs.lab import Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.random_numbers import random_states
from labs.reinforcement_learning.function_approximation.example_worlds import (
    ConvergenceTable,
    Spiral,
    Triad,
)
from labs.reinforcement_learning.function_approximation.fitted_worlds import (
    PolicyPrediction,
    SwingUpLearner,
)
from labs.reinforcement_learning.function_approximation.learning_world import LearningWorld
from labs.reinforcement_learning.function_approximation.motion import (
    PERIOD,
    PolicyMotion,
    initial_motion,
)
from labs.reinforcement_learning.function_approximation.params import (
    ITERATIONS,
    ApproximationParams,
)
from labs.reinforcement_learning.function_approximation.plots import PLOTS
from labs.scene import Scene

LEARNING_WORLDS: Mapping[str, LearningWorld] = {
    "walk": PolicyPrediction(),
    "surface": PolicyPrediction(),
    "swing": SwingUpLearner(),
    "star": Triad(),
    "pair": Triad(),
    "spiral": Spiral(),
    "nine": ConvergenceTable(),
}


@dataclass(kw_only=True)
class ApproximationState(State):
    """What was learned, and what moves meanwhile."""

    training: Training
    motion: PolicyMotion


class FunctionApproximation(Lab[ApproximationParams, ApproximationState]):
    """Learners whose values are sums of features, in worlds where that goes well or not."""

    title = "Function approximation"
    section = "3.7"
    summary = (
        "A value function with ten weights instead of a thousand entries: what Monte Carlo and TD "
        "make of it, how a pendulum swings up by 45 numbers, and when it all diverges."
    )
    Params = ApproximationParams
    period = PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Random walk": {},
        "A surface": {
            "world": "surface",
            "features": "fourier",
            "m": 4.0,
            "target": "td",
            "alpha": 0.02,
            "episodes": 1000.0,
        },
        "Swing-up": {
            "world": "swing",
            "features": "fourier",
            "m": 4.0,
            "alpha": 0.02,
            "episodes": 500.0,
        },
        "Baird's star": {"world": "star", "alpha": 0.01, "updates": 10000.0},
        "Spiral": {"world": "spiral", "alpha": 2e-4, "updates": 10000.0},
        "Nine learners": {"world": "nine"},
    }

    def init(self, params: ApproximationParams, rng: np.random.Generator) -> ApproximationState:
        training = LEARNING_WORLDS[params.world].initial_training(params, rng)
        return ApproximationState(
            training=training, motion=initial_motion(random_states(rng, 1)[0])
        )

    def step(
        self, params: ApproximationParams, inputs: Inputs, state: ApproximationState
    ) -> ApproximationState:
        """10 ms of what moves in the scene; it goes on whatever becomes of the weights."""
        if state.trouble:
            return state
        motion = LEARNING_WORLDS[params.world].move(params, state.training, state.motion)
        return replace(state, t=state.t + self.period, motion=motion)

    def solve(
        self, params: ApproximationParams, state: ApproximationState
    ) -> Iterator[Snapshot | None]:
        """A hundredth of the learning an iteration; goes on from the present weights."""
        subject, training, done, i = LEARNING_WORLDS[params.world], state.training, "", 0
        last = 1 if _progress_unit(params) == "solutions" else ITERATIONS
        while not done:
            training, i = (yield from subject.learn(params, training)), i + 1
            if not training["sound"]:
                done = "The weights left all bounds."
            elif i == last:
                done = _done_message(params, training)
            yield Snapshot(i, training, done, i / last)

    def accept(
        self, params: ApproximationParams, state: ApproximationState, snapshot: Snapshot
    ) -> ApproximationState:
        training = snapshot.data
        return replace(
            state,
            training=training,
            trouble="" if training["sound"] else _divergence_message(params),
        )

    def measure(self, params: ApproximationParams, state: ApproximationState) -> Measurement:
        steps = state.training["steps"]
        learned = {"learned": float(steps[-1])} if steps.size else {}
        return learned | LEARNING_WORLDS[params.world].measure(params, state.training)

    def fields(
        self, params: ApproximationParams, state: ApproximationState
    ) -> Mapping[str, np.ndarray]:
        return LEARNING_WORLDS[params.world].fields(params, state.training)

    def labels(self, params: ApproximationParams) -> Mapping[str, str | tuple[str, ...]]:
        return {"unit": _progress_unit(params)}

    def draw(self, scene: Scene, params: ApproximationParams, state: ApproximationState) -> None:
        LEARNING_WORLDS[params.world].draw(scene, params, state.training, state.motion)

    @classmethod
    def prepare(cls) -> None:
        """Compiles the loops, and solves the pendulum."""
        lab, rng = cls(), np.random.default_rng(0)
        for preset in [*cls.presets.values(), {"data": "replay"}]:
            params = ApproximationParams().change(preset)
            state = lab.init(params, rng)
            found = next(s for s in lab.solve(params, state) if s is not None)
            lab.step(params, Inputs(), lab.accept(params, state, found))


def _progress_unit(params: ApproximationParams) -> str:
    """What learning is counted in."""
    if params.world in ("star", "pair", "spiral"):
        return "updates"
    if params.world == "nine" or params.data == "latest":
        return "episodes"
    if params.data == "replay":
        return "% of the draws"
    return "fits" if params.world == "swing" else "solutions"


def _done_message(params: ApproximationParams, training: Training) -> str:
    if _progress_unit(params) == "solutions":
        return "The weights of least squares are found."
    return f"{training['steps'][-1]:.0f} {_progress_unit(params)} of learning done."


def _divergence_message(params: ApproximationParams) -> str:
    """What diverged, and what to do."""
    if params.world in ("star", "pair"):
        return (
            "The weights grew beyond all bounds: approximation, bootstrapping and off-policy "
            "sampling are together. Switch one of them off, discount more, or correct the gradient."
        )
    if params.world == "spiral":
        return (
            "The weight ran outwards along the spiral: nonlinear TD(0) may diverge. "
            "Switch bootstrapping off, or take gamma below 0.129."
        )
    if params.data == "batch":
        return (
            "The weights grew beyond all bounds: the batch tells too little for these features, "
            "and fits follow one another. Take more episodes or fewer features."
        )
    return (
        "The weights grew beyond all bounds: the step size is too large for these features. "
        "Take a smaller one, then reset."
    )
