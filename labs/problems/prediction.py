"""Prediction: what a given policy costs, learned from its episodes (notes, 3.5), for the labs of
prediction, TD(lambda) and function approximation.

A `PredictionTask` is an episodic task together with the policy that is followed. What is learned
has no say in what happens, so that an episode

    x_0, u_0, l_0, x_1, u_1, l_1, ..., x_T

is drawn first and learned from afterwards, by any method, in the order of its steps. It ends in a
terminal state, or is cut at the horizon in a state whose value still counts.

Off-policy, a behaviour b(u | x) is followed and the value of another policy pi is asked for; each
transition then counts with the ratio rho = pi(u | x) / b(u | x), which is 1 on-policy."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from labs.compiled import compiled, inlined
from labs.errors import LabError
from labs.problems.episodes import EpisodicTask, episodic_task, initial_state, transition
from labs.problems.finite_mdp import FiniteMDP, cumulative_sums
from labs.random_numbers import random_integer, uniform


class PredictionTask(NamedTuple):
    """A policy on an MDP, and the answer by which learners are judged."""

    task: EpisodicTask
    choices: np.ndarray
    """(X, U) sums of the probabilities of the controls along each row; the last ones exactly 1. Or
    (0, U) where all controls are alike everywhere."""
    ratio: np.ndarray
    """(X, U) rho, or (0, 0) where all are 1: on-policy."""
    truth: np.ndarray
    """(X,) V^pi."""
    weight: np.ndarray
    """(X,) what the squared error of each state counts in the mean: at least 0, the sum 1."""


class Episode(NamedTuple):
    """Room for an episode of T steps, H of them at most; what is beyond T has no meaning."""

    states: np.ndarray
    """(H + 1,) int64: x_0 ... x_T."""
    controls: np.ndarray
    """(H,) int64."""
    costs: np.ndarray
    """(H,)."""
    returns: np.ndarray
    """(H,) room for the costs-to-go of a learner."""


def prediction_task(
    mdp: FiniteMDP,
    policy: np.ndarray,
    truth: np.ndarray,
    starts: Sequence[int],
    horizon: int,
    weight: np.ndarray | None = None,
    target: np.ndarray | None = None,
) -> PredictionTask:
    """Episodes under `policy` (X,) or (X, U), judged by `truth` (X,), in all states alike but the
    terminal ones if no `weight` is given. Off-policy, `target` (X, U) is the policy whose value is
    asked for. Raises LabError where `policy` never tries what `target` does."""
    followed = _probabilities(mdp, policy)
    ratio = np.zeros((0, 0))
    if target is not None:
        wanted = _probabilities(mdp, target)
        if (wanted[followed == 0.0] > 0.0).any():
            raise LabError("the target policy does what the followed one never tries")
        ratio = np.divide(wanted, followed, out=np.zeros_like(wanted), where=followed > 0.0)
    if weight is None:
        weight = (~mdp.terminal).astype(float)
    if len(truth) != mdp.X or len(weight) != mdp.X or not np.isfinite(truth).all():
        raise LabError(f"truth and weight have a finite number for each of {mdp.X} states")
    return PredictionTask(
        task=episodic_task(mdp, starts, horizon),
        choices=_cumulative_policy(followed),
        ratio=ratio,
        truth=np.ascontiguousarray(truth, float),
        weight=weight / weight.sum(),
    )


@compiled
def empty_episode(horizon: int) -> Episode:
    """Room for so many steps."""
    return Episode(
        np.empty(horizon + 1, np.int64),
        np.empty(horizon, np.int64),
        np.empty(horizon),
        np.empty(horizon),
    )


@compiled
def sample_episode(task: PredictionTask, random: np.ndarray, episode: Episode) -> int:
    """Writes an episode; its number of steps T. `random` (4,) changes in place."""
    inner = task.task
    x, t = initial_state(inner, random), 0
    episode.states[0] = x
    while t < inner.horizon and not inner.terminal[x]:
        u = _sample_control(task.choices, x, random)
        episode.controls[t], episode.costs[t] = u, inner.cost[x, u]
        x, t = transition(inner, x, u, random), t + 1
        episode.states[t] = x
    return t


@compiled
def sample_step(task: PredictionTask, x: int, random: np.ndarray) -> tuple[int, int]:
    """A control of the policy in state x, and the next state, as in an episode."""
    u = _sample_control(task.choices, x, random)
    return u, transition(task.task, x, u, random)


@inlined
def _sample_control(choices: np.ndarray, x: int, random: np.ndarray) -> int:
    controls = choices.shape[1]
    if len(choices) == 0:
        return random_integer(random, controls)
    drawn = uniform(random)
    if controls > 8:
        return int(np.searchsorted(choices[x], drawn, "right"))
    u = 0
    while choices[x, u] <= drawn:
        u += 1
    return u


@inlined
def importance_ratio(task: PredictionTask, x: int, u: int) -> float:
    """rho of a transition."""
    return float(task.ratio[x, u]) if task.ratio.size else 1.0


@compiled
def weighted_error(task: PredictionTask, V: np.ndarray) -> float:
    """sqrt(sum of weight (V - V^pi)^2) of V (X,)."""
    total = 0.0
    for x in range(len(V)):
        total += task.weight[x] * (V[x] - task.truth[x]) ** 2
    return float(np.sqrt(total))


def root_mean_square_error(task: PredictionTask, V: np.ndarray) -> np.ndarray:
    """(...) the same of V (..., X), not compiled."""
    return np.asarray(np.sqrt((V - task.truth) ** 2 @ task.weight))


def _probabilities(mdp: FiniteMDP, policy: np.ndarray) -> np.ndarray:
    if policy.ndim == 1:
        return np.asarray(np.eye(mdp.U)[policy])
    if policy.shape != mdp.C.shape or not np.allclose(policy.sum(axis=1), 1.0, atol=1e-9):
        raise LabError(
            f"a random policy has {mdp.X} rows of {mdp.U} probabilities that sum to 1; "
            f"given: shape {policy.shape}"
        )
    return policy


def _cumulative_policy(probabilities: np.ndarray) -> np.ndarray:
    if (probabilities == 1.0 / probabilities.shape[1]).all():
        return np.zeros((0, probabilities.shape[1]))
    return cumulative_sums(probabilities)
