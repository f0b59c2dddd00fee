"""Two small worlds for the table of convergence (notes, 3.8.1).

Two rooms, each with a left and a right door:

    room 1   left: free, leads to room 2        right: costs 2, the end
    room 2   left: costs 3, the end             right: free, the end

Best is left, then right: nothing is paid. Features that cannot tell the rooms apart leave one q of
each door for both. Whoever prefers left is often in room 2, where left is dear, and learns to
prefer right; whoever prefers right is nearly always in room 1, where right is dear, and learns to
prefer left.

The wheel: one room whose left door costs 1.5 and whose right door gains 0.5, and that is all. Its
q has one weight w. With t(w) = |w - 2 round(w / 2)|, a wave of triangles between 0 and 1,

    q(left) = t,   q(right) = t + t (1 - t)          where t rises:  left seems the better one
    q(left) = t + t (1 - t),   q(right) = t          where it falls: right seems the better one

Where left seems better it is tried, found to be dearer, and w grows until q(left) is raised to 1;
where right seems better, it is tried, found to be cheaper, and w grows until q(right) is lowered to
0. So w grows for ever, and the greedy policy changes twice a turn, whatever the step size."""

import numpy as np

from labs.algorithms.exploration import BehaviourPolicy
from labs.algorithms.features import Features, state_aggregation, tabular_features, zero_features_at
from labs.compiled import compiled
from labs.problems.episodes import EpisodicTask, UpdateRule, episodic_task, step_size
from labs.problems.finite_mdp import FiniteMDP
from labs.random_numbers import random_integer, uniform

GAMMA, EPSILON = 0.5, 0.2
"""Discount in the rooms; chance of any door, for ever."""
RULE = UpdateRule(1.0, 0.6, limit=1e6)
"""Steps that shrink as Robbins and Monro ask."""
BEHAVIOUR = BehaviourPolicy(epsilon=EPSILON)
_TERMINAL = np.array([False, False, True])
ALIASED_FEATURES: Features = zero_features_at(state_aggregation(np.array([0, 0, 1])), _TERMINAL)
"""The rooms share their features."""
TABULAR_FEATURES: Features = zero_features_at(tabular_features(3), _TERMINAL)
OPTIMAL_Q = np.array([[0.0, 2.0], [3.0, 0.0]])
"""Q* of rooms and doors."""
EXPLORING_OPTIMAL_Q = np.array([[GAMMA * EPSILON / 2.0 * 3.0, 2.0], [3.0, 0.0]])
"""Q of the best policy that still tries any door with probability EPSILON."""
WHEEL_COSTS = np.array([1.5, -0.5])


def rooms() -> EpisodicTask:
    """From room 1."""
    successor = np.array([[1, 2], [2, 2], [2, 2]], np.int32)
    cost = np.array([[0.0, 2.0], [3.0, 0.0], [0.0, 0.0]])
    return episodic_task(FiniteMDP(cost, GAMMA, _TERMINAL, successor=successor), [0], 10)


@compiled
def wheel_q(w: float) -> tuple[float, float, float, float]:
    """q(left), q(right), and their slopes."""
    t, slope = abs(w - 2.0 * round(w / 2.0)), 1.0
    rises = w % 2.0 < 1.0
    if not rises:
        slope = -1.0
    other, bent = t + t * (1.0 - t), slope * (2.0 - 2.0 * t)
    return (t, other, slope, bent) if rises else (other, t, bent, slope)


@compiled
def update_wheel_weight(
    w: float, random: np.ndarray, rule: UpdateRule, updates: int, done: int
) -> float:
    """w after so many further episodes of one step, `done` before them. `random` (4,) changes in
    place."""
    for n in range(done + 1, done + updates + 1):
        left, right, left_slope, right_slope = wheel_q(w)
        goes_left = left < right
        if uniform(random) < EPSILON:
            goes_left = random_integer(random, 2) == 0
        if goes_left:
            w += step_size(rule, n) * (1.5 - left) * left_slope
        else:
            w += step_size(rule, n) * (-0.5 - right) * right_slope
    return w
