"""What is learned in the lab of model-free control: grid worlds, the pendulum swung up and tables,
each with its exact answer from dynamic programming and a controller to look over its shoulder."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from labs.algorithms import policy_iteration
from labs.algorithms.bellman import q_values, unbounded_message
from labs.problems.episodes import EpisodicTask, episodic_task
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.map import GridWorld, grid_world
from labs.tasks.mdp_table.world import table_world
from labs.tasks.pendulum_table.table import PendulumGrid, pendulum_grid

HORIZONS: Mapping[str, int] = {"grid": 500, "pendulum": 100, "table": 100}
"""An episode is cut after these."""
PENDULUM_GRID = pendulum_grid(rods=1, q_nodes=41, v_nodes=31, levels=5)
"""1271 states, 5 torques, 0.1 s a step. Its motor lifts half of what it takes to hold it level."""
LARGEST_GAMMA = 0.99
"""Largest discount of the pendulum's costs, which have no end."""
KP, KD = 10.0, 1.0
"""Gains of the PD controller [N m/rad], [N m s/rad]; far from upright its torque is cut off."""


@dataclass(frozen=True, eq=False)
class ControlTask:
    """What is to be learned."""

    mdp: FiniteMDP
    place: CellWorld | PendulumGrid
    learning: EpisodicTask
    """Episodes as they are learned from."""
    evaluation: EpisodicTask
    """Episodes from the one start where a greedy policy is tried."""
    q_star: np.ndarray
    """(X, U) Q*; infinite where no control ever leads to an end."""
    compared: np.ndarray
    """(X,) bool: where learners are compared with it: what they can meet and leave again."""
    reference_policy: np.ndarray
    """(X,) int64: the other controller's choices."""
    shape: tuple[int, int]
    """(rows, columns) of a map of the states: of the grid world; velocities and angles."""
    cells: np.ndarray
    """(X, 2) int: (row, column) of each state on it."""

    @property
    def start(self) -> int:
        """Where a greedy policy is tried from."""
        return int(self.evaluation.starts[0])

    @cached_property
    def no_optimum_message(self) -> str:
        """Why the start has no optimal cost, in a sentence; empty where it has one."""
        V = self.q_star.min(axis=1)
        message = "" if np.isfinite(V[self.start]) else unbounded_message(V)
        return message[:1].upper() + message[1:]

    def on_map(self, values: np.ndarray, fill: float = 0.0) -> np.ndarray:
        """(rows, columns): `values` (X,) on the map, `fill` where there is no state."""
        on_map = np.full(self.shape, fill)
        on_map[tuple(self.cells.T)] = values
        return on_map

    def errors(self, q: np.ndarray) -> tuple[float, float]:
        """Root mean square and largest of |Q - Q*| over the pairs that are compared, if any."""
        off = q[self.compared] - self.q_star[self.compared]
        if not off.size:
            return 0.0, 0.0
        return float(np.sqrt(np.mean(off**2))), float(np.abs(off).max())


@lru_cache(maxsize=16)
def grid_task(
    text: str,
    kings: bool,
    slip: float,
    sideways: bool,
    living: float,
    gamma: float,
    anywhere: bool,
) -> ControlTask:
    """A walk to the goal."""
    world = grid_world(text, kings)
    mdp = world.mdp(gamma, slip, sideways, living)
    maps = (world.shape, world.cells)
    return _task(mdp, world, world.start, anywhere, HORIZONS["grid"], cautious_policy(world), *maps)


@lru_cache(maxsize=16)
def table_task(text: str, gamma: float, anywhere: bool) -> ControlTask:
    """What a table says, from its first state on."""
    world = table_world(text)
    mdp = world.mdp(gamma)
    teacher, maps = mdp.C.argmin(axis=1), (world.shape, world.cells)
    return _task(mdp, world, world.start, anywhere, HORIZONS["table"], teacher, *maps)


@lru_cache(maxsize=8)
def pendulum_task(gamma: float, effort: float, anywhere: bool) -> ControlTask:
    """To swing up from hanging at rest and stay there."""
    mdp = PENDULUM_GRID.mdp(gamma, w_u=effort)
    start = int(PENDULUM_GRID.state(np.zeros(1), np.zeros(1)))
    angles, velocities = PENDULUM_GRID.shape
    i, j = np.divmod(np.arange(mdp.X), velocities)
    maps = ((velocities, angles), np.stack([j, i], axis=1))
    horizon, teacher = HORIZONS["pendulum"], pd_policy(PENDULUM_GRID)
    return _task(mdp, PENDULUM_GRID, start, anywhere, horizon, teacher, *maps)


def cautious_policy(world: GridWorld) -> np.ndarray:
    """(X,) int64: up to the top row, along it, and down in the column of the (first) goal."""
    column = int(world.cells[np.argmax(world.goals)][1])
    policy = np.zeros(len(world.cells), np.int64)
    for x, (row, here) in enumerate(world.cells):
        if here == column:
            policy[x] = 2
        elif row == 0 or not (world.index[row - 1, here] >= 0):
            policy[x] = 1 if here < column else 3
    return policy


def pd_policy(grid: PendulumGrid) -> np.ndarray:
    """(X,) int64: the level nearest to tau = k_p e - k_d v, with e the angle left to upright."""
    q, v = grid.nodes.T
    tau = KP * (grid.goal[0] - q) - KD * v
    choice: np.ndarray = np.abs(tau[:, None] - grid.torques[:, 0]).argmin(axis=1)
    return choice.astype(np.int64)


def _task(
    mdp: FiniteMDP,
    place: CellWorld | PendulumGrid,
    start: int,
    anywhere: bool,
    horizon: int,
    teacher: np.ndarray,
    shape: tuple[int, int],
    cells: np.ndarray,
) -> ControlTask:
    first = np.zeros(mdp.X, np.int64) if mdp.deterministic else random_policy(mdp)
    value, _, _ = policy_iteration.optimum(mdp, first)
    starts = [int(x) for x in np.flatnonzero(~mdp.terminal)] if anywhere else [start]
    q_star = q_values(mdp, value)
    return ControlTask(
        mdp=mdp,
        place=place,
        learning=episodic_task(mdp, starts, horizon),
        evaluation=episodic_task(mdp, [start], horizon),
        q_star=q_star,
        compared=mdp.reachable(starts) & ~mdp.terminal & np.isfinite(q_star).all(axis=1),
        reference_policy=teacher,
        shape=shape,
        cells=cells,
    )
