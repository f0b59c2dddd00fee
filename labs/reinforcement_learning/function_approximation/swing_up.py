"""Learning to swing up a pendulum: q(x, u, w) = phi(x)' w_u over its plane, five torques.

A training has, besides what every one has, of S learners with d weights for each control:

    w (S, U, d)  visits (S, X, U)  random (S, 4)  alive (S,)    labs/algorithms/linear_control.py
    luck (S, 4)      the generators at the beginning: a fixed batch is drawn from them
    drawn (S,)       updates from the batch
    greedy (S, k)    cost of the greedy policy from hanging at rest, after each iteration
    error (S, k)     root mean square of min_u q - V*

Least squares is fitted Q-iteration: an iteration fits the targets of the last one's weights. The
batch holds short episodes from anywhere under torques drawn at random."""

from functools import lru_cache

import numpy as np

from labs.algorithms import linear_control, policy_iteration
from labs.algorithms.batch_approximation import (
    TransitionBatch,
    collect_transitions,
    fitted_q_iteration,
    replay_q_learning,
)
from labs.algorithms.bellman import q_values
from labs.algorithms.exploration import BehaviourPolicy
from labs.algorithms.features import Features
from labs.algorithms.linear_control import LinearControllers, q_table
from labs.algorithms.policy_evaluation import exact_values
from labs.arrays import Training
from labs.problems.episodes import EpisodicTask, UpdateRule, episodic_task
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.problems.prediction import prediction_task
from labs.reinforcement_learning.function_approximation.feature_sets import plane_features
from labs.reinforcement_learning.function_approximation.given_policy import GAMMA, PENDULUM_GRID
from labs.reinforcement_learning.function_approximation.params import (
    CONTROLLERS,
    ITERATIONS,
    LEARNERS,
    ApproximationParams,
)
from labs.resumable import Resumable, split_work

HORIZON, BATCH_HORIZON = 100, 20
"""Steps of an episode, and of one of the batch."""
DIVERGENCE_LIMIT = 1e4
"""An error beyond this diverges: all costs to come are below 24."""
HANGING_STATE = int(PENDULUM_GRID.state(np.zeros(1), np.zeros(1)))


@lru_cache(maxsize=1)
def swing_task() -> tuple[FiniteMDP, EpisodicTask, np.ndarray]:
    """The model, its episodes from hanging at rest, and Q* (X, U)."""
    mdp = PENDULUM_GRID.mdp(GAMMA)
    value, _, _ = policy_iteration.optimum(mdp, np.zeros(mdp.X, np.int64))
    return mdp, episodic_task(mdp, [HANGING_STATE], HORIZON), q_values(mdp, value)


def features_of(params: ApproximationParams) -> Features:
    """Of the plane's nodes."""
    return plane_features(params.features, round(params.m), PENDULUM_GRID)


def initial_training(params: ApproximationParams, rng: np.random.Generator) -> Training:
    """All weights 0."""
    first = linear_control.init(swing_task()[1], features_of(params), LEARNERS, rng)
    none = np.zeros((LEARNERS, 0))
    return {
        "luck": first.random,
        "drawn": np.zeros(LEARNERS, np.int64),
        "greedy": none,
        "error": none,
        "steps": np.zeros(0),
        "sound": np.array(True),
    } | _arrays(first)


def learn(params: ApproximationParams, training: Training) -> Resumable[Training]:
    """The next hundredth of the episodes, or of the draws from a batch; or the next fit."""
    features = features_of(params)
    rule = UpdateRule(params.alpha, params.omega, limit=DIVERGENCE_LIMIT)
    if params.data == "latest":
        part = max(1, round(params.episodes / ITERATIONS))
        after = yield from _train_by_episodes(params, features, rule, training, part)
    else:
        part = 1
        after = yield from _train_from_batches(params, features, rule, training)
    return (yield from _append_curves(features, {**training, **after}, part))


def _train_by_episodes(
    params: ApproximationParams,
    features: Features,
    rule: UpdateRule,
    training: Training,
    part: int,
) -> Resumable[dict[str, np.ndarray]]:
    method = list(CONTROLLERS).index(params.controller)
    behaviour, (_, task, _) = BehaviourPolicy(epsilon=params.epsilon), swing_task()
    none, done = np.zeros((1, 0)), []
    work = HORIZON * 7 * (features.active.shape[1] + 10)  # five torques looked at, one moved
    for s in range(LEARNERS):
        w, visits, random, alive = (
            training[name][s : s + 1] for name in ("w", "visits", "random", "alive")
        )
        alone = LinearControllers(w, visits, random, none, none.astype(np.int64), alive)
        for some in split_work(part, work):
            alone = linear_control.step(task, features, behaviour, rule, method, alone, some)
            yield
        done.append(_arrays(alone))
    return {name: np.concatenate([one[name] for one in done]) for name in done[0]}


def _train_from_batches(
    params: ApproximationParams, features: Features, rule: UpdateRule, training: Training
) -> Resumable[dict[str, np.ndarray]]:
    w, random, drawn = (training[name].copy() for name in ("w", "random", "drawn"))
    for s, luck in enumerate(training["luck"]):
        batch = collect_batch(luck.tobytes(), round(params.batch))
        if params.data == "batch":
            w[s] = yield from fitted_q_iteration(features, batch, GAMMA, w[s])
            continue
        draws = max(1, round(params.passes * len(batch.x) / ITERATIONS))
        done = int(drawn[s])
        w[s] = yield from replay_q_learning(
            features, batch, GAMMA, rule, w[s], random[s], draws, done
        )
        drawn[s] += draws
    alive = np.abs(w).max(axis=(1, 2)) <= DIVERGENCE_LIMIT
    w = np.where(alive[:, None, None], w, training["w"])
    return {"w": w, "random": random, "drawn": drawn, "alive": alive}


@lru_cache(maxsize=2 * LEARNERS)
def collect_batch(luck: bytes, episodes: int) -> TransitionBatch:
    """Short episodes from anywhere, torques drawn evenly by the generator `luck`."""
    mdp = swing_task()[0]
    unknown = np.zeros(mdp.X)  # nobody asks what the random policy is worth
    task = prediction_task(mdp, random_policy(mdp), unknown, range(mdp.X), BATCH_HORIZON)
    return collect_transitions(task, np.frombuffer(luck, np.uint64).copy(), episodes)


def _arrays(learners: LinearControllers) -> dict[str, np.ndarray]:
    names = ("w", "visits", "random")
    return {name: getattr(learners, name) for name in names} | {"alive": learners.bounded}


def _append_curves(features: Features, training: Training, part: int) -> Resumable[Training]:
    """With another point of each curve."""
    mdp, _, q_star = swing_task()
    greedy, error = [], []
    for w in training["w"]:
        q = q_table(features, w)
        greedy.append(float(exact_values(mdp, q.argmin(axis=1))[HANGING_STATE]))
        error.append(float(np.sqrt(np.mean((q.min(axis=1) - q_star.min(axis=1)) ** 2))))
        yield
    done = float(training["steps"][-1]) if training["steps"].size else 0.0
    return {
        **training,
        "steps": np.append(training["steps"], done + part),
        "greedy": np.column_stack([training["greedy"], greedy]),
        "error": np.column_stack([training["error"], error]),
        "sound": np.array(bool(training["alive"].all())),
    }
