"""Batch prediction: everything that can be learned from the episodes there are (notes, 3.5.3 and
3.8.2).

Monte Carlo and TD(0), given the same few episodes again and again with a small step, settle, and
not at the same answer. With N(x) visits, n(x, y) transitions, sums c(x) of the costs and J(x) of
the costs-to-go of all visits, a sweep over the whole batch with V standing still moves it by

    MC       V(x) <- V(x) + alpha (J(x) - N(x) V(x))
    TD(0)    V(x) <- V(x) + alpha (c(x) + gamma sum over y of n(x, y) V(y) - N(x) V(x))

MC settles at the least-squares fit J(x) / N(x) of the costs-to-go that were seen, TD(0) at the
certainty-equivalence value, the exact one of the most likely model: P(x, y) = n(x, y) / N(x),
C(x) = c(x) / N(x). Those sums are all a batch needs to remember. Both sweeps shrink what is left
if alpha max N(x) <= 1. States that were never visited keep their values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labs.algorithms.monte_carlo import costs_to_go
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.prediction import PredictionTask, empty_episode, sample_episode
from labs.random_numbers import random_states


@dataclass(frozen=True, eq=False)
class Batch:
    """The episodes that each of S learners has seen, as sums. Arrays are never written into."""

    visits: np.ndarray
    """(S, X) N(x): the steps that began in x."""
    transitions: np.ndarray
    """(S, X, X) n(x, y)."""
    costs: np.ndarray
    """(S, X) c(x)."""
    returns: np.ndarray
    """(S, X) J(x)."""
    random: np.ndarray
    """(S, 4) uint64: the states of the random generators of episodes to come."""


def empty_batch(states: int, seeds: int, rng: np.random.Generator) -> Batch:
    """Before the first episode of an MDP of so many states."""
    shape = (seeds, states)
    return Batch(
        visits=np.zeros(shape),
        transitions=np.zeros((*shape, states)),
        costs=np.zeros(shape),
        returns=np.zeros(shape),
        random=random_states(rng, seeds),
    )


def collect_episodes(task: PredictionTask, batch: Batch, episodes: int) -> Batch:
    """So many further episodes. Raises LabError where one was cut: it has no cost-to-go."""
    sums = [batch.visits, batch.transitions, batch.costs, batch.returns, batch.random]
    visits, transitions, costs, returns, random = (array.copy() for array in sums)
    if not _collect(task, visits, transitions, costs, returns, random, episodes):
        raise LabError(f"an episode was cut after {task.task.horizon} steps: let them end")
    return Batch(visits, transitions, costs, returns, random)


def batch_from_episodes(
    episodes: Sequence[tuple[Sequence[int], Sequence[float]]], states: int, gamma: float
) -> Batch:
    """One learner's batch of given episodes: states x_0 ... x_T, the last one terminal, and costs
    l_0 ... l_(T-1)."""
    batch = empty_batch(states, 1, np.random.default_rng(0))
    for xs, costs in episodes:
        J = 0.0
        for x, y, cost in reversed(list(zip(xs[:-1], xs[1:], costs, strict=True))):
            J = cost + gamma * J
            batch.visits[0, x] += 1.0
            batch.transitions[0, x, y] += 1.0
            batch.costs[0, x] += cost
            batch.returns[0, x] += J
    return batch


def monte_carlo_sweep(batch: Batch, V: np.ndarray, alpha: float) -> np.ndarray:
    """V (S, X) after one sweep of batch Monte Carlo."""
    return np.asarray(V + alpha * (batch.returns - batch.visits * V))


def td_sweep(batch: Batch, V: np.ndarray, gamma: float, alpha: float) -> np.ndarray:
    """V (S, X) after one sweep of batch TD(0)."""
    targets = batch.costs + gamma * np.einsum("sxy,sy->sx", batch.transitions, V)
    return np.asarray(V + alpha * (targets - batch.visits * V))


def least_squares(batch: Batch, V: np.ndarray) -> np.ndarray:
    """(S, X) the answer of batch Monte Carlo; V (S, X) where nothing was seen."""
    fit: np.ndarray = np.divide(batch.returns, batch.visits, out=V.copy(), where=batch.visits > 0.0)
    return fit


def certainty_equivalence(batch: Batch, V: np.ndarray, gamma: float) -> np.ndarray:
    """(S, X) the answer of batch TD(0); V (S, X) where nothing was seen. Each state that was seen
    must have been seen to lead to an end, or gamma < 1."""
    seen = batch.visits > 0.0
    eye = np.eye(V.shape[1])
    A = np.where(seen[..., None], batch.visits[..., None] * eye - gamma * batch.transitions, eye)
    b = np.where(seen, batch.costs, V)
    return np.asarray(np.linalg.solve(A, b[..., None])[..., 0])


@compiled
def _collect(
    task: PredictionTask,
    visits: np.ndarray,
    transitions: np.ndarray,
    costs: np.ndarray,
    returns: np.ndarray,
    random: np.ndarray,
    episodes: int,
) -> bool:
    episode = empty_episode(task.task.horizon)
    for s in range(len(visits)):
        for _ in range(episodes):
            T = sample_episode(task, random[s], episode)
            if not task.task.terminal[episode.states[T]]:
                return False
            costs_to_go(task.task.gamma, episode, T, 0.0)
            for t in range(T):
                x = episode.states[t]
                visits[s, x] += 1.0
                transitions[s, x, episode.states[t + 1]] += 1.0
                costs[s, x] += episode.costs[t]
                returns[s, x] += episode.returns[t]
    return True
