"""What learning from experience consists of, for the compiled loops of model-free control, and of
Monte Carlo, TD prediction and TD(lambda).

An `EpisodicTask` is a finite MDP seen from inside: a learner cannot look at its tables, it only
starts an episode, applies a control and is told the cost and the next state. An `UpdateRule` says
how far an estimate moves with what it is told: the n-th update of a pair moves it by

    Q(x, u) <- Q(x, u) + alpha_n delta,    alpha_n = alpha / n^omega

omega = 0 is a constant step; 1/2 < omega <= 1 meets the conditions of Robbins and Monro, sum
alpha_n = inf and sum alpha_n^2 < inf (notes, 3.6.5)."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from labs.compiled import compiled, inlined
from labs.problems.finite_mdp import FiniteMDP
from labs.random_numbers import random_integer, uniform

NO_OUTCOMES = np.zeros((0, 0, 0), np.int32)


class EpisodicTask(NamedTuple):
    """A finite MDP and how its episodes begin and end."""

    cost: np.ndarray
    """(X, U)."""
    gamma: float
    terminal: np.ndarray
    """(X,) bool: the episode ends here, at no further cost."""
    successor: np.ndarray
    """(X, U) int32, or empty where transitions are random."""
    cumulative: np.ndarray
    """(U, X, K) sums of P along its rows, or empty where transitions are not random."""
    starts: np.ndarray
    """(k,) int64: an episode starts in any of these."""
    horizon: int
    """Steps after which an episode is cut. The state there is not terminal: its value counts."""
    outcomes: np.ndarray = NO_OUTCOMES
    """(U, X, K) int32: the states that P is of, or empty where it is of all."""


class UpdateRule(NamedTuple):
    """How estimates move."""

    alpha: float = 0.5
    """Step size in [0, 1]."""
    omega: float = 0.0
    """In [0, 1]."""
    n: int = 1
    """Steps of SARSA(n)."""
    trace_decay: float = 0.0
    """lambda of SARSA(lambda), in [0, 1]."""
    replacing: bool = False
    """A pair's trace is set to 1 at a visit instead of growing by 1."""
    offline: bool = False
    """The values stand still through an episode and take all its updates at its end."""
    limit: float = 1e12
    """An estimate beyond this magnitude diverges: the episode is broken off."""
    beta: float = 0.05
    """Step size of the second weights of gradient TD."""


class Learner(NamedTuple):
    """One that learns Q; its arrays change in place. It learns from k episodes at a time."""

    q: np.ndarray
    """(X, U) what it expects to pay."""
    visits: np.ndarray
    """(X, U) int32: how often each control was tried in each state."""
    random: np.ndarray
    """(4,) uint64: the state of its random generator."""
    costs: np.ndarray
    """(k,) discounted cost of each episode, from 0."""
    lengths: np.ndarray
    """(k,) int64: its number of transitions, from 0."""


def episodic_task(mdp: FiniteMDP, starts: Sequence[int], horizon: int) -> EpisodicTask:
    """The episodes of an MDP that start in one of `starts`."""
    certain = mdp.deterministic
    return EpisodicTask(
        cost=np.ascontiguousarray(mdp.C, float),
        gamma=float(mdp.gamma),
        terminal=mdp.terminal,
        successor=mdp.successors if certain else np.zeros((0, 0), np.int32),
        cumulative=np.zeros((0, 0, 0)) if certain else mdp.cumulative,
        starts=np.array(starts, np.int64),
        horizon=int(horizon),
        outcomes=NO_OUTCOMES if mdp.outcomes is None else mdp.outcomes,
    )


@compiled
def initial_state(task: EpisodicTask, random: np.ndarray) -> int:
    """A state to start from, drawn evenly."""
    many = len(task.starts)
    return int(task.starts[0 if many == 1 else random_integer(random, many)])


@compiled
def transition(task: EpisodicTask, x: int, u: int, random: np.ndarray) -> int:
    """The next state."""
    if task.successor.size:
        return int(task.successor[x, u])
    return _sample_transition(task, x, u, random)


@compiled
def _sample_transition(task: EpisodicTask, x: int, u: int, random: np.ndarray) -> int:
    k = np.searchsorted(task.cumulative[u, x], uniform(random), "right")
    return int(task.outcomes[u, x, k]) if task.outcomes.size else int(k)


@inlined
def record_step(
    task: EpisodicTask, learner: Learner, episode: int, x: int, u: int, discount: float
) -> float:
    """Adds what (x, u) costs to an episode; the discount of the cost after it."""
    learner.costs[episode] += discount * task.cost[x, u]
    learner.lengths[episode] += 1
    return discount * task.gamma


@compiled
def min_q(q: np.ndarray, x: int) -> float:
    """min_u Q(x, u)."""
    cost = q[x, 0]
    for u in range(1, q.shape[1]):
        cost = min(cost, q[x, u])
    return float(cost)


@compiled
def step_size(rule: UpdateRule, n: int) -> float:
    """alpha_n of a pair's n-th update."""
    return rule.alpha if rule.omega == 0.0 else _decreasing(rule, n)


@compiled
def _decreasing(rule: UpdateRule, n: int) -> float:
    if rule.omega == 1.0:
        return rule.alpha * (1.0 / n)
    return float(rule.alpha * float(n) ** -rule.omega)
