"""What dynamic programming is tried on: a grid world, the pendulum's table or somebody's own, with
its exact solution, and the values that the iterations begin with.

A task is known by a text (JSON), so that what was computed for it can say which one it was.
"""

import json
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from labs.algorithms import backward_recursion, policy_evaluation
from labs.algorithms.policy_iteration import optimum
from labs.problems.finite_mdp import FiniteMDP
from labs.reinforcement_learning.dynamic_programming.iteration_comparison import (
    RANDOM_CONTROL,
    Iterates,
    initial_iterates,
    unpack_policy,
)
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.map import GridWorld, grid_world
from labs.tasks.mdp_table.world import table_world
from labs.tasks.pendulum_table.table import PendulumGrid, pendulum_grid

HORIZON = 40
"""Steps to go at most."""


@dataclass(frozen=True, eq=False)
class TabularTask:
    """An MDP, what it stands for, and its exact solution."""

    mdp: FiniteMDP
    place: CellWorld | PendulumGrid

    @cached_property
    def initial_policy(self) -> np.ndarray:
        """pi_0 (X,): RANDOM_CONTROL on a grid, the motor off on a pendulum."""
        control = self.mdp.U // 2 if isinstance(self.place, PendulumGrid) else RANDOM_CONTROL
        return np.full(self.mdp.X, control, np.int16)

    @cached_property
    def limits(self) -> np.ndarray:
        """(4, X): what each of ITERATION_METHODS goes to, V^(pi_0) and three times V*."""
        best, _ = self.solution
        return np.stack(
            [
                policy_evaluation.exact_values(self.mdp, self._unpacked_initial_policy),
                best,
                best,
                best,
            ]
        )

    @cached_property
    def solution(self) -> tuple[np.ndarray, np.ndarray]:
        """V* (X,) and an optimal policy (X,)."""
        V, policy, _ = optimum(self.mdp, self._unpacked_initial_policy)
        return V, policy

    @cached_property
    def distance(self) -> np.ndarray:
        """(X,): from each state straight to the goal [cells; rad], walls or not; of a table 0."""
        if isinstance(self.place, PendulumGrid):
            return np.asarray(np.abs(self.place.nodes[:, 0] - np.pi))
        if not isinstance(self.place, GridWorld):
            return np.zeros(self.mdp.X)
        goals = self.place.cells[self.place.goals]
        apart = self.place.cells[:, None] - goals[None]
        return np.asarray(np.linalg.norm(apart, axis=2).min(axis=1))

    @property
    def start(self) -> int:
        """Where an episode begins: S, the first row of a table, or hanging at rest."""
        return self.place.start if isinstance(self.place, CellWorld) else self.state(np.zeros(2))

    def state(self, at: np.ndarray) -> int:
        """Of a cell (row, column), or of the node nearest to (q, v), (2,)."""
        if isinstance(self.place, CellWorld):
            return self.place.state(at)
        return int(self.place.state(at[:1], at[1:]))

    @property
    def _unpacked_initial_policy(self) -> np.ndarray:
        """pi_0 as the algorithms take it."""
        return unpack_policy(self.mdp, self.initial_policy)


@lru_cache(maxsize=6)
def tabular_task(key: str) -> TabularTask:
    """The task a text describes."""
    described: dict[str, Any] = json.loads(key)
    gamma = described["gamma"]
    if "map" in described:
        world = grid_world(described["map"], described["kings"])
        happens = (described[name] for name in ("slip", "sideways", "living"))
        return TabularTask(world.mdp(gamma, *happens), world)
    if "table" in described:
        own = table_world(described["table"])
        return TabularTask(own.mdp(gamma), own)
    nodes = described["nodes"]
    grid = pendulum_grid(
        q_nodes=nodes, v_nodes=nodes, levels=described["levels"], torque=described["torque"]
    )
    return TabularTask(grid.mdp(gamma, 1.0, described["w_v"], described["w_u"]), grid)


def grid_key(
    text: str, kings: bool, slip: float, sideways: bool, living: float, gamma: float
) -> str:
    """Of a grid world."""
    described = {"map": text, "kings": kings, "slip": slip, "sideways": sideways}
    return json.dumps(described | {"living": living, "gamma": gamma})


def table_key(text: str, gamma: float) -> str:
    """Of a table."""
    return json.dumps({"table": text, "gamma": gamma})


def pendulum_key(
    nodes: int, levels: int, torque: float, w_v: float, w_u: float, gamma: float
) -> str:
    """Of a pendulum."""
    described = {"nodes": nodes, "levels": levels, "torque": torque, "w_v": w_v, "w_u": w_u}
    return json.dumps(described | {"gamma": gamma})


@lru_cache(maxsize=4)
def finite_horizon(key: str, w_f: float) -> tuple[np.ndarray, np.ndarray]:
    """V (HORIZON + 1, X) and policies (HORIZON, X) by the steps to go, with the final cost w_f
    times the straight distance to the goal."""
    task = tabular_task(key)
    return backward_recursion.value_and_policy_tables(task.mdp, w_f * task.distance, HORIZON)


def cold_start(key: str, seed: int, spread: float) -> Iterates:
    """Before the first sweep: values drawn from [0, spread], the same for all methods."""
    task = tabular_task(key)
    V = np.random.default_rng(seed).uniform(0.0, spread, task.mdp.X)
    V[task.mdp.terminal] = 0.0
    none = np.zeros(task.mdp.X, np.int16)
    policy = np.stack([task.initial_policy, task.initial_policy, none, none])
    return initial_iterates(task.mdp, np.tile(V, (4, 1)), policy, task.limits)


def warm_start(iterates: Iterates, old: str, new: str, cold: Iterates) -> Iterates:
    """Before the first sweep on a new task, from the values found on an old one with the same
    cells or the same grid of angles and velocities; `cold` where they do not fit."""
    before, after, mdp = tabular_task(old).place, tabular_task(new).place, tabular_task(new).mdp
    V, policy = iterates.V, cold.policy.copy()
    if isinstance(before, CellWorld) and isinstance(after, CellWorld):
        if type(before) is not type(after) or before.shape != after.shape:
            return cold
        on_map = np.stack([before.on_map(row) for row in V])
        V = np.where(mdp.terminal, 0.0, on_map[:, after.cells[:, 0], after.cells[:, 1]])
    elif type(before) is not type(after) or V.shape != cold.V.shape:
        return cold
    if iterates.policy.shape == policy.shape and iterates.policy[1].max() < mdp.U:
        policy[1] = iterates.policy[1]  # policy iteration goes on from the policy it has
    return initial_iterates(mdp, V, policy, tabular_task(new).limits)
