"""Learning from a fixed batch of transitions with linear features (notes, 3.8.2).

    least squares        min over w of the sum over t of (J_t - phi_t' w)^2
    LSTD                 sum over t of phi_t (phi_t - gamma phi'_t)' w = sum over t of phi_t l_t
    fitted Q-iteration   w_(k+1) = least squares fit of l_t + gamma min_u q(x'_t, u, w_k)

LSTD's answer is the TD fixed point of the batch, as certainty equivalence is for a table.
Experience replay comes to the same answers by steps from samples drawn evenly out of the buffer,
each of them used again and again:

    w <- w + alpha_n (target - v(x, w)) phi(x)
    target    J    or    l + gamma v(x', w)    or, of q,    l + gamma min_u q(x', u, w)

The first goes down a gradient and comes to least squares; the second to LSTD where its mean step
converges (`approximation`); the third, Q-learning, may diverge."""

from typing import NamedTuple

import numpy as np

from labs.algorithms.approximation import shortest_solution
from labs.algorithms.features import Features, add_features, evaluate
from labs.algorithms.monte_carlo import costs_to_go
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.episodes import UpdateRule, step_size
from labs.problems.prediction import PredictionTask, empty_episode, sample_episode
from labs.random_numbers import below

REPLAY_MC, REPLAY_TD = range(2)


class Transitions(NamedTuple):
    """A replay buffer of N transitions."""

    x: np.ndarray
    """(N,) int64."""
    u: np.ndarray
    """(N,) int64."""
    cost: np.ndarray
    """(N,)."""
    y: np.ndarray
    """(N,) int64: the next state; its features are 0 if it is terminal."""
    returns: np.ndarray
    """(N,) J_t; of an episode that was cut, as far as it went."""


def collect_transitions(task: PredictionTask, random: np.ndarray, episodes: int) -> Transitions:
    """What happens in so many episodes. `random` (4,) uint64 changes in place."""
    room, parts = empty_episode(task.task.horizon), []
    for _ in range(episodes):
        T = sample_episode(task, random, room)
        costs_to_go(task.task.gamma, room, T, 0.0)
        states = room.states[: T + 1].copy()
        arrays = (room.controls, room.costs, room.returns)
        controls, costs, returns = (array[:T].copy() for array in arrays)
        parts.append((states[:-1], controls, costs, states[1:], returns))
    return Transitions(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def least_squares_fit(features: Features, batch: Transitions) -> np.ndarray:
    """w (d,) of the least squares fit, the shortest where there are several. All visits of a state
    ask for the mean of their J."""
    visits = np.bincount(batch.x, minlength=len(features.active))
    seen = np.flatnonzero(visits)
    root = np.sqrt(visits[seen])
    sums = np.bincount(batch.x, batch.returns, minlength=len(visits))[seen]
    return shortest_solution(features.dense[seen] * root[:, None], sums / root)


def lstd(features: Features, batch: Transitions, gamma: float) -> np.ndarray:
    """w (d,) of LSTD, the shortest of least residual where there are several or none."""
    phi, states = features.dense, len(features.active)
    counts = np.zeros((states, states))
    np.add.at(counts, (batch.x, batch.y), 1.0)
    cost = np.bincount(batch.x, batch.cost, minlength=states)
    A = phi.T @ (counts.sum(axis=1)[:, None] * phi - gamma * counts @ phi)
    return shortest_solution(A, phi.T @ cost)


def fitted_q_iteration(
    features: Features, batch: Transitions, gamma: float, w: np.ndarray
) -> np.ndarray:
    """The next w (U, d): for each control a fit to the targets of its own transitions. A control
    that was never tried keeps its weights."""
    phi, fitted = features.dense, w.copy()
    targets = batch.cost + gamma * (phi[batch.y] @ w.T).min(axis=1)
    for u in range(len(w)):
        tried = batch.u == u
        if tried.any():
            fitted[u] = shortest_solution(phi[batch.x[tried]], targets[tried])
    return fitted


def replay(
    features: Features,
    batch: Transitions,
    gamma: float,
    rule: UpdateRule,
    method: int,
    w: np.ndarray,
    random: np.ndarray,
    draws: int,
    drawn: int = 0,
) -> np.ndarray:
    """w (d,) after so many further updates of prediction, `drawn` of which were made before.
    `random` (4,) uint64 changes in place. Raises LabError for an empty batch."""
    # v is q of a single control.
    alone, bootstrap = batch._replace(u=np.zeros_like(batch.u)), method == REPLAY_TD
    after = _replayed(features, alone, gamma, rule, bootstrap, w[None], random, draws, drawn)
    return np.asarray(after[0])


def replay_q_learning(
    features: Features,
    batch: Transitions,
    gamma: float,
    rule: UpdateRule,
    w: np.ndarray,
    random: np.ndarray,
    draws: int,
    drawn: int = 0,
) -> np.ndarray:
    """w (U, d) after so many further updates of Q-learning, as `replay`. It stops short of the
    update after the one whose error leaves the rule's limit."""
    return _replayed(features, batch, gamma, rule, True, w, random, draws, drawn)


def _replayed(
    features: Features,
    batch: Transitions,
    gamma: float,
    rule: UpdateRule,
    bootstrap: bool,
    w: np.ndarray,
    random: np.ndarray,
    draws: int,
    drawn: int,
) -> np.ndarray:
    if not len(batch.x):
        raise LabError("an empty batch teaches nothing: collect some episodes first")
    learned = np.array(w, float)
    _replay(features, batch, gamma, rule, bootstrap, learned, random, draws, drawn)
    return learned


@compiled
def _replay(
    features: Features,
    batch: Transitions,
    gamma: float,
    rule: UpdateRule,
    bootstrap: bool,
    w: np.ndarray,
    random: np.ndarray,
    draws: int,
    drawn: int,
) -> None:
    for n in range(drawn + 1, drawn + draws + 1):
        i = below(random, len(batch.x))
        target = batch.returns[i]
        if bootstrap:
            least = np.inf
            for u in range(len(w)):
                least = min(least, evaluate(features, w[u], batch.y[i]))
            target = batch.cost[i] + gamma * least
        mine = w[batch.u[i]]
        delta = target - evaluate(features, mine, batch.x[i])
        add_features(features, mine, batch.x[i], step_size(rule, n) * delta)
        if not abs(delta) <= rule.limit:
            return
