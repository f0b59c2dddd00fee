"""Approximation, bootstrapping and off-policy sampling, each of which can be taken away.

Baird's star and the two states w and 2w (counterexamples.py): all costs are 0, and so are
all true values, which features and table alike can express. A training has, besides what every one
has, of S learners with d weights each:

    w, h (S, d)  count (S, 1)  random (S, 4)  errors, alive (S,)    labs/algorithms/approximation.py
    error (S, k)     sqrt of the value error after each iteration
    path (S, k, d)   the weights after each of them
"""

from functools import lru_cache

import numpy as np

from labs.algorithms import approximation
from labs.algorithms.approximation import ORACLE, SEMI_GRADIENT_TD, TDC
from labs.algorithms.features import features_from_matrix
from labs.arrays import Training
from labs.problems.episodes import UpdateRule
from labs.reinforcement_learning.function_approximation.counterexamples import (
    Counterexample,
    baird,
    two_states,
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
from labs.resumable import Resumable

DIVERGENCE_LIMIT = 1e6
"""What is larger has diverged."""
HORIZON = 10
"""Steps of an episode on the star, where every start is as likely as every later state."""
LONG_HORIZON = 1000
"""Of an episode of two states on-policy."""


@lru_cache(maxsize=16)
def counterexample_of(
    world: str, gamma: float, ending: float, approximate: bool, off_policy: bool
) -> Counterexample:
    """The task with its features, or with a table that begins with the same values."""
    if world == "star":
        found = baird(HORIZON, gamma, off_policy)
    else:
        # On-policy an episode begins in the first state and runs to its end.
        starts, horizon = ((0, 1), 1) if off_policy else ((0,), LONG_HORIZON)
        found = two_states(gamma, ending, starts, horizon)
    if approximate:
        return found
    phi = found.features.dense
    own = np.diag((phi != 0.0).any(axis=1).astype(float))
    return found._replace(features=features_from_matrix(own), w=phi @ found.w)


def counterexample(params: ApproximationParams) -> Counterexample:
    """What is learned."""
    # Without discount values on the star have no end; in two states an end has to come.
    gamma = min(params.gamma, 0.999)
    return counterexample_of(
        params.world, gamma, params.ending, params.approximate, params.off_policy
    )


def mean_update_matrix(params: ApproximationParams) -> np.ndarray:
    """A (d, d): the mean step of the method is -alpha A w."""
    _, features, _, mdp = counterexample(params)
    phi = features.dense
    mu, P = task_frequencies(params)
    if not params.bootstrap:
        return np.asarray(phi.T @ (mu[:, None] * phi))
    A, _ = approximation.expected_td_update(P, np.zeros(mdp.X), float(mdp.gamma), phi, mu)
    return A


@lru_cache(maxsize=4)
def eigenvalues(params: ApproximationParams) -> np.ndarray:
    """(d,) of -A."""
    return np.linalg.eigvals(-mean_update_matrix(params))


def task_frequencies(params: ApproximationParams) -> tuple[np.ndarray, np.ndarray]:
    """mu (X,), how often each state is learned from, and P (X, X) of the policy judged."""
    P = counterexample(params).mdp.probabilities
    if params.world == "star":
        judged = P[1] if params.off_policy else (6.0 * P[0] + P[1]) / 7.0
        return np.full(7, 1.0 / 7.0), judged
    if params.off_policy:
        return np.array([0.5, 0.5, 0.0]), P[0]
    # The second state is left with probability p; an endless one is cut.
    stay = min(1.0 / max(params.ending, 1.0 / LONG_HORIZON), LONG_HORIZON - 1.0)
    return np.array([1.0, stay, 0.0]) / (1.0 + stay), P[0]


def initial_training(params: ApproximationParams, rng: np.random.Generator) -> Training:
    """The weights of the literature."""
    task, features, w, _ = counterexample(params)
    first = approximation.init(task, features, w, LEARNERS, rng)
    return {
        "steps": np.zeros(1),
        "error": first.errors[:, None],
        "path": first.w[:, None],
        "sound": np.array(True),
    } | arrays_of(first)


def learn(params: ApproximationParams, training: Training) -> Resumable[Training]:
    """The next hundredth of the updates."""
    task, features, _, _ = counterexample(params)
    rule = UpdateRule(params.alpha, params.omega, limit=DIVERGENCE_LIMIT, beta=params.beta)
    method = ORACLE
    if params.bootstrap:
        method = TDC if params.correct else SEMI_GRADIENT_TD
    part = max(1, round(params.updates / ITERATIONS / _episode_length(params)))
    after = approximation.step(task, features, rule, method, predictors_of(training), part)
    arrays = arrays_of(after)
    last = training["error"][:, -1]
    errors = np.where(np.isfinite(after.errors), after.errors, last)
    yield from ()
    return {
        **training,
        **arrays,
        "errors": errors,
        "steps": np.append(training["steps"], float(after.count.max())),
        "error": np.column_stack([training["error"], errors]),
        "path": np.concatenate([training["path"], after.w[:, None]], axis=1),
        "sound": np.array(bool(after.bounded.all())),
    }


def _episode_length(params: ApproximationParams) -> float:
    """Updates an episode makes, on average."""
    if params.world == "star":
        return float(HORIZON)
    if params.off_policy:
        return 1.0
    return float(min(1.0 + 1.0 / max(params.ending, 1.0 / LONG_HORIZON), LONG_HORIZON))
