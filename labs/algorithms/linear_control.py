"""Model-free control with linear features (notes, 3.8): q(x, u, w) = phi(x)' w_u, u discrete.

    MC control    target  J_t = l_t + gamma l_(t+1) + ...                 once the episode has ended
    SARSA                 l + gamma q(x', u', w)                          u' is applied next
    Q-learning            l + gamma min_u' q(x', u', w)

    w_u <- w_u + alpha_n (target - q(x, u, w)) phi(x)

with q = 0 in terminal states by their features. Controls are chosen by a behaviour policy of
`exploration`; MC control keeps its weights through an episode. With one feature a state these are
the tabular methods. With fewer, MC control and SARSA chatter about the optimum, and Q-learning may
diverge (3.8.1).

`init` knows nothing, `step` learns from some more episodes; both leave the old learners alone."""

from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms.exploration import FIXED_POLICY, BehaviourPolicy, choose
from labs.algorithms.features import Features, add_features, evaluate, state_values
from labs.algorithms.monte_carlo import costs_to_go
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.episodes import (
    EpisodicTask,
    Learner,
    UpdateRule,
    initial_state,
    min_q,
    record_step,
    step_size,
    transition,
)
from labs.problems.prediction import empty_episode
from labs.random_numbers import random_states

MC_CONTROL, SARSA, Q_LEARNING = range(3)


@dataclass(frozen=True, eq=False)
class LinearControllers:
    """S learners of one task, who differ only in their luck."""

    w: np.ndarray
    """(S, U, d) weights."""
    visits: np.ndarray
    """(S, X, U) int32: how often each control was tried in each state."""
    random: np.ndarray
    """(S, 4) uint64: the states of their random generators."""
    costs: np.ndarray
    """(S, k) discounted cost of each episode of the last step."""
    lengths: np.ndarray
    """(S, k) int64: its number of transitions."""
    bounded: np.ndarray
    """(S,) bool: False once an update has left the rule's limit; the learner then stands still."""


def init(
    task: EpisodicTask, features: Features, seeds: int, rng: np.random.Generator
) -> LinearControllers:
    """Learners whose weights are 0. Raises LabError where features do not fit the task."""
    states, controls = task.cost.shape
    if len(features.active) != states:
        raise LabError(f"{len(features.active)} states have features and {states} are in the task")
    if features.value[task.terminal].any():
        raise LabError("in terminal states all features are 0, as is the value")
    return LinearControllers(
        w=np.zeros((seeds, controls, features.size)),
        visits=np.zeros((seeds, states, controls), np.int32),
        random=random_states(rng, seeds),
        costs=np.zeros((seeds, 0)),
        lengths=np.zeros((seeds, 0), np.int64),
        bounded=np.ones(seeds, bool),
    )


def step(
    task: EpisodicTask,
    features: Features,
    behaviour: BehaviourPolicy,
    rule: UpdateRule,
    method: int,
    learners: LinearControllers,
    episodes: int,
) -> LinearControllers:
    """The learners after so many further episodes. Raises LabError where the pieces do not fit."""
    states, controls = task.cost.shape
    if learners.w.shape[1:] != (controls, features.size):
        raise LabError(f"weights {learners.w.shape[1:]}, not {(controls, features.size)}")
    if len(behaviour.policy) != (states if behaviour.kind == FIXED_POLICY else 0):
        raise LabError(f"a policy of {len(behaviour.policy)} controls for {states} states")
    if method not in range(3):
        raise LabError(f"there is no method {method}: they are numbered from 0 to 2")
    w, visits, random = learners.w.copy(), learners.visits.copy(), learners.random.copy()
    costs = np.zeros((len(w), episodes))
    lengths = np.zeros((len(w), episodes), np.int64)
    sound = learners.bounded.copy()
    _learn(task, features, behaviour, rule, method, w, visits, random, costs, lengths, sound)
    return replace(
        learners, w=w, visits=visits, random=random, costs=costs, lengths=lengths, bounded=sound
    )


def q_table(features: Features, w: np.ndarray) -> np.ndarray:
    """(X, U) q of weights (U, d)."""
    return state_values(features, w).T


@compiled
def _learn(
    task: EpisodicTask,
    features: Features,
    behaviour: BehaviourPolicy,
    rule: UpdateRule,
    method: int,
    w: np.ndarray,
    visits: np.ndarray,
    random: np.ndarray,
    costs: np.ndarray,
    lengths: np.ndarray,
    sound: np.ndarray,
) -> None:
    q = np.zeros(task.cost.shape)
    for s in range(len(w)):
        if sound[s]:
            learner = Learner(q, visits[s], random[s], costs[s], lengths[s])
            if method == MC_CONTROL:
                sound[s] = _monte_carlo(task, features, behaviour, rule, learner, w[s])
            elif method == SARSA:
                sound[s] = _sarsa(task, features, behaviour, rule, learner, w[s])
            else:
                sound[s] = _q_learning(task, features, behaviour, rule, learner, w[s])


@compiled
def _q_learning(
    task: EpisodicTask,
    features: Features,
    behaviour: BehaviourPolicy,
    rule: UpdateRule,
    learner: Learner,
    w: np.ndarray,
) -> bool:
    """False where it diverged."""
    for k in range(len(learner.costs)):
        x, discount = initial_state(task, learner.random), 1.0
        while learner.lengths[k] < task.horizon and not task.terminal[x]:
            _write_q_row(features, w, learner.q, x)
            u = choose(behaviour, x, learner.q, learner.visits, learner.random)
            y = transition(task, x, u, learner.random)
            _write_q_row(features, w, learner.q, y)
            target = task.cost[x, u]
            if not task.terminal[y]:
                target += task.gamma * min_q(learner.q, y)
            discount = record_step(task, learner, k, x, u, discount)
            if not _update_weights(features, rule, learner, w, x, u, target):
                return False
            x = y
    return True


@compiled
def _sarsa(
    task: EpisodicTask,
    features: Features,
    behaviour: BehaviourPolicy,
    rule: UpdateRule,
    learner: Learner,
    w: np.ndarray,
) -> bool:
    """False where it diverged."""
    for k in range(len(learner.costs)):
        x, discount = initial_state(task, learner.random), 1.0
        _write_q_row(features, w, learner.q, x)
        u = choose(behaviour, x, learner.q, learner.visits, learner.random)
        while learner.lengths[k] < task.horizon and not task.terminal[x]:
            y, next_u = transition(task, x, u, learner.random), 0
            target = task.cost[x, u]
            if not task.terminal[y]:
                _write_q_row(features, w, learner.q, y)
                next_u = choose(behaviour, y, learner.q, learner.visits, learner.random)
                target += task.gamma * learner.q[y, next_u]
            discount = record_step(task, learner, k, x, u, discount)
            if not _update_weights(features, rule, learner, w, x, u, target):
                return False
            x, u = y, next_u
    return True


@compiled
def _monte_carlo(
    task: EpisodicTask,
    features: Features,
    behaviour: BehaviourPolicy,
    rule: UpdateRule,
    learner: Learner,
    w: np.ndarray,
) -> bool:
    """Every-visit Monte Carlo control. False where it diverged."""
    episode = empty_episode(task.horizon)
    states, controls = episode.states, episode.controls
    for k in range(len(learner.costs)):
        x, discount, T = initial_state(task, learner.random), 1.0, 0
        while learner.lengths[k] < task.horizon and not task.terminal[x]:
            _write_q_row(features, w, learner.q, x)
            u = choose(behaviour, x, learner.q, learner.visits, learner.random)
            states[T], controls[T], episode.costs[T], T = x, u, task.cost[x, u], T + 1
            discount = record_step(task, learner, k, x, u, discount)
            x = transition(task, x, u, learner.random)
        # What a cut episode would still have cost nobody knows: it counts as far as it went.
        costs_to_go(task.gamma, episode, T, 0.0)
        for t in range(T):
            if not _update_weights(
                features, rule, learner, w, states[t], controls[t], episode.returns[t]
            ):
                return False
    return True


@compiled
def _write_q_row(features: Features, w: np.ndarray, q: np.ndarray, x: int) -> None:
    """Writes q(x, .) where behaviour policies look."""
    for u in range(len(w)):
        q[x, u] = evaluate(features, w[u], x)


@compiled
def _update_weights(
    features: Features,
    rule: UpdateRule,
    learner: Learner,
    w: np.ndarray,
    x: int,
    u: int,
    target: float,
) -> bool:
    learner.visits[x, u] += 1
    delta = target - evaluate(features, w[u], x)
    add_features(features, w[u], x, step_size(rule, learner.visits[x, u]) * delta)
    return bool(abs(delta) <= rule.limit)
