"""Temporal-difference prediction (notes, 3.5.2 and 3.5.5): the rest of a cost-to-go is replaced by
what is expected of it.

    TD(0)     V(x_t) <- V(x_t) + alpha_n (l_t + gamma V(x_(t+1)) - V(x_t))
    n-step    V(x_t) <- V(x_t) + alpha_n (J_t - V(x_t)),
              J_t = l_t + gamma l_(t+1) + ... + gamma^(n-1) l_(t+n-1) + gamma^n V(x_(t+n))

with V = 0 in terminal states; near the end of an episode J_t takes the costs that are left, and
where it was cut the value of the state it was cut in. n = 1 is TD(0), n >= T is every-visit Monte
Carlo. The state of n steps ago learns as soon as its costs are there; those of the last n steps,
at the end, all from values before the first of these updates.

alpha_n = alpha / N(x)^omega, N(x) the visits of x: constant, or with 1/2 < omega <= 1 by the
conditions of Robbins and Monro. Each update takes one episode and changes V and visits in place,
as in `monte_carlo`."""

import numpy as np

from labs.algorithms.monte_carlo import costs_to_go, update_value
from labs.compiled import compiled, inlined
from labs.problems.episodes import UpdateRule
from labs.problems.prediction import Episode


@inlined
def n_step_return(gamma: float, episode: Episode, t: int, n: int, rest: float) -> float:
    """J_t of n costs, and the value of where they lead."""
    J = rest
    for k in range(t + n - 1, t - 1, -1):
        J = episode.costs[k] + gamma * J
    return J


@compiled
def td0(
    gamma: float, episode: Episode, T: int, rule: UpdateRule, V: np.ndarray, N: np.ndarray
) -> None:
    """TD(0)."""
    learned = V.copy() if rule.offline else V
    for t in range(T):
        target = episode.costs[t] + gamma * V[episode.states[t + 1]]
        update_value(rule, V, N, learned, episode.states[t], target)
    if rule.offline:
        V[:] = learned


@compiled
def n_step(
    gamma: float, episode: Episode, T: int, rule: UpdateRule, V: np.ndarray, N: np.ndarray
) -> None:
    """n-step TD with n = rule.n."""
    learned = V.copy() if rule.offline else V
    states = episode.states
    first = max(T - rule.n, 0)  # The first of the steps whose return reaches the end.
    for t in range(first):
        _n_step_update(gamma, episode, t, rule, V, N, learned)
    costs_to_go(gamma, episode, T, V[states[T]], first)
    for t in range(first, T):
        update_value(rule, V, N, learned, states[t], episode.returns[t])
    if rule.offline:
        V[:] = learned


@compiled
def n_step_ongoing(
    gamma: float, episode: Episode, T: int, rule: UpdateRule, V: np.ndarray, N: np.ndarray
) -> None:
    """What online n-step TD has learned after T steps of an episode that goes on."""
    for t in range(T - rule.n + 1):
        _n_step_update(gamma, episode, t, rule, V, N, V)


@inlined
def _n_step_update(
    gamma: float,
    episode: Episode,
    t: int,
    rule: UpdateRule,
    V: np.ndarray,
    N: np.ndarray,
    learned: np.ndarray,
) -> None:
    J = n_step_return(gamma, episode, t, rule.n, V[episode.states[t + rule.n]])
    update_value(rule, V, N, learned, episode.states[t], J)
