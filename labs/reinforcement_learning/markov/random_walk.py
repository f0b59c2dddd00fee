"""A walk on a Markov chain, and the distribution it is drawn from, step by step.

In state x the next one is drawn from row x of P (X, X). Of all walks from one start,

    mu_(k+1) = mu_k P,  mu_0 = 1 at the start    are where at step k (mu (X,) sums to 1);
    visits / (k + 1)                             is where this one has been so far.

On an irreducible chain the second tends to the stationary distribution with probability 1
(ergodic theorem), the first where the chain is aperiodic as well (notes, 3.3.1). P may change
between two steps.
"""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class RandomWalk:
    """Where a walk is, and what it has come to. Its arrays are never written into."""

    key: int
    """Of its random numbers; their counter is `steps`."""
    start: int
    at: int
    to: int
    """Where the step under way leads."""
    steps: int
    """Done, k."""
    mu: np.ndarray
    """(X,) distribution after k steps."""
    next_mu: np.ndarray
    """(X,) after the step under way."""
    visits: np.ndarray
    """(X,) how often it was where, the start included."""
    phase: float = 0.0
    """The part of the step under way that is done, in [0, 1)."""


def start_random_walk(P: np.ndarray, start: int, key: int) -> RandomWalk:
    """A walk that has not done a step."""
    there = np.eye(len(P))[start]
    return RandomWalk(
        key, start, start, _sample_state(key, 0, P[start]), 0, there, there @ P, there
    )


def advance_random_walk(P: np.ndarray, walk: RandomWalk, part: float) -> RandomWalk:
    """The walk when another `part` >= 0 of a step is done, which may be several steps."""
    at, to, k, mu = walk.at, walk.to, walk.steps, walk.mu
    visits, phase = walk.visits.copy(), walk.phase + part
    while phase >= 1.0:
        at, mu, k, phase = to, mu @ P, k + 1, phase - 1.0
        visits[at] += 1.0
        to = _sample_state(walk.key, k, P[at])
    return replace(walk, at=at, to=to, steps=k, mu=mu, next_mu=mu @ P, visits=visits, phase=phase)


def _sample_state(key: int, k: int, row: np.ndarray) -> int:
    """The state that random number k picks by the probabilities in a row (X,)."""
    share = np.random.Generator(np.random.Philox(key=key, counter=k)).random()
    picked = int(np.searchsorted(np.cumsum(row), share, side="right"))
    return min(picked, int(np.flatnonzero(row)[-1]))  # rounding may leave the sum short of 1
