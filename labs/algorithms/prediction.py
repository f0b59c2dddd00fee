"""Model-free prediction (notes, 3.5): many learners of V^pi at once, each on its own.

`init` knows nothing, `step` learns from some more episodes; both return new learners and leave the
old ones alone, so that any of them can be looked at again or gone on from, bit for bit. The methods
are in `monte_carlo`, `temporal_difference` and `td_lambda`. Learners of equal random states meet
the same episodes, whatever their method and their step sizes are."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms import policy_evaluation
from labs.algorithms.monte_carlo import every_visit, first_visit
from labs.algorithms.td_lambda import eligibility_traces, lambda_return, true_online
from labs.algorithms.temporal_difference import n_step, td0
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.episodes import UpdateRule
from labs.problems.finite_mdp import FiniteMDP
from labs.problems.prediction import (
    PredictionTask,
    empty_episode,
    prediction_task,
    sample_episode,
    weighted_error,
)
from labs.random_numbers import random_states

FIRST_VISIT, EVERY_VISIT, TD0, N_STEP, LAMBDA_RETURN, ELIGIBILITY_TRACES, TRUE_ONLINE = range(7)


@dataclass(frozen=True, eq=False)
class Predictors:
    """S learners of one task, who differ only in their luck."""

    V: np.ndarray
    """(S, X) what they expect to pay from each state on."""
    visits: np.ndarray
    """(S, X) int32: how often each state was learned from."""
    random: np.ndarray
    """(S, 4) uint64: the states of their random generators."""
    errors: np.ndarray
    """(S, k) weighted error after each episode of the last step; infinite once diverged."""
    lengths: np.ndarray
    """(S, k) int64: its number of steps."""
    bounded: np.ndarray
    """(S,) bool: False once an estimate has left the rule's limit; the learner then stands still,
    with the values from before that episode."""


def on_policy_task(
    mdp: FiniteMDP, policy: np.ndarray, starts: Sequence[int], horizon: int
) -> PredictionTask:
    """Prediction of a policy (X,) or (X, U) while it is followed; the truth by policy evaluation.
    Raises LabError where it has no finite value."""
    return prediction_task(
        mdp, policy, policy_evaluation.exact_values(mdp, policy), starts, horizon
    )


def init(task: PredictionTask, seeds: int, rng: np.random.Generator, v0: float = 0.0) -> Predictors:
    """Learners who expect to pay v0 from every state on but the terminal ones."""
    terminal = task.task.terminal
    return Predictors(
        V=np.tile(np.where(terminal, 0.0, v0), (seeds, 1)),
        visits=np.zeros((seeds, len(terminal)), np.int32),
        random=random_states(rng, seeds),
        errors=np.zeros((seeds, 0)),
        lengths=np.zeros((seeds, 0), np.int64),
        bounded=np.ones(seeds, bool),
    )


def step(
    task: PredictionTask, rule: UpdateRule, method: int, learners: Predictors, episodes: int
) -> Predictors:
    """The learners after so many further episodes. Raises LabError where the pieces do not fit."""
    _check(task, rule, method, learners)
    V, visits, random = learners.V.copy(), learners.visits.copy(), learners.random.copy()
    errors = np.zeros((len(V), episodes))
    lengths = np.zeros((len(V), episodes), np.int64)
    sound = learners.bounded.copy()
    _learn(task, rule, method, V, visits, random, errors, lengths, sound)
    return replace(
        learners,
        V=V,
        visits=visits,
        random=random,
        errors=errors,
        lengths=lengths,
        bounded=sound,
    )


@compiled
def _learn(
    task: PredictionTask,
    rule: UpdateRule,
    method: int,
    values: np.ndarray,
    visits: np.ndarray,
    random: np.ndarray,
    errors: np.ndarray,
    lengths: np.ndarray,
    sound: np.ndarray,
) -> None:
    gamma, terminal = task.task.gamma, task.task.terminal
    episode, before = empty_episode(task.task.horizon), np.empty(values.shape[1])
    for s in range(len(values)):
        V, N = values[s], visits[s]
        for k in range(errors.shape[1]):
            if not sound[s]:
                errors[s, k] = np.inf
                continue
            before[:] = V
            T = sample_episode(task, random[s], episode)
            ended = terminal[episode.states[T]]
            if method == FIRST_VISIT:
                first_visit(gamma, episode, T, ended, rule, V, N)
            elif method == EVERY_VISIT:
                every_visit(gamma, episode, T, ended, rule, V, N)
            elif method == TD0:
                td0(gamma, episode, T, rule, V, N)
            elif method == N_STEP:
                n_step(gamma, episode, T, rule, V, N)
            elif method == LAMBDA_RETURN:
                lambda_return(gamma, episode, T, rule, V, N)
            elif method == ELIGIBILITY_TRACES:
                eligibility_traces(gamma, episode, T, rule, V, N)
            else:
                true_online(gamma, episode, T, rule, V, N)
            lengths[s, k] = T
            if not _within_limit(V, rule.limit):
                V[:], sound[s] = before, False
            errors[s, k] = weighted_error(task, V) if sound[s] else np.inf


@compiled
def _within_limit(V: np.ndarray, limit: float) -> bool:
    worst = 0.0
    for value in V:
        worst = max(worst, abs(value)) if value == value else np.inf
    return worst <= limit


def _check(task: PredictionTask, rule: UpdateRule, method: int, learners: Predictors) -> None:
    states = len(task.truth)
    if learners.V.shape[1] != states:
        raise LabError(
            f"the learners' V has {learners.V.shape[1]} states, the task {states}: they must agree"
        )
    if task.ratio.size:
        raise LabError("these methods learn the value of the policy they follow, of no other")
    if method not in range(7):
        raise LabError(f"there is no method {method}: they are numbered from 0 to 6")
    if rule.offline and method == TRUE_ONLINE:
        raise LabError("true online TD(lambda) has no offline form")
    for name, value in (("alpha", rule.alpha), ("omega", rule.omega), ("lambda", rule.trace_decay)):
        if not 0.0 <= value <= 1.0:
            raise LabError(f"{name} = {value}: takes a number from 0 to 1")
    if rule.n < 1 or task.task.horizon < 1:
        raise LabError(f"n = {rule.n}, horizon = {task.task.horizon}: both are at least 1")
