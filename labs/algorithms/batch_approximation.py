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
import scipy.sparse
import scipy.sparse.linalg

from labs.algorithms.approximation import minimum_norm_solution
from labs.algorithms.features import Features, add_features, evaluate, state_values
from labs.algorithms.monte_carlo import costs_to_go
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.episodes import UpdateRule, step_size
from labs.problems.prediction import PredictionTask, empty_episode, sample_episode
from labs.random_numbers import random_integer
from labs.resumable import Resumable, split_work

REPLAY_MC, REPLAY_TD = range(2)


class TransitionBatch(NamedTuple):
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


def collect_transitions(task: PredictionTask, random: np.ndarray, episodes: int) -> TransitionBatch:
    """What happens in so many episodes. `random` (4,) uint64 changes in place."""
    (x, u, y), (cost, returns) = _collect(task, random, episodes)
    return TransitionBatch(x, u, cost, y, returns)


@compiled
def _collect(
    task: PredictionTask, random: np.ndarray, episodes: int
) -> tuple[np.ndarray, np.ndarray]:
    """x, u, y (3, N) and cost, returns (2, N)."""
    room, met = empty_episode(task.task.horizon), 0
    indices, numbers = np.empty((3, 0), np.int64), np.empty((2, 0))
    for _ in range(episodes):
        T = sample_episode(task, random, room)
        costs_to_go(task.task.gamma, room, T, 0.0)
        if met + T > indices.shape[1]:
            wide = 2 * (met + T)
            more, further = np.empty((3, wide), np.int64), np.empty((2, wide))
            more[:, :met], further[:, :met] = indices[:, :met], numbers[:, :met]
            indices, numbers = more, further
        for t in range(T):
            indices[0, met + t], indices[1, met + t] = room.states[t], room.controls[t]
            indices[2, met + t] = room.states[t + 1]
            numbers[0, met + t], numbers[1, met + t] = room.costs[t], room.returns[t]
        met += T
    return indices[:, :met].copy(), numbers[:, :met].copy()


def least_squares_fit(features: Features, batch: TransitionBatch) -> np.ndarray:
    """w (d,) of the least squares fit, the shortest where there are several."""
    return _fit(features, batch.x, batch.returns)


def _fit(features: Features, x: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """The same to targets (N,) in the states x (N,). All visits of a state ask for their mean."""
    visits = np.bincount(x, minlength=len(features.active))
    sums = np.bincount(x, targets, minlength=len(visits))
    if _one_feature_per_state(features):
        i, phi = features.active[:, 0], features.value[:, 0]
        squares = np.bincount(i, visits * phi**2, minlength=features.size)
        products = np.bincount(i, sums * phi, minlength=features.size)
        return np.divide(products, squares, out=np.zeros(features.size), where=squares > 0.0)
    seen = np.flatnonzero(visits)
    root = np.sqrt(visits[seen])
    return minimum_norm_solution(features.dense[seen] * root[:, None], sums[seen] / root)


def _one_feature_per_state(features: Features) -> bool:
    """Whether no state has more than one: a table, or groups of states."""
    return bool(features.active.shape[1] == 1)


def lstd(features: Features, batch: TransitionBatch, gamma: float) -> np.ndarray:
    """w (d,) of LSTD, the shortest of least residual where there are several or none."""
    states, few = len(features.active), 4 * features.active.shape[1] < features.size
    phi = features.sparse if few else features.dense
    met = (np.ones(len(batch.x)), (batch.x, batch.y))
    counts = scipy.sparse.csr_array(met, shape=(states, states))
    cost = np.bincount(batch.x, batch.cost, minlength=states)
    A = phi.T @ (scipy.sparse.diags_array(counts.sum(axis=1)) @ phi - gamma * (counts @ phi))
    b = phi.T @ cost
    found = _solve_m_matrix(A.tocsc(), b) if few and _one_feature_per_state(features) else None
    return minimum_norm_solution(A.toarray() if few else A, b) if found is None else found


def _solve_m_matrix(A: scipy.sparse.csc_array, b: np.ndarray) -> np.ndarray | None:
    """w (d,) with A w = b, for the sparse A of groups of states: off its diagonal nothing is above
    0, its rows sum to 0 or more, so that A^-1 >= 0 and |A^-1| = max A^-1 1. 0 for groups never met;
    None where A is singular otherwise, or nearly."""
    met, w = np.flatnonzero(A.diagonal()), np.zeros(len(b))
    own = A[met][:, met]
    if not len(met) or abs(A).sum() > abs(own).sum():
        return None
    try:
        # States along a line stay in their order: A is a band.
        factors = scipy.sparse.linalg.splu(own.tocsc(), permc_spec="NATURAL")
    except RuntimeError:
        return None
    condition = abs(own).sum(axis=1).max() * np.abs(factors.solve(np.ones(len(met)))).max()
    if not condition * len(met) * np.finfo(float).eps < 1.0:
        return None
    w[met] = factors.solve(b[met])
    return w


def fitted_q_iteration(
    features: Features, batch: TransitionBatch, gamma: float, w: np.ndarray
) -> Resumable[np.ndarray]:
    """The next w (U, d): for each control a fit to the targets of its own transitions. A control
    that was never tried keeps its weights."""
    fitted = w.copy()
    targets = batch.cost + gamma * state_values(features, w).min(axis=0)[batch.y]
    for u in range(len(w)):
        tried = batch.u == u
        if tried.any():
            fitted[u] = _fit(features, batch.x[tried], targets[tried])
        yield
    return fitted


def replay(
    features: Features,
    batch: TransitionBatch,
    gamma: float,
    rule: UpdateRule,
    method: int,
    w: np.ndarray,
    random: np.ndarray,
    draws: int,
    drawn: int = 0,
) -> Resumable[np.ndarray]:
    """w (d,) after so many further updates of prediction, `drawn` of which were made before.
    `random` (4,) uint64 changes in place. Raises LabError for an empty batch."""
    # v is q of a single control.
    alone, bootstrap = batch._replace(u=np.zeros_like(batch.u)), method == REPLAY_TD
    after = yield from _resumable_replay(
        features, alone, gamma, rule, bootstrap, w[None], random, draws, drawn
    )
    return np.asarray(after[0])


def replay_q_learning(
    features: Features,
    batch: TransitionBatch,
    gamma: float,
    rule: UpdateRule,
    w: np.ndarray,
    random: np.ndarray,
    draws: int,
    drawn: int = 0,
) -> Resumable[np.ndarray]:
    """w (U, d) after so many further updates of Q-learning, as `replay`. It stops short of the
    update after the one whose error leaves the rule's limit."""
    return (
        yield from _resumable_replay(features, batch, gamma, rule, True, w, random, draws, drawn)
    )


def _resumable_replay(
    features: Features,
    batch: TransitionBatch,
    gamma: float,
    rule: UpdateRule,
    bootstrap: bool,
    w: np.ndarray,
    random: np.ndarray,
    draws: int,
    drawn: int,
) -> Resumable[np.ndarray]:
    if not len(batch.x):
        raise LabError("an empty batch teaches nothing: collect some episodes first")
    learned, work = np.array(w, float), (len(w) + 2) * (features.active.shape[1] + 10)
    for some in split_work(draws, work):
        if not _replay_updates(
            features, batch, gamma, rule, bootstrap, learned, random, some, drawn
        ):
            break
        drawn += some
        yield
    return learned


@compiled
def _replay_updates(
    features: Features,
    batch: TransitionBatch,
    gamma: float,
    rule: UpdateRule,
    bootstrap: bool,
    w: np.ndarray,
    random: np.ndarray,
    draws: int,
    drawn: int,
) -> bool:
    """False where an error left the rule's limit."""
    for n in range(drawn + 1, drawn + draws + 1):
        i = random_integer(random, len(batch.x))
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
            return False
    return True
