"""Learning the value of a given policy: on the line of the random walk and on the pendulum's plane.

A training has, besides what every one has, of S learners with d weights each:

    w, h (S, d)  count (S, 1)  random (S, 4)  errors, alive (S,)    labs/algorithms/approximation.py
    luck (S, 4)      the generators at the beginning: a fixed batch is drawn from them
    error (S, k)     sqrt of the value error after each iteration
    squares (S,)     that of least squares on the batch, where there is one

The batch tells of each of its states what it cost from there on; to an oracle, the true value."""

from functools import lru_cache

import numpy as np

from labs.algorithms import approximation
from labs.algorithms.approximation import (
    GRADIENT_MC,
    ORACLE,
    SEMI_GRADIENT_LAMBDA,
    SEMI_GRADIENT_TD,
)
from labs.algorithms.batch_approximation import (
    REPLAY_MC,
    REPLAY_TD,
    TransitionBatch,
    collect_transitions,
    least_squares_fit,
    lstd,
    replay,
)
from labs.arrays import Training
from labs.problems.episodes import UpdateRule
from labs.reinforcement_learning.function_approximation.given_policy import (
    GivenPolicy,
    pendulum_policy,
    pendulum_prediction_task,
    walk_policy,
)
from labs.reinforcement_learning.function_approximation.params import (
    ITERATIONS,
    LEARNERS,
    ApproximationParams,
)
from labs.reinforcement_learning.function_approximation.predictors import (
    arrays_of,
    predictors_of,
)
from labs.resumable import Resumable, split_work
from labs.tasks.random_walk.walks import THOUSAND_STATE_WALK, walk_task

TARGET_METHODS = {
    "oracle": ORACLE,
    "mc": GRADIENT_MC,
    "td": SEMI_GRADIENT_TD,
    "td-lambda": SEMI_GRADIENT_LAMBDA,
}
EPISODE_STEPS = 100
"""Of an episode, about."""
DIVERGENCE_LIMIT = 1e3
"""No weight that converges gets as large."""


def given_policy(params: ApproximationParams) -> GivenPolicy:
    """What is judged."""
    if params.world == "walk":
        return walk_policy(params.features, round(params.n))
    return pendulum_policy(params.features, round(params.m))


def initial_training(params: ApproximationParams, rng: np.random.Generator) -> Training:
    """All weights 0."""
    given = given_policy(params)
    size = given.features.size
    first = approximation.init(given.task, given.features, np.zeros(size), LEARNERS, rng)
    return {
        "luck": first.random,
        "error": np.zeros((LEARNERS, 0)),
        "squares": np.zeros(0),
        "steps": np.zeros(0),
        "sound": np.array(True),
    } | arrays_of(first)


def learn(params: ApproximationParams, training: Training) -> Resumable[Training]:
    """The next hundredth of the episodes, or of the draws from a batch."""
    given, rule = given_policy(params), _rule(params)
    if params.data == "latest":
        part = max(1, round(params.episodes / ITERATIONS))
        after = yield from _train_by_episodes(params, given, rule, training, part)
        return _append_curves(training, after, part)
    batches = []
    for luck in training["luck"]:
        batch = collect_batch(params.world, luck.tobytes(), round(params.batch))
        if params.batch_target == "oracle":
            batch = batch._replace(returns=given.task.truth[batch.x])
        batches.append(batch)
        yield
    if not training["squares"].size:
        fitted = []
        for batch in batches:
            fitted.append(_least_squares(given, batch, _bootstraps(params)))
            yield
        training = {**training, "squares": np.array([given.error(w) for w in fitted])}
        if params.data == "batch":
            return _append_curves(
                training, {"w": np.stack(fitted), "errors": training["squares"]}, 1
            )
    after = yield from _train_by_replay(params, given, rule, training, batches)
    return _append_curves(training, after, 1)


def _train_by_episodes(
    params: ApproximationParams,
    given: GivenPolicy,
    rule: UpdateRule,
    training: Training,
    part: int,
) -> Resumable[dict[str, np.ndarray]]:
    """After so many further episodes, one learner after the other."""
    features, method = given.features, TARGET_METHODS[params.target]
    work = EPISODE_STEPS * (3 * (features.active.shape[1] + 10))
    if method == SEMI_GRADIENT_LAMBDA:
        work += EPISODE_STEPS * 2 * features.size  # the traces of all weights
    names, done = arrays_of(predictors_of(training)), []
    for s in range(LEARNERS):
        alone = predictors_of({name: array[s : s + 1] for name, array in names.items()})
        for some in split_work(part, work):
            alone = approximation.step(given.task, features, rule, method, alone, some)
            yield
        done.append(arrays_of(alone))
    return {name: np.concatenate([one[name] for one in done]) for name in names}


def _train_by_replay(
    params: ApproximationParams,
    given: GivenPolicy,
    rule: UpdateRule,
    training: Training,
    batches: list[TransitionBatch],
) -> Resumable[dict[str, np.ndarray]]:
    """After as many draws as make a hundredth of the uses of all samples."""
    w, random, count = (training[name].copy() for name in ("w", "random", "count"))
    method = REPLAY_TD if _bootstraps(params) else REPLAY_MC
    for s, batch in enumerate(batches):
        draws = max(1, round(params.passes * len(batch.x) / ITERATIONS))
        gamma, done = float(given.mdp.gamma), int(count[s, 0])
        w[s] = yield from replay(
            given.features, batch, gamma, rule, method, w[s], random[s], draws, done
        )
        count[s] += draws
    alive = np.abs(w).max(axis=1) <= DIVERGENCE_LIMIT
    w = np.where(alive[:, None], w, training["w"])
    errors = np.array([given.error(weights) for weights in w])
    return {"w": w, "random": random, "count": count, "errors": errors, "alive": alive}


@lru_cache(maxsize=2 * LEARNERS)
def collect_batch(world: str, luck: bytes, episodes: int) -> TransitionBatch:
    """What so many episodes hold, drawn by the generator `luck`."""
    task = walk_task(THOUSAND_STATE_WALK) if world == "walk" else pendulum_prediction_task()[0]
    return collect_transitions(task, np.frombuffer(luck, np.uint64).copy(), episodes)


def _least_squares(given: GivenPolicy, batch: TransitionBatch, bootstraps: bool) -> np.ndarray:
    if bootstraps:
        return lstd(given.features, batch, float(given.mdp.gamma))
    return least_squares_fit(given.features, batch)


def _bootstraps(params: ApproximationParams) -> bool:
    return params.batch_target == "td"


def _rule(params: ApproximationParams) -> UpdateRule:
    return UpdateRule(params.alpha, params.omega, trace_decay=params.decay, limit=DIVERGENCE_LIMIT)


def _append_curves(training: Training, after: dict[str, np.ndarray], part: int) -> Training:
    """With another point of each curve."""
    together = {**training, **after}
    last = training["error"][:, -1] if training["steps"].size else training["errors"]
    errors = np.where(np.isfinite(together["errors"]), together["errors"], last)
    done = float(training["steps"][-1]) if training["steps"].size else 0.0
    return {
        **together,
        "errors": errors,
        "steps": np.append(training["steps"], done + part),
        "error": np.column_stack([training["error"], errors]),
        "sound": np.array(bool(together["alive"].all())),
    }
