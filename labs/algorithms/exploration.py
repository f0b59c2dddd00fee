"""Behaviour policies: which control to try, given what was learned so far (notes, 3.6.4, 3.6.5).

With costs Q (X, U), visits N (X, U) and n(x) = 1 + sum_u N(x, u), the visit that is now:

    epsilon-greedy   u = argmin_u Q(x, u), but with probability eps_n any control
    Boltzmann        P(u) proportional to exp(-beta_n Q(x, u))
    confidence       u = argmin_u Q(x, u) - L sqrt(2 log n / N(x, u)), untried controls first
    follow           u = mu(x), but with probability eps_n any control: somebody else drives

Greedy in the limit with infinite exploration (GLIE) for decay 0 < d <= 1:

    eps_n = eps / n^d          (d = 0: constant; the notes' 1/k is d = 1)
    beta_n = beta (1 + log n)  where d > 0

Both are counted by visits of the state, so that a state seen for the first time is explored,
however late that is. Ties are broken at random."""

from typing import NamedTuple

import numpy as np

from labs.compiled import compiled, copied
from labs.random_numbers import below, uniform

EPSILON_GREEDY, BOLTZMANN, CONFIDENCE, FOLLOW = range(4)


class Behavior(NamedTuple):
    """How controls are chosen while learning."""

    kind: int = EPSILON_GREEDY
    epsilon: float = 0.1
    """In [0, 1]."""
    decay: float = 0.0
    """d in [0, 1]."""
    beta: float = 1.0
    """Inverse temperature [1/cost]."""
    bound: float = 1.0
    """L [cost]."""
    policy: np.ndarray = np.zeros(0, np.int64)
    """(X,) int64: mu, for FOLLOW; empty otherwise."""


@copied
def choose(behavior: Behavior, x: int, q: np.ndarray, visits: np.ndarray, state: np.ndarray) -> int:
    """The control to try in state x, from Q and N, both (X, U)."""
    if behavior.kind != EPSILON_GREEDY or behavior.decay > 0.0:
        return _otherwise(behavior, x, q, visits, state)
    if uniform(state) < behavior.epsilon:
        return below(state, q.shape[1])
    return greedy(q, x, state)


@compiled
def greedy(q: np.ndarray, x: int, state: np.ndarray) -> int:
    """The control of least Q(x, u); among equals, any."""
    least, best, ties = q[x, 0], 0, 1
    for u in range(1, q.shape[1]):
        cost = q[x, u]
        if cost < least:
            least, best, ties = cost, u, 1
        elif cost == least:
            ties += 1
    return best if ties == 1 else _among_equals(q, x, best, ties, state)


@compiled
def boltzmann(costs: np.ndarray, beta: float, state: np.ndarray) -> int:
    """A control with probability proportional to exp(-beta cost). Costs (U,) count from the least
    one, so that nothing overflows."""
    least, total = costs.min(), 0.0
    for cost in costs:
        total += np.exp(-beta * (cost - least))
    left = uniform(state) * total
    for u in range(len(costs)):
        left -= np.exp(-beta * (costs[u] - least))
        if left < 0.0:
            return u
    return int(np.argmin(costs))


@compiled
def confidence(costs: np.ndarray, visits: np.ndarray, bound: float, state: np.ndarray) -> int:
    """The control of the lowest confidence bound; an untried one comes before all others. Costs
    and visits are (U,)."""
    scores = np.empty((1, len(costs)))
    logarithm = 2.0 * np.log(1.0 + visits.sum())
    for u in range(len(costs)):
        if visits[u] == 0:
            scores[0, u] = -np.inf
        else:
            scores[0, u] = costs[u] - bound * np.sqrt(logarithm / visits[u])
    return greedy(scores, 0, state)


@compiled
def _otherwise(
    behavior: Behavior, x: int, q: np.ndarray, visits: np.ndarray, state: np.ndarray
) -> int:
    """Whatever is not epsilon-greedy with a constant epsilon."""
    if behavior.kind == CONFIDENCE:
        return confidence(q[x], visits[x], behavior.bound, state)
    n = 1.0 + visits[x].sum() if behavior.decay > 0.0 else 1.0
    if behavior.kind == BOLTZMANN:
        return boltzmann(q[x], behavior.beta * (1.0 + np.log(n)), state)
    if uniform(state) < behavior.epsilon * n**-behavior.decay:
        return below(state, q.shape[1])
    return int(behavior.policy[x]) if behavior.kind == FOLLOW else greedy(q, x, state)


@compiled
def _among_equals(q: np.ndarray, x: int, best: int, ties: int, state: np.ndarray) -> int:
    skip = below(state, ties)
    for u in range(best, q.shape[1]):
        if q[x, u] == q[x, best]:
            if skip == 0:
                return u
            skip -= 1
    return best
