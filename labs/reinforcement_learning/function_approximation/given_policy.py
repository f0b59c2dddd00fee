"""What is predicted: the random walk of 1000 states, and the pendulum that swings up by its optimal
table, each with its truth and with what the features can make of it.

The pendulum's episodes begin anywhere and end once it is caught, upright and slow; from there on
nothing is paid. All of it is deterministic but the start."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from labs.algorithms import policy_iteration
from labs.algorithms.approximation import expected_td_update, td_fixed_point, weighted_least_squares
from labs.algorithms.features import Features, state_values, zero_features_at
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.problems.prediction import PredictionTask, prediction_task, root_mean_square_error
from labs.reinforcement_learning.function_approximation.feature_sets import (
    line_features,
    plane_features,
)
from labs.tasks.pendulum_table.table import PendulumGrid, pendulum_grid
from labs.tasks.random_walk.walks import (
    THOUSAND_STATE_WALK,
    on_policy_distribution,
    walk_mdp,
    walk_task,
)

PENDULUM_GRID = pendulum_grid(rods=1, q_nodes=41, v_nodes=31, levels=5)
"""1271 states, 5 torques, 0.1 s a step."""
GAMMA = 0.95
"""Of the pendulum's costs."""
HORIZON = 200
"""Steps: beyond what the pendulum takes from any start."""
GOAL_TOLERANCE = (0.2, 0.6)
"""[rad], [rad/s] from upright at rest within which it is caught."""


@dataclass(frozen=True, eq=False)
class GivenPolicy:
    """A policy to be judged, and the features it is judged with."""

    task: PredictionTask
    features: Features
    mdp: FiniteMDP
    policy: np.ndarray
    best: np.ndarray
    """w (d,) of the least value error, weighed by the visits of the policy."""
    fixed: np.ndarray
    """w (d,) of the TD fixed point."""

    def error(self, w: np.ndarray) -> float:
        """sqrt of the value error of w (d,)."""
        return float(root_mean_square_error(self.task, self.values(w)))

    @cached_property
    def best_error(self) -> float:
        """The least there is."""
        return self.error(self.best)

    @cached_property
    def fixed_error(self) -> float:
        """Of the TD fixed point."""
        return self.error(self.fixed)

    def values(self, w: np.ndarray) -> np.ndarray:
        """v (X,)."""
        return state_values(self.features, w)


@lru_cache(maxsize=8)
def walk_policy(kind: str, n: int) -> GivenPolicy:
    """The even policy on the 1000 states."""
    task = walk_task(THOUSAND_STATE_WALK)._replace(
        weight=on_policy_distribution(THOUSAND_STATE_WALK)
    )
    mdp = walk_mdp(THOUSAND_STATE_WALK)
    features = line_features(kind, n, THOUSAND_STATE_WALK.states)
    return _solve_given_policy(task, features, mdp, random_policy(mdp), kind)


@lru_cache(maxsize=8)
def pendulum_policy(kind: str, m: int) -> GivenPolicy:
    """The optimal policy of the pendulum."""
    task, mdp, policy = pendulum_prediction_task()
    features = zero_features_at(plane_features(kind, m, PENDULUM_GRID), mdp.terminal)
    return _solve_given_policy(task, features, mdp, policy, kind)


@lru_cache(maxsize=1)
def pendulum_prediction_task() -> tuple[PredictionTask, FiniteMDP, np.ndarray]:
    """The task, its model, and the policy (X,) int64."""
    grid, free = PENDULUM_GRID, PENDULUM_GRID.mdp(GAMMA)
    away = np.abs(grid.nodes - np.array([np.pi, 0.0]))
    ended = (away < np.array(GOAL_TOLERANCE)).all(axis=1)
    cost = np.where(ended[:, None], 0.0, free.C)
    stays = np.where(ended[:, None], np.arange(grid.X)[:, None], free.successors)
    mdp = FiniteMDP(cost, GAMMA, ended, successor=stays.astype(np.int32))
    value, policy, _ = policy_iteration.optimum(mdp, np.zeros(grid.X, np.int64))
    policy = np.asarray(policy, np.int64)
    starts, visits = _visits(mdp, policy)
    return prediction_task(mdp, policy, value, starts, HORIZON, weight=visits), mdp, policy


def _visits(mdp: FiniteMDP, policy: np.ndarray) -> tuple[list[int], np.ndarray]:
    """The states from which the goal is reached, and how often each (X,) is met from all of them.
    A few nodes beside the goal round to one another for ever."""
    ahead = mdp.successors[np.arange(mdp.X), policy]
    last = np.arange(mdp.X)
    for _ in range(HORIZON):
        last = ahead[last]
    starts = np.flatnonzero(mdp.terminal[last] & ~mdp.terminal)
    visits, at = np.zeros(mdp.X), starts
    while len(at):
        visits += np.bincount(at, minlength=mdp.X)
        at = ahead[at]
        at = at[~mdp.terminal[at]]
    return starts.tolist(), visits


def _solve_given_policy(
    task: PredictionTask, features: Features, mdp: FiniteMDP, policy: np.ndarray, kind: str
) -> GivenPolicy:
    mu = task.weight
    if kind == "table":
        # Both are the truth; the linear systems are large.
        best = np.zeros(features.size)
        live = features.value[:, 0] != 0.0
        best[features.active[live, 0]] = task.truth[live]
        return GivenPolicy(task, features, mdp, policy, best, best)
    P, C, phi = mdp.transition_matrix(policy), mdp.policy_cost(policy), features.dense
    best = weighted_least_squares(task.truth, phi, mu)
    fixed = td_fixed_point(*expected_td_update(P, C, float(mdp.gamma), phi, mu))
    return GivenPolicy(task, features, mdp, policy, best, fixed)


def on_map(values: np.ndarray, grid: PendulumGrid = PENDULUM_GRID) -> np.ndarray:
    """Values (X,) as a map (velocities, angles)."""
    return values.reshape(grid.shape).T
