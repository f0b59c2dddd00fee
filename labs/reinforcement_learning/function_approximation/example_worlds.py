"""The worlds that were made to go wrong: the star, the pair, the spiral, and all nine learners."""

import numpy as np

from labs.arrays import Training
from labs.reinforcement_learning.function_approximation import convergence_table, spiral, triad
from labs.reinforcement_learning.function_approximation.convergence_picture import (
    draw_convergence_table,
)
from labs.reinforcement_learning.function_approximation.graph_picture import (
    draw_spiral,
    draw_states,
    pair_places,
    star_places,
)
from labs.reinforcement_learning.function_approximation.learning_world import Fields
from labs.reinforcement_learning.function_approximation.motion import PolicyMotion, advance_walker
from labs.reinforcement_learning.function_approximation.params import ApproximationParams
from labs.reinforcement_learning.function_approximation.plots import (
    CHANGE_CELLS,
    CONVERGENCE_COLUMNS,
    CONVERGENCE_ROWS,
    band_fields,
)
from labs.resumable import Resumable
from labs.scene import Color, Scene

STAR_NAMES = (*(f"2w{i} + w8" for i in "123456"), "w7 + 2w8")
SETTLED_DISTANCE = 0.05
"""A learner whose distance to the best q is below this has settled."""
MIN_CHATTER_CHANGES = 20
"""Changes of the greedy policy, at least, of a learner that chatters."""


class Triad:
    """Baird's star, and the two states."""

    def initial_training(self, params: ApproximationParams, rng: np.random.Generator) -> Training:
        return triad.initial_training(params, rng)

    def learn(self, params: ApproximationParams, training: Training) -> Resumable[Training]:
        return triad.learn(params, training)

    def measure(self, params: ApproximationParams, training: Training) -> dict[str, float]:
        return {
            "error_now": float(training["errors"].mean()),
            "growth": float(triad.eigenvalues(params).real.max()),
            "largest": float(np.abs(training["w"]).max()),
        }

    def fields(self, params: ApproximationParams, training: Training) -> Fields:
        values = triad.eigenvalues(params)
        found = {"steps": training["steps"], "weights": training["path"][params.shown]}
        found |= {"real": values.real, "imaginary": values.imag}
        return found | band_fields("error", training["error"])

    def move(
        self, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> PolicyMotion:
        return advance_walker(triad.counterexample(params).task, motion)

    def draw(
        self, scene: Scene, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> None:
        values = triad.counterexample(params).features.dense @ training["w"][params.shown]
        star = params.world == "star"
        names = STAR_NAMES if star else ("w", "2w")
        if not params.approximate:
            names = tuple(f"w{i + 1}" for i in range(len(names)))
        places = star_places() if star else pair_places()
        ways = tuple((x, 6) for x in range(6)) if star else ((0, 1),)
        draw_states(scene, values[: len(names)], places, motion.place, names, ways)


class Spiral:
    """One weight on a spiral."""

    def initial_training(self, params: ApproximationParams, rng: np.random.Generator) -> Training:
        return spiral.initial_training(params, rng)

    def learn(self, params: ApproximationParams, training: Training) -> Resumable[Training]:
        return spiral.learn(params, training)

    def measure(self, params: ApproximationParams, training: Training) -> dict[str, float]:
        return {"error_now": float(training["error"][:, -1].mean())}

    def fields(self, params: ApproximationParams, training: Training) -> Fields:
        ways = training["path"][params.shown]
        around = np.linspace(ways.min() - 40.0, ways.max() + 4.0, 600)
        curve_x, curve_y = spiral.in_plane(spiral.spiral_values(around))
        fine = np.interp(np.linspace(0, len(ways) - 1, 800), np.arange(len(ways)), ways)
        way_x, way_y = spiral.in_plane(spiral.spiral_values(fine))
        found = {"steps": training["steps"], "curve_x": curve_x, "curve_y": curve_y}
        found |= {"way_x": way_x, "way_y": way_y}
        return found | band_fields("error", training["error"])

    def move(
        self, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> PolicyMotion:
        return motion

    def draw(
        self, scene: Scene, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> None:
        draw_spiral(scene, training["path"][params.shown])


class ConvergenceTable:
    """The table of convergence."""

    def initial_training(self, params: ApproximationParams, rng: np.random.Generator) -> Training:
        return convergence_table.initial_training(params, rng)

    def learn(self, params: ApproximationParams, training: Training) -> Resumable[Training]:
        return convergence_table.learn(params, training)

    def measure(self, params: ApproximationParams, training: Training) -> dict[str, float]:
        return {}

    def fields(self, params: ApproximationParams, training: Training) -> Fields:
        found = {"rounds": training["steps"]}
        for c, column in enumerate(CONVERGENCE_COLUMNS):
            found[f"distance_{column}"] = training["distance"][c::3].T
        return found | {"changes": training["changes"][CHANGE_CELLS].T}

    def move(
        self, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> PolicyMotion:
        return motion

    def draw(
        self, scene: Scene, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> None:
        steps = training["steps"]
        time = np.log(np.maximum(steps, 1.0)) / np.log(convergence_table.EPISODES)
        draw_convergence_table(
            scene,
            CONVERGENCE_ROWS,
            CONVERGENCE_COLUMNS,
            time,
            training["shown"],
            convergence_labels(training),
        )


def convergence_labels(training: Training) -> list[tuple[str, Color]]:
    """How each of the nine fares, and a colour for it."""
    if not training["steps"].size:
        return [("", "actual")] * 9
    found: list[tuple[str, Color]] = []
    alive, late = convergence_table.within_bounds(training), training["distance"][:, -1]
    for cell in range(9):
        changes = int(training["changes"][cell, -1])
        if not alive[cell]:
            found.append(("left all bounds", "warning"))
        elif cell == 2:
            found.append((f"turns on: {changes}", "warning"))
        elif late[cell] < SETTLED_DISTANCE:
            found.append(("settled", "actual"))
        elif changes >= MIN_CHATTER_CHANGES:
            found.append((f"chatters: {changes}", "reference"))
        else:
            found.append(("", "actual"))
    return found
