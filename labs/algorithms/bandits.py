"""Online learning in bandits (notes, 3.6.4): one state, K controls, and every cost counts.

    l_t = mean(u_t) + deviation(u_t) z_t,    z_t standard normal
    Q(u) <- Q(u) + alpha_n (l - Q(u))        1/n: the mean of what u has cost; constant: forgets
    regret_t = sum over k <= t of (mean(u_k) - min_u mean(u))

The strategies are the behaviour policies of `exploration`, a task in the place of a state: greedy,
epsilon-greedy with a constant or falling epsilon, Boltzmann, the lowest confidence bound

    u = argmin_u Q(u) - L sqrt(2 log t / n(u)),    L = max |l| (given, or the largest one met)

and, beyond the notes, Thompson's. Where the means drift, each of them takes a normal step of
standard deviation `drift` after each cost.

Thousands of tasks are played at once. What happens to a task has random numbers of its own, apart
from those of its player: strategies of equal seeds meet the same z_t and the same drift."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from labs.algorithms.exploration import (
    CONFIDENCE_BOUND,
    FIXED_POLICY,
    BehaviourPolicy,
    choose,
    lower_confidence_bound,
)
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.episodes import UpdateRule, step_size
from labs.random_numbers import normal, random_states

SAMPLE_MEAN = UpdateRule(alpha=1.0, omega=1.0)
"""Estimates are the means of what was paid."""


class Bandits(NamedTuple):
    """M tasks of K controls each."""

    means: np.ndarray
    """(M, K) what a control costs on average, at first."""
    deviations: np.ndarray
    """(M, K) standard deviation of its cost, at least 0."""
    drift: float = 0.0
    """Standard deviation of the step of each mean after each cost."""


@dataclass(frozen=True, eq=False)
class Players:
    """One player a task, all of one strategy."""

    q: np.ndarray
    """(M, K) what they expect to pay."""
    visits: np.ndarray
    """(M, K) int32: how often they chose what."""
    means: np.ndarray
    """(M, K) the true means as they are now."""
    largest: np.ndarray
    """(M,) max |l_t| of what they paid."""
    regret: np.ndarray
    """(M,) so far."""
    turns: int
    """Choices made so far."""
    random: np.ndarray
    """(M, 4) uint64: the states of the players' random generators."""
    task_random: np.ndarray
    """(M, 4) uint64: those of their tasks."""
    costs: np.ndarray
    """(k,) mean cost of each turn of the last step, over all tasks."""
    regrets: np.ndarray
    """(k,) mean regret after each of these turns."""
    best: np.ndarray
    """(k,) share of the tasks in which the best control was chosen."""


def gaussian_testbed(tasks: int, arms: int, rng: np.random.Generator) -> Bandits:
    """Means from N(0, 1), costs of standard deviation 1: with ten arms the testbed of Sutton and
    Barto (Reinforcement Learning, 2nd edition, 2.3), its rewards as negative costs."""
    return Bandits(rng.standard_normal((tasks, arms)), np.ones((tasks, arms)))


def init(bandits: Bandits, rng: np.random.Generator, q0: float = 0.0) -> Players:
    """Players who expect to pay q0 for everything. Raises LabError where arrays do not fit."""
    means, deviations, drift = bandits
    if means.ndim != 2 or 0 in means.shape or means.shape != deviations.shape:
        raise LabError(
            f"means and deviations are both (M, K); given: {means.shape}, {deviations.shape}"
        )
    if not (deviations >= 0.0).all() or not drift >= 0.0 or not np.isfinite(means).all():
        raise LabError("means are finite, deviations and drift at least 0")
    none, nothing = np.zeros(0), np.zeros(len(means))
    return Players(
        q=np.full(means.shape, q0),
        visits=np.zeros(means.shape, np.int32),
        means=means,
        largest=nothing,
        regret=nothing,
        turns=0,
        random=random_states(rng, len(means)),
        task_random=random_states(rng, len(means)),
        costs=none,
        regrets=none,
        best=none,
    )


def step(
    bandits: Bandits,
    strategy: BehaviourPolicy,
    rule: UpdateRule,
    players: Players,
    turns: int,
    measured_bound: bool = False,
) -> Players:
    """The players after so many further turns. With `measured_bound`, L of the confidence bound is
    the largest |l| that a player has met. Raises LabError for a strategy that follows others."""
    if strategy.kind == FIXED_POLICY:
        raise LabError("a bandit has no other controller to follow")
    if players.q.shape != bandits.means.shape:
        raise LabError(
            f"the players' Q has shape {players.q.shape}, the tasks {bandits.means.shape}: "
            "they must agree"
        )
    state = [players.q, players.visits, players.means, players.largest, players.regret]
    q, visits, means, largest, regret = (array.copy() for array in state)
    random, luck = players.random.copy(), players.task_random.copy()
    costs, regrets, best = np.zeros(turns), np.zeros(turns), np.zeros(turns)
    world = (bandits.deviations, bandits.drift, means, luck)
    _simulate_turns(
        world,
        strategy,
        rule,
        measured_bound,
        q,
        visits,
        largest,
        regret,
        random,
        (costs, regrets, best),
    )
    many = len(q)
    return replace(
        players,
        q=q,
        visits=visits,
        means=means,
        largest=largest,
        regret=regret,
        turns=players.turns + turns,
        random=random,
        task_random=luck,
        costs=costs / many,
        regrets=regrets / many,
        best=best / many,
    )


@compiled
def _simulate_turns(
    world: tuple[np.ndarray, float, np.ndarray, np.ndarray],
    strategy: BehaviourPolicy,
    rule: UpdateRule,
    measured_bound: bool,
    q: np.ndarray,
    visits: np.ndarray,
    largest: np.ndarray,
    regret: np.ndarray,
    random: np.ndarray,
    curves: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    deviations, drift, means, luck = world
    costs, regrets, best = curves
    by_bound = measured_bound and strategy.kind == CONFIDENCE_BOUND
    for m in range(len(q)):
        mean, mine, its = means[m], random[m], luck[m]
        least = mean.min()
        for t in range(len(costs)):
            if by_bound:
                u = lower_confidence_bound(q, m, visits, largest[m], mine)
            else:
                u = choose(strategy, m, q, visits, mine)
            cost = mean[u] + deviations[m, u] * normal(its)
            visits[m, u] += 1
            q[m, u] += step_size(rule, visits[m, u]) * (cost - q[m, u])
            largest[m] = max(largest[m], abs(cost))
            regret[m] += mean[u] - least
            costs[t] += cost
            regrets[t] += regret[m]
            best[t] += mean[u] == least
            if drift > 0.0:
                for k in range(len(mean)):
                    mean[k] += drift * normal(its)
                least = mean.min()
