"""Deep Q-learning (notes, 3.8.3; Mnih et al., 2015): Q(x, u, w) is a network with an output for
every control.

Robots drive with the epsilon-greedy policy of the present w and store what they meet. Every few
steps a mini-batch of k stored transitions, drawn at random, makes one step of Adam down

    L(w) = 1 / (2 k) sum (y - Q(x, u, w))^2,    y = l + gamma min_u' Q(x', u', w-)

with y = l where the task has ended for good; an episode cut by its horizon has not. w- are older
weights: w of the last multiple of C updates, or, by Polyak, w- <- w- + tau (w - w-) at each.
Double DQN (van Hasselt et al., 2016, beyond the notes) lets w choose and w- judge:
y = l + gamma Q(x', argmin_u' Q(x', u', w), w-).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from labs.algorithms.network import (
    AdamState,
    adam_step,
    backpropagate,
    forward,
    random_weights,
    zero_moments,
)
from labs.algorithms.replay import Minibatch, ReplayBuffer, empty_buffer, store
from labs.compiled import compiled
from labs.problems.environment import Environment
from labs.random_numbers import random_integer, random_states, uniform


class DqnOptions(NamedTuple):
    """How it learns."""

    gamma: float = 0.99
    learning_rate: float = 1e-3
    """Of Adam."""
    batch_size: int = 64
    """k"""
    experience_replay: bool = True
    """False: it learns from the latest transitions only, as they come."""
    update_every: int = 4
    """Steps of a robot, all counted, from one mini-batch to the next."""
    target_every: int = 200
    """C; 1: there are no older weights."""
    polyak: float = 0.0
    """tau; 0: every C updates instead."""
    double_q_learning: bool = False
    epsilon: float = 1.0
    """At first,"""
    epsilon_end: float = 0.05
    """and at last, after"""
    epsilon_steps: int = 10_000
    """steps, along a line."""
    warm_up: int = 500
    """Steps before it begins to learn."""
    cost_scale: float = 1.0
    """Costs are divided by this before they are learned from."""


@dataclass(frozen=True, eq=False)
class DqnAgent:
    """What is learned, and where its robots are. `step` makes a new one of it."""

    sizes: np.ndarray
    """(L + 1,) int64: of the network's layers."""
    w: np.ndarray
    """(P,) float32"""
    target: np.ndarray
    """(P,) w-"""
    adam: AdamState
    replay: ReplayBuffer
    random: np.ndarray
    """(4,) uint64"""
    X: np.ndarray
    """(many, nx) where the robots are,"""
    ages: np.ndarray
    """(many,) int64: how many steps into their episodes,"""
    paid: np.ndarray
    """(many,) and what these have cost so far."""
    whole: np.ndarray
    """(many,) bool: whether they began at their beginning. `init` begins in their midst, so that
    they do not all end at once."""
    steps: int = 0
    """Of all robots together."""
    updates: int = 0
    episode_costs: tuple[float, ...] = ()
    """Of the whole episodes that ended in the last call of `step`."""
    loss: float = 0.0
    """Of the last update: L,"""
    td_error: float = 0.0
    """the root mean square of y - Q,"""
    gradient_norm: float = 0.0
    """and |dL/dw|; all 0 before the first."""

    @property
    def has_finite_weights(self) -> bool:
        """Whether all weights are finite."""
        return bool(np.isfinite(self.w).all())


def init(
    environment: Environment,
    hidden: tuple[int, ...],
    rng: np.random.Generator,
    *,
    many: int = 16,
    capacity: int = 50_000,
) -> DqnAgent:
    """One that has learned nothing, with layers of `hidden` sizes and so many robots."""
    widths = (environment.observation_size, *hidden, environment.control_count)
    sizes = np.array(widths, np.int64)
    w = random_weights(sizes, rng)
    random = random_states(rng, 1)[0]
    return DqnAgent(
        sizes=sizes,
        w=w,
        target=w,
        adam=zero_moments(len(w)),
        replay=empty_buffer(capacity, environment.observation_size),
        random=random,
        X=environment.initial_states(random, many),
        ages=np.arange(many) * environment.horizon // many,
        paid=np.zeros(many),
        whole=np.arange(many) == 0,
    )


def step(
    environment: Environment, options: DqnOptions, agent: DqnAgent, rounds: int = 1
) -> DqnAgent:
    """After so many further rounds, in each of which every robot makes a step."""
    agent = _copy_agent(agent)
    X, ages, paid, whole, random = agent.X, agent.ages, agent.paid, agent.whole, agent.random
    steps, updates, done = agent.steps, agent.updates, []
    many, stats = len(X), np.array([agent.loss, agent.td_error, agent.gradient_norm])
    seen = environment.observe(X)
    for _ in range(rounds):
        U = epsilon_greedy(agent.sizes, agent.w, seen, epsilon(options, steps), random)
        X, costs, ends = environment.step(X, U)
        after = environment.observe(X)
        scaled = (costs / options.cost_scale).astype(np.float32)
        store(agent.replay, Minibatch(seen, U, scaled, after, ends))
        due = (steps + many) // options.update_every - steps // options.update_every
        steps, ages, paid = steps + many, ages + 1, paid + costs
        if steps > options.warm_up and due:
            _learn(
                options, agent.sizes, agent.w, agent.target, agent.adam, agent.replay, random,
                due, updates, many, stats,
            )  # fmt: skip
            updates += due
        over = ends | (ages >= environment.horizon)
        if over.any():
            done += paid[over & whole].tolist()
            X, ages[over], paid[over], whole[over] = X.copy(), 0, 0.0, True
            X[over] = environment.initial_states(random, int(over.sum()))
            after = environment.observe(X)
        seen = after
    loss, td_error, gradient_norm = map(float, stats)
    return replace(
        agent, X=X, ages=ages, paid=paid, steps=steps, updates=updates, episode_costs=tuple(done),
        loss=loss, td_error=td_error, gradient_norm=gradient_norm,
    )  # fmt: skip


def epsilon(options: DqnOptions, steps: int) -> float:
    """The share of controls that are tried blindly after so many steps."""
    left = max(0.0, 1.0 - steps / max(1, options.epsilon_steps))
    return options.epsilon_end + left * (options.epsilon - options.epsilon_end)


@compiled
def q_values(sizes: np.ndarray, w: np.ndarray, observations: np.ndarray) -> np.ndarray:
    """Q (n, nu) of observations (n, o)."""
    memory = np.empty(len(observations) * sizes.sum(), w.dtype)
    return forward(sizes, w, observations, memory)


@compiled
def epsilon_greedy(
    sizes: np.ndarray, w: np.ndarray, observations: np.ndarray, share: float, random: np.ndarray
) -> np.ndarray:
    """Indices of controls (n,) int32: argmin_u Q, or with probability `share` any."""
    q = q_values(sizes, w, observations)
    chosen = np.empty(len(q), np.int32)
    for i in range(len(q)):
        blind = share > 0.0 and uniform(random) < share
        chosen[i] = random_integer(random, q.shape[1]) if blind else np.argmin(q[i])
    return chosen


def greedy_cost(environment: Environment, agent: DqnAgent, X: np.ndarray) -> np.ndarray:
    """(k,) what episodes from X (k, nx) cost under the greedy policy."""
    total, running = np.zeros(len(X)), np.ones(len(X), bool)
    for _ in range(environment.horizon):
        U = epsilon_greedy(agent.sizes, agent.w, environment.observe(X), 0.0, agent.random)
        X, costs, ends = environment.step(X, U)
        total += costs * running
        running &= ~ends
    return total


@compiled
def _learn(
    options: DqnOptions,
    sizes: np.ndarray,
    w: np.ndarray,
    target: np.ndarray,
    adam: AdamState,
    replay: ReplayBuffer,
    random: np.ndarray,
    due: int,
    updates: int,
    newest: int,
    stats: np.ndarray,
) -> None:
    """So many updates, in place."""
    capacity, o = replay.observations.shape
    known, n = min(replay.stored[0], capacity), options.batch_size
    if not options.experience_replay:
        n = min(n, newest)
    x, after = np.empty((n, o), np.float32), np.empty((n, o), np.float32)
    u, y, ends = np.empty(n, np.int32), np.empty(n, np.float32), np.empty(n, np.bool_)
    memory = np.empty(n * sizes.sum(), np.float32)
    dq, gradient = np.empty((n, sizes[-1]), np.float32), np.empty_like(w)
    for k in range(due):
        for i in range(n):
            at = (
                random_integer(random, known)
                if options.experience_replay
                else (replay.stored[0] - 1 - i) % capacity
            )
            x[i], after[i] = replay.observations[at], replay.next_observations[at]
            u[i], y[i], ends[i] = replay.controls[at], replay.costs[at], replay.ends[at]
        if options.double_q_learning:
            q = forward(sizes, w, after, memory)
            best = np.empty(n, np.int32)
            for i in range(n):
                best[i] = np.argmin(q[i])
            q = forward(sizes, target, after, memory)
            for i in range(n):
                y[i] += 0.0 if ends[i] else options.gamma * q[i, best[i]]
        else:
            q = forward(sizes, target, after, memory)
            for i in range(n):
                y[i] += 0.0 if ends[i] else options.gamma * q[i].min()
        q = forward(sizes, w, x, memory)
        dq[:] = 0.0
        squares = 0.0
        for i in range(n):
            error = q[i, u[i]] - y[i]
            squares += error * error
            dq[i, u[i]] = error / n
        backpropagate(sizes, w, memory, dq, gradient)
        adam_step(adam, w, gradient, options.learning_rate)
        if options.polyak > 0.0:
            for i in range(len(w)):
                target[i] += options.polyak * (w[i] - target[i])
        elif (updates + k + 1) % options.target_every == 0:
            target[:] = w
        stats[0], stats[1] = squares / (2 * n), np.sqrt(squares / n)
    total = 0.0
    for g in gradient:
        total += g * g
    stats[2] = np.sqrt(total)


def _copy_agent(agent: DqnAgent) -> DqnAgent:
    """With arrays of its own, to be written into."""
    return replace(
        agent,
        w=agent.w.copy(),
        target=agent.target.copy(),
        adam=AdamState(*(part.copy() for part in agent.adam)),
        replay=ReplayBuffer(*(part.copy() for part in agent.replay)),
        random=agent.random.copy(),
        ages=agent.ages.copy(),
        paid=agent.paid.copy(),
        whole=agent.whole.copy(),
    )
