"""Whose value is learned in the lab of prediction: policies on walks, a grid and a pendulum, each
with its exact value."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from labs.algorithms.prediction import on_policy_task
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.problems.prediction import PredictionTask
from labs.tasks.grid_world.map import MAPS, GridWorld, grid_world
from labs.tasks.pendulum_table.table import PendulumGrid, pendulum_grid
from labs.tasks.random_walk.walks import MAX_STEPS, WalkShape, walk_mdp

LEARNERS, PENDULUM_LEARNERS = 100, 20
LARGEST_GAMMA = 0.95
"""Largest discount of the pendulum's costs, which need not end."""
PENDULUM_GRID = pendulum_grid(rods=1, q_nodes=31, v_nodes=21, levels=5, torque=6.0, dt=0.15)
"""651 states, 5 torques, 0.15 s a step. Its motor can hold it level."""
HORIZONS = {"grid": 5000, "pendulum": 100}
"""Steps after which an episode is cut."""
KP, KD = 15.0, 2.5
"""Gains of the PD controller [N m/rad], [N m s/rad]; its torque is the nearest of the five."""


@dataclass(frozen=True, eq=False)
class PredictionWorld:
    """A policy, and all that is known of it except to the learners."""

    mdp: FiniteMDP
    task: PredictionTask
    policy: np.ndarray
    """(X, U) probabilities."""
    place: WalkShape | GridWorld | PendulumGrid
    start: int
    """The state whose targets are drawn by default."""
    states: np.ndarray
    """(k,) int: states that a curve over states goes through."""
    axis_positions: np.ndarray
    """(k,) where on its axis."""
    learners: int = LEARNERS

    @property
    def truth(self) -> np.ndarray:
        """(X,) V^pi."""
        return self.task.truth


@lru_cache(maxsize=8)
def walk_prediction(shape: WalkShape, gamma: float) -> PredictionWorld:
    """A random walk from the middle."""
    mdp = replace(walk_mdp(shape), gamma=gamma)
    policy, inner = random_policy(mdp), np.arange(1, shape.states + 1)
    task = on_policy_task(mdp, policy, [shape.start], MAX_STEPS)
    return PredictionWorld(mdp, task, policy, shape, shape.start, inner, inner.astype(float))


@lru_cache(maxsize=8)
def grid_prediction(gamma: float) -> PredictionWorld:
    """Any step, from anywhere, on 4 x 4 cells with two goals (Sutton and Barto, example 4.1)."""
    place = grid_world(MAPS["4x4"], False)
    mdp = place.mdp(gamma)
    inner = np.flatnonzero(~mdp.terminal)
    policy = random_policy(mdp)
    task = on_policy_task(mdp, policy, [int(x) for x in inner], HORIZONS["grid"])
    return PredictionWorld(mdp, task, policy, place, int(inner[-1]), inner, inner.astype(float))


@lru_cache(maxsize=8)
def pendulum_prediction(gamma: float, noise: float, ends: bool) -> PredictionWorld:
    """A PD controller that swings a pendulum up, with a random torque in a part `noise` of its
    steps; from anywhere. With `ends` the nodes next to upright at rest are terminal."""
    place = PENDULUM_GRID
    angle = np.abs(place.nodes[:, 0] - np.pi)
    near = (angle < 1.5 * 2 * np.pi / place.q_nodes) & (np.abs(place.nodes[:, 1]) < 1.0)
    terminal = near if ends else np.zeros(place.X, bool)
    free = place.mdp(gamma)
    cost = np.where(terminal[:, None], 0.0, free.C)
    itself = np.arange(place.X, dtype=np.int32)[:, None]
    successor = np.where(terminal[:, None], itself, place.successor)
    mdp = FiniteMDP(cost, gamma, terminal, successor=successor)
    policy = np.full(mdp.C.shape, noise / mdp.U)
    policy[np.arange(mdp.X), pd_controls(place)] += 1.0 - noise
    starts = [int(x) for x in np.flatnonzero(~terminal)]
    task = on_policy_task(mdp, policy, starts, HORIZONS["pendulum"])
    hanging = int(place.state(np.zeros(1), np.zeros(1)))
    still = np.flatnonzero(np.abs(place.nodes[:, 1]) < 1e-9)
    across = place.angles
    return PredictionWorld(mdp, task, policy, place, hanging, still, across, PENDULUM_LEARNERS)


def pd_controls(place: PendulumGrid) -> np.ndarray:
    """(X,) int: the level nearest to tau = k_p e - k_d v, with e the angle left to upright."""
    q, v = place.nodes.T
    tau = KP * (np.pi - q) - KD * v
    return np.asarray(np.abs(tau[:, None] - place.torques[:, 0]).argmin(axis=1))
