"""The worlds whose values are fitted with chosen features: the walk, the surface, the swing-up."""

import numpy as np

from labs.algorithms.features import Features
from labs.algorithms.linear_control import q_table
from labs.arrays import Training
from labs.reinforcement_learning.function_approximation import prediction, swing_up
from labs.reinforcement_learning.function_approximation.given_policy import (
    GAMMA,
    PENDULUM_GRID,
    on_map,
)
from labs.reinforcement_learning.function_approximation.learning_world import Fields
from labs.reinforcement_learning.function_approximation.line_picture import draw_line
from labs.reinforcement_learning.function_approximation.motion import (
    PolicyMotion,
    advance_pendulum,
    advance_pendulum_to_goal,
    advance_walker,
)
from labs.reinforcement_learning.function_approximation.params import (
    SHOWN_FEATURES,
    ApproximationParams,
)
from labs.reinforcement_learning.function_approximation.plots import band_fields, reference_lines
from labs.reinforcement_learning.function_approximation.prediction import given_policy
from labs.reinforcement_learning.function_approximation.swing_up import (
    HANGING_STATE,
    features_of,
    swing_task,
)
from labs.resumable import Resumable
from labs.scene import Scene
from labs.tasks.pendulum_table.picture import draw_table, draw_wireframe
from labs.tasks.pendulum_table.policy_arrows import torque_arrows


class PolicyPrediction:
    """The value of a given policy."""

    def initial_training(self, params: ApproximationParams, rng: np.random.Generator) -> Training:
        return prediction.initial_training(params, rng)

    def learn(self, params: ApproximationParams, training: Training) -> Resumable[Training]:
        return prediction.learn(params, training)

    def measure(self, params: ApproximationParams, training: Training) -> dict[str, float]:
        given = given_policy(params)
        measured = {
            "size": float(given.features.size),
            "error_now": float(training["errors"].mean()),
            "error_best": given.best_error,
            "error_fixed": given.fixed_error,
        }
        if params.world == "surface":
            measured["bound"] = given.best_error / (1.0 - GAMMA)
        if training["squares"].size:
            measured["error_squares"] = float(training["squares"].mean())
        return measured

    def fields(self, params: ApproximationParams, training: Training) -> Fields:
        given = given_policy(params)
        found = {"steps": training["steps"]} | band_fields("error", training["error"])
        best, fixed = given.best_error, given.fixed_error
        found |= reference_lines(training, reference_best=best, reference_fixed=fixed)
        if params.data != "latest":
            known = training["squares"].size and len(training["steps"]) > 1
            ends = training["steps"][[0, -1]] if known else np.zeros(0)
            level = training["squares"].mean() if known else 0.0
            found |= {"squares_x": ends, "squares": np.full(len(ends), level)}
        v = given.values(training["w"][params.shown])
        if params.world == "surface":
            return found | _map_fields(params, given.features, v, given.task.truth)
        inside = ~given.mdp.terminal
        named = {"truth": given.task.truth, "estimate": v}
        named |= {"best": given.values(given.best), "fixed": given.values(given.fixed)}
        return (
            found
            | {name: values[inside] for name, values in named.items()}
            | {"state": np.flatnonzero(inside).astype(float)}
            | {"features": _some_features(given.features)[inside]}
        )

    def move(
        self, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> PolicyMotion:
        given = given_policy(params)
        if params.world == "walk":
            return advance_walker(given.task, motion)
        starts = given.task.task.starts
        return advance_pendulum_to_goal(PENDULUM_GRID, given.mdp, given.policy, starts, motion)

    def draw(
        self, scene: Scene, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> None:
        given = given_policy(params)
        if params.world == "surface":
            v = given.values(training["w"][params.shown])
            _draw_relief(scene, params, given.features, v, given.task.truth, None, motion)
            return
        estimates = np.stack([given.values(w) for w in training["w"]])[:, 1:-1]
        features = _some_features(given.features)[1:-1]
        place = int(np.clip(motion.place - 1, 0, len(features) - 1))
        draw_line(scene, given.task.truth[1:-1], estimates, params.shown, features, place)


class SwingUpLearner:
    """The pendulum that learns to swing up."""

    def initial_training(self, params: ApproximationParams, rng: np.random.Generator) -> Training:
        return swing_up.initial_training(params, rng)

    def learn(self, params: ApproximationParams, training: Training) -> Resumable[Training]:
        return swing_up.learn(params, training)

    def measure(self, params: ApproximationParams, training: Training) -> dict[str, float]:
        measured = {
            "size": float(training["w"][0].size),
            "greedy_best": float(swing_task()[2][HANGING_STATE].min()),
        }
        if training["steps"].size:
            measured["greedy_now"] = float(np.median(training["greedy"][:, -1]))
        return measured

    def fields(self, params: ApproximationParams, training: Training) -> Fields:
        _, _, q_star = swing_task()
        q = q_table(features_of(params), training["w"][params.shown])
        found = {"steps": training["steps"]} | band_fields("greedy", training["greedy"], "median")
        found |= reference_lines(training, optimum=float(q_star[HANGING_STATE].min()))
        found |= _map_fields(params, features_of(params), q.min(axis=1), q_star.min(axis=1))
        everywhere = np.ones(PENDULUM_GRID.X, bool)
        return found | {"policy": torque_arrows(PENDULUM_GRID, q.argmin(axis=1), everywhere)}

    def move(
        self, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> PolicyMotion:
        def greedy() -> np.ndarray:
            q = q_table(features_of(params), training["w"][params.shown])
            return np.asarray(q.argmin(axis=1))

        return advance_pendulum(PENDULUM_GRID, swing_task()[0], greedy, motion)

    def draw(
        self, scene: Scene, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> None:
        q = q_table(features_of(params), training["w"][params.shown])
        truth, v = swing_task()[2].min(axis=1), q.min(axis=1)
        policy = q.argmin(axis=1)
        _draw_relief(scene, params, features_of(params), v, truth, policy, motion)


def _some_features(features: Features) -> np.ndarray:
    """(X, k) of them, few enough to be drawn."""
    every = -(-features.size // SHOWN_FEATURES)
    if features.size > 1000 // 2:
        every = features.size // 8
    return features.dense[:, ::every][:, :SHOWN_FEATURES]


def _shown_feature(params: ApproximationParams, features: Features) -> np.ndarray:
    """(X,) the one to look at; the last where there are fewer."""
    i = min(round(params.feature), features.size) - 1
    return np.asarray(np.where(features.active == i, features.value, 0.0).sum(axis=1))


def _map_fields(
    params: ApproximationParams, features: Features, v: np.ndarray, truth: np.ndarray
) -> Fields:
    return {
        "angle": PENDULUM_GRID.angles,
        "velocity": PENDULUM_GRID.velocities,
        "estimate_map": on_map(v),
        "truth_map": on_map(truth),
        "error_map": on_map(v - truth),
        "feature_map": on_map(_shown_feature(params, features)),
    }


def _draw_relief(
    scene: Scene,
    params: ApproximationParams,
    features: Features,
    v: np.ndarray,
    truth: np.ndarray,
    policy: np.ndarray | None,
    motion: PolicyMotion,
) -> None:
    high = float(truth.max())
    phi = _shown_feature(params, features)
    relief = {"estimate": v, "truth": truth, "feature": high * phi / max(np.abs(phi).max(), 1e-9)}
    shown = relief[params.look]
    draw_table(scene, PENDULUM_GRID, shown, high, policy, motion.swing)
    if params.look == "estimate":
        draw_wireframe(scene, PENDULUM_GRID, truth, high)
