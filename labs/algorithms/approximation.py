"""Prediction with linear features (notes, 3.7): many learners of V^pi at once, each on its own.

As in `prediction`, `init` knows nothing and `step` learns from some more episodes; both leave the
old learners alone. The methods are in `linear_prediction`, features in `features`. What they lead
to, for a weight mu(x) > 0 of the states, D = diag(mu), Phi (X, d) and the chain P, C of the policy:

    MC, oracle    the least value error, sum over x of mu(x) (v(x) - V(x))^2:
                  Phi' D Phi w = Phi' D V
    TD(0), TDC    the TD fixed point: A w = b,  A = Phi' D (I - gamma P) Phi,  b = Phi' D C,
                  its error at most 1 / (1 - gamma) times the least, if mu is the policy's own

The mean step of TD is alpha (b - A w): it converges where all eigenvalues of A have positive real
parts, which is sure where mu is the policy's own share of visits, and of no other."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from labs.algorithms.features import Features, evaluate, state_values
from labs.algorithms.linear_prediction import (
    gradient_monte_carlo,
    gradient_oracle,
    gradient_td,
    semi_gradient_lambda,
    semi_gradient_n_step,
    semi_gradient_td,
)
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.episodes import UpdateRule
from labs.problems.prediction import (
    PredictionTask,
    empty_episode,
    root_mean_square_error,
    sample_episode,
    weighted_error,
)
from labs.random_numbers import random_states

GRADIENT_MC, SEMI_GRADIENT_TD, SEMI_GRADIENT_N_STEP, SEMI_GRADIENT_LAMBDA, TDC, ORACLE = range(6)
_OFF_POLICY = (SEMI_GRADIENT_TD, SEMI_GRADIENT_LAMBDA, TDC, ORACLE)


@dataclass(frozen=True, eq=False)
class LinearPredictors:
    """S learners of one task, who differ only in their luck."""

    w: np.ndarray
    """(S, d) weights."""
    h: np.ndarray
    """(S, d) second weights, of TDC."""
    count: np.ndarray
    """(S, 1) int64: updates made."""
    random: np.ndarray
    """(S, 4) uint64: the states of their random generators."""
    errors: np.ndarray
    """(S,) weighted error sqrt(sum of weight (v - V)^2); infinite once diverged."""
    bounded: np.ndarray
    """(S,) bool: False once a weight has left the rule's limit; the learner then stands still,
    with the weights from before that episode."""


def init(
    task: PredictionTask, features: Features, w: np.ndarray, seeds: int, rng: np.random.Generator
) -> LinearPredictors:
    """Learners with the weights w (d,). Raises LabError where features do not fit the task."""
    if len(features.active) != len(task.truth) or w.shape != (features.size,):
        raise LabError(
            f"{len(features.active)} states have features and {len(task.truth)} are in the task; "
            f"of {w.shape} weights there must be {features.size}"
        )
    if features.value[task.task.terminal].any():
        raise LabError("in terminal states all features are 0, as is the value")
    first = root_mean_square_error(task, state_values(features, w))
    return LinearPredictors(
        w=np.tile(np.asarray(w, float), (seeds, 1)),
        h=np.zeros((seeds, features.size)),
        count=np.zeros((seeds, 1), np.int64),
        random=random_states(rng, seeds),
        errors=np.full(seeds, first),
        bounded=np.ones(seeds, bool),
    )


def step(
    task: PredictionTask,
    features: Features,
    rule: UpdateRule,
    method: int,
    learners: LinearPredictors,
    episodes: int,
) -> LinearPredictors:
    """The learners after so many further episodes. Raises LabError where the pieces do not fit."""
    if learners.w.shape[1] != features.size:
        raise LabError(f"{learners.w.shape[1]} weights for {features.size} features")
    if method not in range(6):
        raise LabError(f"there is no method {method}: they are numbered from 0 to 5")
    if task.ratio.size and method not in _OFF_POLICY:
        raise LabError("this method learns the value of the policy it follows, of no other")
    if not (rule.alpha >= 0.0 and rule.beta >= 0.0 and 0.0 <= rule.trace_decay <= 1.0):
        raise LabError(f"{rule}: steps are at least 0, lambda is from 0 to 1")
    if rule.n < 1:
        raise LabError(f"n = {rule.n}: takes a whole number from 1")
    arrays = (learners.w, learners.h, learners.count, learners.random, learners.errors)
    w, h, count, random, errors = (array.copy() for array in arrays)
    sound = learners.bounded.copy()
    _learn(task, features, rule, method, w, h, count, random, errors, sound, episodes)
    return LinearPredictors(w, h, count, random, errors, sound)


def expected_td_update(
    P: np.ndarray, C: np.ndarray, gamma: float, phi: np.ndarray, mu: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A (d, d) and b (d,) of TD(0)'s mean step alpha (b - A w), for a chain P (X, X), C (X,) whose
    states are met with frequencies mu (X,)."""
    weighed = phi.T * mu
    return weighed @ (phi - gamma * P @ phi), weighed @ C


def td_fixed_point(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """w (d,) with A w = b, the shortest of all where features depend on one another."""
    return minimum_norm_solution(A, b)


def weighted_least_squares(V: np.ndarray, phi: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """w (d,) of the least value error."""
    root = np.sqrt(mu)
    return minimum_norm_solution(phi * root[:, None], V * root)


def minimum_norm_solution(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """w (d,) of least |A w - b|, the shortest where there are several. By a QR factorisation that
    reveals the rank: several times as fast as by singular values."""
    rounding = np.finfo(float).eps * max(A.shape)
    return np.asarray(scipy.linalg.lstsq(A, b, cond=rounding, lapack_driver="gelsy")[0])


@compiled
def _learn(
    task: PredictionTask,
    features: Features,
    rule: UpdateRule,
    method: int,
    weights: np.ndarray,
    seconds: np.ndarray,
    counts: np.ndarray,
    random: np.ndarray,
    errors: np.ndarray,
    sound: np.ndarray,
    episodes: int,
) -> None:
    episode = empty_episode(task.task.horizon)
    before, V = np.empty(features.size), np.empty(len(task.truth))
    for s in range(len(weights)):
        w, h, count = weights[s], seconds[s], counts[s]
        for _ in range(episodes):
            if not sound[s]:
                break
            before[:] = w
            T = sample_episode(task, random[s], episode)
            if method == GRADIENT_MC:
                gradient_monte_carlo(task, features, episode, T, rule, w, count)
            elif method == ORACLE:
                gradient_oracle(task, features, episode, T, rule, w, count)
            elif method == SEMI_GRADIENT_TD:
                semi_gradient_td(task, features, episode, T, rule, w, count)
            elif method == SEMI_GRADIENT_N_STEP:
                semi_gradient_n_step(task, features, episode, T, rule, w, count)
            elif method == SEMI_GRADIENT_LAMBDA:
                semi_gradient_lambda(task, features, episode, T, rule, w, count)
            else:
                gradient_td(task, features, episode, T, rule, w, h, count)
            for weight in w:
                sound[s] = sound[s] and abs(weight) <= rule.limit
            if not sound[s]:
                w[:] = before
        for x in range(len(V)):
            V[x] = evaluate(features, w, x)
        errors[s] = weighted_error(task, V) if sound[s] else np.inf
