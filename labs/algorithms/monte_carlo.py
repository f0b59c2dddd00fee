"""Monte Carlo policy evaluation (notes, 3.5.1): a state's value is the mean of what followed it.

    J_t = l_t + gamma J_(t+1),  J_T = 0              the cost-to-go, once the episode has ended
    V(x_t) <- V(x_t) + alpha_n (J_t - V(x_t))        n = N(x_t), the visits of x_t so far

alpha_n = 1/n (alpha = omega = 1 of the update rule) is the mean C(x) / N(x) of all costs-to-go;
a constant alpha forgets old episodes. First visit: a state learns from its first visit of an
episode only, and its samples are independent: unbiased. Every visit: from all its visits, which
are not independent: biased after few episodes, consistent all the same. An episode that was cut
has no cost-to-go, and nothing is learned from it.

Each update takes one episode (labs/problems/prediction.py) of T steps and changes V (X,) and
visits (X,) in place. Offline, each step of an episode sees the values from before it; otherwise,
those that the earlier steps left."""

import numpy as np

from labs.compiled import compiled, inlined
from labs.problems.episodes import UpdateRule, step_size
from labs.problems.prediction import Episode


@compiled
def costs_to_go(gamma: float, episode: Episode, T: int, rest: float, begin: int = 0) -> None:
    """Writes J_t from t = begin on into the episode's returns; `rest` is the value of its last
    state."""
    J = rest
    for t in range(T - 1, begin - 1, -1):
        J = episode.costs[t] + gamma * J
        episode.returns[t] = J


@compiled
def every_visit(
    gamma: float,
    episode: Episode,
    T: int,
    ended: bool,
    rule: UpdateRule,
    V: np.ndarray,
    N: np.ndarray,
) -> None:
    """Every-visit Monte Carlo."""
    if ended:
        costs_to_go(gamma, episode, T, 0.0)
        update_to_returns(episode, T, rule, V, N)


@compiled
def first_visit(
    gamma: float,
    episode: Episode,
    T: int,
    ended: bool,
    rule: UpdateRule,
    V: np.ndarray,
    N: np.ndarray,
) -> None:
    """First-visit Monte Carlo."""
    if not ended:
        return
    costs_to_go(gamma, episode, T, 0.0)
    seen = np.zeros(len(V), np.bool_)
    for t in range(T):
        x = episode.states[t]
        if not seen[x]:
            seen[x] = True
            update_value(rule, V, N, V, x, episode.returns[t])


@compiled
def update_to_returns(
    episode: Episode, T: int, rule: UpdateRule, V: np.ndarray, N: np.ndarray
) -> None:
    """Moves the value of each state of an episode towards its return."""
    learned = V.copy() if rule.offline else V
    for t in range(T):
        update_value(rule, V, N, learned, episode.states[t], episode.returns[t])
    if rule.offline:
        V[:] = learned


@inlined
def update_value(
    rule: UpdateRule, V: np.ndarray, N: np.ndarray, learned: np.ndarray, x: int, target: float
) -> None:
    """The next update of V(x), into `learned`: V itself, or a copy while V stands still."""
    N[x] += 1
    learned[x] += step_size(rule, N[x]) * (target - V[x])
