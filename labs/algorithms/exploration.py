"""Behaviour policies: which control to try, given what was learned so far (notes, 3.6.4, 3.6.5).

With costs Q (X, U), visits N (X, U) and n(x) = 1 + sum_u N(x, u), the visit that is now:

    epsilon-greedy   u = argmin_u Q(x, u), but with probability eps_n any control
    Boltzmann        P(u) proportional to exp(-beta_n Q(x, u))
    confidence       u = argmin_u Q(x, u) - L sqrt(2 log n / N(x, u)), untried controls first
    follow           u = mu(x), but with probability eps_n any control: somebody else drives
    Thompson         u = argmin_u of one draw each from N(Q(x, u), L^2 / N(x, u)), untried first

The last one is beyond the notes (Thompson 1933): u is chosen as often as it is the best, as far as
one knows who has seen N costs of mean Q and standard deviation L and expected nothing before.

Greedy in the limit with infinite exploration (GLIE) for decay 0 < d <= 1:

    eps_n = eps / n^d          (d = 0: constant; the notes' 1/k is d = 1)
    beta_n = beta (1 + log n)  where d > 0

Both are counted by visits of the state, so that a state seen for the first time is explored,
however late that is. Ties are broken at random."""

from typing import NamedTuple

import numpy as np

from labs.compiled import compiled, inlined
from labs.random_numbers import normal, random_integer, uniform

EPSILON_GREEDY, BOLTZMANN, CONFIDENCE_BOUND, FIXED_POLICY, THOMPSON = range(5)


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
    """L [cost]: of confidence, the largest cost; of Thompson's, its standard deviation."""
    policy: np.ndarray = np.zeros(0, np.int64)
    """(X,) int64: mu, for FIXED_POLICY; empty otherwise."""


@inlined
def choose(
    behaviour: BehaviourPolicy, x: int, q: np.ndarray, visits: np.ndarray, random: np.ndarray
) -> int:
    """The control to try in state x, from Q and N, both (X, U)."""
    if behaviour.kind != EPSILON_GREEDY or behaviour.decay > 0.0:
        return _choose_general(behaviour, x, q, visits, random)
    if uniform(random) < behaviour.epsilon:
        return random_integer(random, q.shape[1])
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
def boltzmann(q: np.ndarray, x: int, beta: float, random: np.ndarray) -> int:
    """A control with probability proportional to exp(-beta Q(x, u)). Costs count from the least
    one, so that nothing overflows."""
    controls, least, best = q.shape[1], q[x, 0], 0
    for u in range(1, controls):
        if q[x, u] < least:
            least, best = q[x, u], u
    weights, total = np.empty(controls), 0.0
    for u in range(controls):
        weights[u] = np.exp(-beta * (q[x, u] - least))
        total += weights[u]
    left = uniform(random) * total
    for u in range(controls):
        left -= weights[u]
        if left < 0.0:
            return u
    return best


@compiled
def lower_confidence_bound(
    q: np.ndarray, x: int, visits: np.ndarray, bound: float, random: np.ndarray
) -> int:
    """The control of the lowest confidence bound; an untried one comes before all others."""
    width = bound * np.sqrt(2.0 * np.log(1.0 + _visit_count(visits, x)))
    least, best, ties = np.inf, 0, 0
    for u in range(q.shape[1]):
        score = _lower_bound(q[x, u], visits[x, u], width)
        if score < least:
            least, best, ties = score, u, 1
        elif score == least:
            ties += 1
    if ties == 1:
        return best
    scores = np.empty((1, q.shape[1]))
    for u in range(q.shape[1]):
        scores[0, u] = _lower_bound(q[x, u], visits[x, u], width)
    return greedy(scores, 0, random)


@compiled
def thompson(
    q: np.ndarray, x: int, visits: np.ndarray, deviation: float, random: np.ndarray
) -> int:
    """The control whose mean cost, drawn from what is believed of it, is the least; an untried one
    comes before all others."""
    scores = np.empty((1, q.shape[1]))
    for u in range(q.shape[1]):
        scores[0, u] = _lower_bound(q[x, u], visits[x, u], deviation * normal(random))
    return greedy(scores, 0, random)


@inlined
def _lower_bound(cost: float, n: int, width: float) -> float:
    return float(cost - width / np.sqrt(n)) if n > 0 else -np.inf


@inlined
def _visit_count(visits: np.ndarray, x: int) -> int:
    tries = 0
    for u in range(visits.shape[1]):
        tries += visits[x, u]
    return tries


@compiled
def _choose_general(
    behaviour: BehaviourPolicy, x: int, q: np.ndarray, visits: np.ndarray, random: np.ndarray
) -> int:
    """Whatever is not epsilon-greedy with a constant epsilon."""
    if behaviour.kind == CONFIDENCE_BOUND:
        return lower_confidence_bound(q, x, visits, behaviour.bound, random)
    if behaviour.kind == THOMPSON:
        return thompson(q, x, visits, behaviour.bound, random)
    n = 1.0 + _visit_count(visits, x) if behaviour.decay > 0.0 else 1.0
    if behaviour.kind == BOLTZMANN:
        cooling = 1.0 + np.log(n) if behaviour.decay > 0.0 else 1.0
        return boltzmann(q, x, behaviour.beta * cooling, random)
    fading = 1.0 / n if behaviour.decay == 1.0 else n**-behaviour.decay
    if uniform(random) < behaviour.epsilon * fading:
        return random_integer(random, q.shape[1])
    return int(behaviour.policy[x]) if behaviour.kind == FIXED_POLICY else greedy(q, x, random)


@compiled
def _break_tie(q: np.ndarray, x: int, best: int, ties: int, random: np.ndarray) -> int:
    skip = random_integer(random, ties)
    for u in range(best, q.shape[1]):
        if q[x, u] == q[x, best]:
            if skip == 0:
                return u
            skip -= 1
    return best
