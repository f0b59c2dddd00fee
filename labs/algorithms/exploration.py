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

from labs.compiled import compiled, inlined
from labs.random_numbers import below, uniform

EPSILON_GREEDY, BOLTZMANN, CONFIDENCE, FOLLOW = range(4)


class BehaviourPolicy(NamedTuple):
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


@inlined
def choose(
    behaviour: BehaviourPolicy, x: int, q: np.ndarray, visits: np.ndarray, random: np.ndarray
) -> int:
    """The control to try in state x, from Q and N, both (X, U)."""
    if behaviour.kind != EPSILON_GREEDY or behaviour.decay > 0.0:
        return _choose_otherwise(behaviour, x, q, visits, random)
    if uniform(random) < behaviour.epsilon:
        return below(random, q.shape[1])
    return greedy(q, x, random)


@compiled
def greedy(q: np.ndarray, x: int, random: np.ndarray) -> int:
    """The control of least Q(x, u); among equals, any."""
    least, best, ties = q[x, 0], 0, 1
    for u in range(1, q.shape[1]):
        cost = q[x, u]
        if cost < least:
            least, best, ties = cost, u, 1
        elif cost == least:
            ties += 1
    return best if ties == 1 else _break_tie(q, x, best, ties, random)


@compiled
def boltzmann(costs: np.ndarray, beta: float, random: np.ndarray) -> int:
    """A control with probability proportional to exp(-beta cost). Costs (U,) count from the least
    one, so that nothing overflows."""
    least, total = costs.min(), 0.0
    for cost in costs:
        total += np.exp(-beta * (cost - least))
    left = uniform(random) * total
    for u in range(len(costs)):
        left -= np.exp(-beta * (costs[u] - least))
        if left < 0.0:
            return u
    return int(np.argmin(costs))


@compiled
def confidence(costs: np.ndarray, visits: np.ndarray, bound: float, random: np.ndarray) -> int:
    """The control of the lowest confidence bound; an untried one comes before all others. Costs
    and visits are (U,)."""
    scores = np.empty((1, len(costs)))
    logarithm = 2.0 * np.log(1.0 + visits.sum())
    for u in range(len(costs)):
        if visits[u] == 0:
            scores[0, u] = -np.inf
        else:
            scores[0, u] = costs[u] - bound * np.sqrt(logarithm / visits[u])
    return greedy(scores, 0, random)


@compiled
def _choose_otherwise(
    behaviour: BehaviourPolicy, x: int, q: np.ndarray, visits: np.ndarray, random: np.ndarray
) -> int:
    """Whatever is not epsilon-greedy with a constant epsilon."""
    if behaviour.kind == CONFIDENCE:
        return confidence(q[x], visits[x], behaviour.bound, random)
    n = 1.0 + visits[x].sum() if behaviour.decay > 0.0 else 1.0
    if behaviour.kind == BOLTZMANN:
        return boltzmann(q[x], behaviour.beta * (1.0 + np.log(n)), random)
    if uniform(random) < behaviour.epsilon * n**-behaviour.decay:
        return below(random, q.shape[1])
    return int(behaviour.policy[x]) if behaviour.kind == FOLLOW else greedy(q, x, random)


@compiled
def _break_tie(q: np.ndarray, x: int, best: int, ties: int, random: np.ndarray) -> int:
    skip = below(random, ties)
    for u in range(best, q.shape[1]):
        if q[x, u] == q[x, best]:
            if skip == 0:
                return u
            skip -= 1
    return best
