"""Random walks along a line as finite MDPs (labs/problems/finite_mdp.py), for the labs of
prediction, TD(lambda) and function approximation.

The states 1..n lie between the terminal states 0 and n + 1. A control is a jump of 1 to `reach`
states to the left or right; the policy under study draws evenly among them. A jump beyond an end
ends there, at the cost of that end; all else costs nothing, and nothing is discounted.

With reach = 1 the value is linear, V(i) = left + (right - left) i / (n + 1). The walks of Sutton
and Barto (Reinforcement Learning, 2nd edition), their rewards as negative costs:

    5 states, ends 0 and -1      example 6.2       V from -1/6 to -5/6
    19 states, ends 1 and -1     example 7.1       V from 0.9 to -0.9
    1000 states, jumps to 100    example 9.1       ends 1 and -1
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from labs.algorithms.policy_evaluation import expected_visits
from labs.algorithms.prediction import on_policy_task
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.problems.prediction import PredictionTask

MAX_STEPS = 50_000
"""Steps: beyond what any walk here takes."""


class WalkShape(NamedTuple):
    """A walk along a line."""

    states: int
    """n, between the two ends."""
    left: float
    """Cost of ending on the left."""
    right: float
    """Cost of ending on the right."""
    reach: int = 1
    """States of the longest jump."""

    @property
    def start(self) -> int:
        """The state in the middle; the left one of two."""
        return (self.states + 1) // 2


FIVE_STATE_WALK = WalkShape(5, 0.0, -1.0)
NINETEEN_STATE_WALK = WalkShape(19, 1.0, -1.0)
THOUSAND_STATE_WALK = WalkShape(1000, 1.0, -1.0, reach=100)


def walk_mdp(walk: WalkShape) -> FiniteMDP:
    """The walk as an MDP of n + 2 states and 2 reach controls, from the longest jump left to the
    longest jump right."""
    n, end = walk.states, walk.states + 1
    jumps = np.concatenate([np.arange(-walk.reach, 0), np.arange(1, walk.reach + 1)])
    successor = np.clip(np.arange(n + 2)[:, None] + jumps, 0, end).astype(np.int32)
    cost = np.where(successor == 0, walk.left, 0.0) + np.where(successor == end, walk.right, 0.0)
    for terminal in (0, end):
        successor[terminal], cost[terminal] = terminal, 0.0
    is_end = np.zeros(n + 2, bool)
    is_end[[0, end]] = True
    return FiniteMDP(cost, 1.0, is_end, successor=successor)


@lru_cache(maxsize=8)
def walk_task(walk: WalkShape) -> PredictionTask:
    """Prediction of the even policy from the start in the middle."""
    mdp = walk_mdp(walk)
    return on_policy_task(mdp, random_policy(mdp), [walk.start], MAX_STEPS)


def on_policy_distribution(walk: WalkShape) -> np.ndarray:
    """(n + 2,) mu: the share of all steps that begin in each state, 0 at the ends."""
    mdp = walk_mdp(walk)
    visits = expected_visits(mdp, random_policy(mdp), walk.start)
    return np.asarray(visits / visits.sum())
