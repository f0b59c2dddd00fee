"""The table of convergence (notes, 3.8.1), alive: nine learners, each on the world that tells.

    rows      MC control, SARSA, Q-learning
    columns   a table, linear features, a nonlinear function

    table       two rooms (`rooms`), told apart
    linear      two rooms that look alike; Q-learning: Baird's star with two controls
    nonlinear   MC control: the wheel (`rooms`); SARSA and Q-learning: the spiral (`spiral`). Its
                controls, to stay and to go on, are free and have the same q, so that all are
                greedy and one is drawn: SARSA's target and Q-learning's are both TD(0)'s, and the
                two panels differ in luck alone

A training has, besides what every one has, after k rounds, cells numbered row by row:

    tables (3, 2, 3)  alike (2, 2, 2)  star (1, 2, 8)  wheel ()  spiral (2,)       the weights
    visits_NAME, random_NAME, alive_NAME                                       of these learners
    shown (9, k)      a number of each that tells how it fares
    distance (9, k)   root mean square of q - the best q
    changes (9, k)    how often the greedy policy of the start has changed so far"""

import numpy as np

from labs.algorithms import linear_control
from labs.algorithms.exploration import FIXED_POLICY, BehaviourPolicy
from labs.algorithms.features import Features
from labs.algorithms.linear_control import LinearControllers, q_table
from labs.arrays import Training
from labs.problems.episodes import EpisodicTask, UpdateRule, episodic_task
from labs.random_numbers import random_states
from labs.reinforcement_learning.function_approximation import rooms, spiral
from labs.reinforcement_learning.function_approximation.counterexamples import baird
from labs.reinforcement_learning.function_approximation.params import (
    ITERATIONS,
    ApproximationParams,
)
from labs.resumable import Resumable

EPISODES = 20_000
"""Of each learner; the rounds get longer by the same factor."""
POLICY_CHECK_INTERVAL = 5
"""Episodes after which the greedy policy is looked at."""
LEARNER_CELLS = {
    "tables": (0, 3, 6),
    "alike": (1, 4),
    "star": (7,),
    "wheel": (2,),
    "spiral": (5, 8),
}
"""The cells of each group of learners."""
LEARNER_ARRAYS = ("visits", "random", "alive")
STAR_RULE = UpdateRule(0.01, limit=1e4)
SPIRAL_RULE = UpdateRule(2e-4, limit=spiral.DIVERGENCE_LIMIT)
SPIRAL_GAMMA = 0.99
_STAR = baird()
_STAR_BEHAVIOUR = BehaviourPolicy(FIXED_POLICY, epsilon=2.0 / 7.0, policy=np.zeros(7, np.int64))


def initial_training(params: ApproximationParams, rng: np.random.Generator) -> Training:
    """Nothing known; on the star the weights of the literature, negative for the other control."""
    training: dict[str, np.ndarray] = {
        "steps": np.zeros(0),
        "sound": np.array(True),
        "wheel": np.array(0.25),
        "spiral": np.zeros(2),
        "random_wheel": random_states(rng, 1),
        "random_spiral": random_states(rng, 2),
        "alive_wheel": np.ones(1, bool),
        "alive_spiral": np.ones(2, bool),
    }
    for name in ("tables", "alike", "star"):
        task, features = _task_and_features(name)
        one = linear_control.init(task, features, 1, rng)
        many = len(LEARNER_CELLS[name])
        training[name] = np.repeat(one.w, many, axis=0)
        training[f"visits_{name}"] = np.repeat(one.visits, many, axis=0)
        training[f"random_{name}"] = np.repeat(one.random, many, axis=0)
        training[f"alive_{name}"] = np.ones(many, bool)
    training["star"] = np.stack([_STAR.w, -_STAR.w])[None]
    for name in ("shown", "distance", "changes"):
        training[name] = np.zeros((9, 0))
    return training


def learn(params: ApproximationParams, training: Training) -> Resumable[Training]:
    """One round of all nine."""
    k = len(training["steps"])
    done = int(training["steps"][-1]) if k else 0
    part = max(1, round(EPISODES ** ((k + 1) / ITERATIONS)) - done)
    after = dict(training)
    changes = training["changes"][:, -1].copy() if k else np.zeros(9)
    for name in ("tables", "alike", "star"):
        for i, cell in enumerate(LEARNER_CELLS[name]):
            changes[cell] += _train_controller(after, name, i, cell, part)
            yield
    wheel, random = float(training["wheel"]), training["random_wheel"].copy()
    before = np.floor(wheel)
    turned = rooms.update_wheel_weight(wheel, random[0], rooms.RULE, part, done)
    changes[2] += abs(np.floor(turned) - before)
    after |= {"wheel": np.array(turned), "random_wheel": random}
    w, random = training["spiral"].copy(), training["random_spiral"].copy()
    alive = training["alive_spiral"].copy()
    for s in np.flatnonzero(alive):
        one = slice(s, s + 1)
        alive[one] = spiral.update_weights(
            w[one], random[one], SPIRAL_RULE, SPIRAL_GAMMA, True, part, done
        )
    after |= {"spiral": w, "random_spiral": random, "alive_spiral": alive}
    shown, distance = _evaluate_learners(after)
    return after | {
        "steps": np.append(training["steps"], float(done + part)),
        "shown": np.column_stack([training["shown"], shown]),
        "distance": np.column_stack([training["distance"], distance]),
        "changes": np.column_stack([training["changes"], changes]),
    }


def within_bounds(training: Training) -> np.ndarray:
    """(9,) bool: which of them have not diverged."""
    found = np.ones(9, bool)
    for name, cells in LEARNER_CELLS.items():
        found[list(cells)] = training[f"alive_{name}"]
    return found


def _task_and_features(name: str) -> tuple[EpisodicTask, Features]:
    if name == "star":
        return episodic_task(_STAR.mdp, range(7), 10), _STAR.features
    return rooms.rooms(), rooms.TABULAR_FEATURES if name == "tables" else rooms.ALIASED_FEATURES


def _train_controller(after: dict[str, np.ndarray], name: str, i: int, cell: int, part: int) -> int:
    """Learner i of a group learns from so many episodes; how often its greedy choice at the start
    changed."""
    (task, features), method = _task_and_features(name), cell // 3
    behaviour, rule = rooms.BEHAVIOUR, rooms.RULE
    if name == "star":
        behaviour, rule = _STAR_BEHAVIOUR, STAR_RULE
    none, parts = np.zeros((1, 0)), [name, *(f"{what}_{name}" for what in LEARNER_ARRAYS)]
    w, visits, random, sound = (after[part_name][i : i + 1] for part_name in parts)
    learner = LinearControllers(w, visits, random, none, none.astype(np.int64), sound)
    changes, left = 0, part
    while left and learner.bounded[0]:
        before = _prefers_left(features, learner.w[0])
        some = min(left, POLICY_CHECK_INTERVAL)
        learner = linear_control.step(task, features, behaviour, rule, method, learner, some)
        changes += before != _prefers_left(features, learner.w[0])
        left -= some
    learned = (learner.w, learner.visits, learner.random, learner.bounded)
    for part_name, array in zip(parts, learned, strict=True):
        after[part_name] = after[part_name].copy()
        after[part_name][i] = array[0]
    return changes


def _prefers_left(features: Features, w: np.ndarray) -> bool:
    """In the first state."""
    phi, active = features.value[0], features.active[0]
    return bool(phi @ w[0, active] <= phi @ w[1, active])


def _evaluate_learners(training: Training) -> tuple[np.ndarray, np.ndarray]:
    """`shown` and `distance` (9,)."""
    shown, distance = np.zeros(9), np.zeros(9)
    for name in ("tables", "alike", "star"):
        _, features = _task_and_features(name)
        for w, cell in zip(training[name], LEARNER_CELLS[name], strict=True):
            q = q_table(features, w)
            if name == "star":
                shown[cell], best = q[6, 0], np.zeros((7, 2))
            else:
                q = q[:2]
                shown[cell] = q[0, 0] - q[0, 1]
                best = rooms.OPTIMAL_Q if cell // 3 == 2 else rooms.EXPLORING_OPTIMAL_Q
            distance[cell] = np.sqrt(np.mean((q - best) ** 2))
    left, right, _, _ = rooms.wheel_q(float(training["wheel"]))
    shown[2] = left - right
    distance[2] = np.sqrt(np.mean((np.array([left, right]) - rooms.WHEEL_COSTS) ** 2))
    values = spiral.spiral_values(training["spiral"])
    shown[[5, 8]] = values[:, 0]
    distance[[5, 8]] = spiral.value_error(training["spiral"])
    return shown, distance
