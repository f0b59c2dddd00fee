"""Model-free control by temporal differences (notes, 3.6): several learners, each on its own.

`init` knows nothing, `step` learns from some more episodes; both return new learners and leave
the old ones alone, so that any of them can be looked at again or gone on from, bit for bit. The
methods are in `q_learning`, `sarsa` and `sarsa_lambda`; what they choose from is in `exploration`.
The greedy policy of what was learned is u = argmin_u Q(x, u), the first among equals."""

from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms.exploration import FIXED_POLICY, BehaviourPolicy
from labs.algorithms.q_learning import q_learning
from labs.algorithms.sarsa import sarsa, sarsa_n
from labs.algorithms.sarsa_lambda import sarsa_lambda
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.episodes import (
    EpisodicTask,
    Learner,
    UpdateRule,
    initial_state,
    transition,
)
from labs.random_numbers import random_states

Q_LEARNING, SARSA, SARSA_N, SARSA_LAMBDA = range(4)
_ALGORITHMS = (q_learning, sarsa, sarsa_n, sarsa_lambda)


@dataclass(frozen=True, eq=False)
class Learners:
    """S learners of one task, who differ only in their luck."""

    q: np.ndarray
    """(S, X, U) what they expect to pay."""
    visits: np.ndarray
    """(S, X, U) int32: how often each control was tried in each state."""
    random: np.ndarray
    """(S, 4) uint64: the states of their random generators."""
    costs: np.ndarray
    """(S, k) discounted cost of each episode of the last step."""
    lengths: np.ndarray
    """(S, k) int64: its number of transitions."""
    bounded: bool = True
    """False once an estimate has left all bounds; `step` then has no effect."""


def init(shape: tuple[int, int], seeds: int, rng: np.random.Generator, q0: float = 0.0) -> Learners:
    """Learners of an MDP of `shape` (X, U) who expect to pay q0 for everything."""
    return Learners(
        q=np.full((seeds, *shape), q0),
        visits=np.zeros((seeds, *shape), np.int32),
        random=random_states(rng, seeds),
        costs=np.zeros((seeds, 0)),
        lengths=np.zeros((seeds, 0), np.int64),
    )


def step(
    task: EpisodicTask,
    behaviour: BehaviourPolicy,
    rule: UpdateRule,
    method: int,
    learners: Learners,
    episodes: int,
) -> Learners:
    """The learners after so many further episodes. Raises LabError where the pieces do not fit."""
    _check(task, behaviour, rule, learners)
    if not learners.bounded:
        return learners
    q, visits, random = learners.q.copy(), learners.visits.copy(), learners.random.copy()
    costs = np.zeros((len(q), episodes))
    lengths = np.zeros((len(q), episodes), np.int64)
    learn = _ALGORITHMS[method]
    sound = all(
        learn(task, behaviour, rule, Learner(*tables))
        for tables in zip(q, visits, random, costs, lengths, strict=True)
    )
    return replace(
        learners, q=q, visits=visits, random=random, costs=costs, lengths=lengths, bounded=sound
    )


@compiled
def episode_cost(task: EpisodicTask, policy: np.ndarray, random: np.ndarray) -> float:
    """Discounted cost of an episode under `policy` (X,) int64. `random` changes in place."""
    x, steps, total, discount = initial_state(task, random), 0, 0.0, 1.0
    while steps < task.horizon and not task.terminal[x]:
        u = policy[x]
        total += discount * task.cost[x, u]
        discount *= task.gamma
        steps += 1
        x = transition(task, x, u, random)
    return total


def greedy_costs(task: EpisodicTask, learners: Learners, trials: int = 1) -> np.ndarray:
    """(S,) what an episode under each learner's greedy policy costs, the mean of some trials. The
    luck they meet is that of the learner's next episodes, which is not used up."""
    costs = np.zeros(len(learners.q))
    for s, (q, random) in enumerate(zip(learners.q, learners.random.copy(), strict=True)):
        costs[s] = np.mean([episode_cost(task, q.argmin(axis=1), random) for _ in range(trials)])
    return costs


def _check(
    task: EpisodicTask, behaviour: BehaviourPolicy, rule: UpdateRule, learners: Learners
) -> None:
    states, controls = task.cost.shape
    if learners.q.shape[1:] != (states, controls):
        raise LabError(
            f"the learners' Q has {learners.q.shape[1:]} states and controls, the task "
            f"{(states, controls)}: they must agree"
        )
    if not len(task.starts) or not (task.starts < states).all():
        raise LabError(f"starts = {task.starts}: takes at least one state below {states}")
    if len(behaviour.policy) != (states if behaviour.kind == FIXED_POLICY else 0):
        raise LabError(
            f"a policy of {len(behaviour.policy)} controls: one for each of {states} states goes"
        )
    for name, value in (
        ("alpha", rule.alpha),
        ("omega", rule.omega),
        ("lambda", rule.trace_decay),
        ("epsilon", behaviour.epsilon),
        ("the decay of exploration", behaviour.decay),
    ):
        if not 0.0 <= value <= 1.0:
            raise LabError(f"{name} = {value}: takes a number from 0 to 1")
    if rule.n < 1 or task.horizon < 1:
        raise LabError(f"n = {rule.n}, horizon = {task.horizon}: both are whole and at least 1")
