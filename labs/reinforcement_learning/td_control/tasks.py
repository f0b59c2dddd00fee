"""What is learned in the lab of model-free control: grid worlds and the pendulum swung up, each
with its exact answer from dynamic programming and a controller to look over the shoulder of."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from pydantic import field_validator

from labs.algorithms import policy_iteration
from labs.algorithms.bellman import q_values
from labs.errors import LabError
from labs.params import Group, Params
from labs.problems.episodes import Problem, problem
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.pendulum_table.table import PendulumGrid, pendulum_grid

STEPS: Mapping[str, int] = {"grid": 500, "pendulum": 100}
"""An episode is cut after these."""
PENDULUM = pendulum_grid(rods=1, q_nodes=41, v_nodes=31, levels=5)
"""1271 states, 5 torques, 0.1 s a step. Its motor lifts half of what it takes to hold it level."""
PATIENCE = 0.99
"""Largest discount of the pendulum's costs, which have no end."""
KP, KD = 10.0, 1.0
"""Gains of the PD controller [N m/rad], [N m s/rad]; far from upright its torque is cut off."""


WORLD = Group("World", effect="solve")


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be learned."""

    mdp: FiniteMDP
    practice: Problem
    """Episodes as they are learned from."""
    trial: Problem
    """Episodes from the one start where a greedy policy is tried."""
    q_star: np.ndarray
    """(X, U) Q*; infinite where no control ever leads to an end."""
    judged: np.ndarray
    """(X,) bool: where learners are compared with it: what they can meet and leave again."""
    teacher: np.ndarray
    """(X,) int64: the other controller's choices."""
    shape: tuple[int, int]
    """(rows, columns) of a map of the states."""
    places: np.ndarray
    """(X,) int: where on it, counted along the rows."""
    cells: np.ndarray
    """(X, 2) int: (row, column) of each state."""

    @cached_property
    def index(self) -> np.ndarray:
        """(rows, columns) int: the state of each place on the map, -1 where there is none."""
        index = np.full(self.shape, -1)
        index.flat[self.places] = np.arange(self.mdp.X)
        return index

    @property
    def start(self) -> int:
        """Where a greedy policy is tried from."""
        return int(self.trial.starts[0])

    def laid(self, values: np.ndarray, fill: float = 0.0) -> np.ndarray:
        """(rows, columns): `values` (X,) on the map, `fill` where there is no state."""
        laid = np.full(self.shape, fill)
        laid.flat[self.places] = values
        return laid

    def errors(self, q: np.ndarray) -> tuple[float, float]:
        """Root mean square and largest of |Q - Q*| over the pairs that are judged, if any."""
        off = q[self.judged] - self.q_star[self.judged]
        if not off.size:
            return 0.0, 0.0
        return float(np.sqrt(np.mean(off**2))), float(np.abs(off).max())


@lru_cache(maxsize=64)
def grid_world(text: str, kings: bool) -> GridWorld:
    """The world of a map. Raises LabError."""
    return GridWorld.parse(text, kings)


@lru_cache(maxsize=16)
def grid_task(text: str, kings: bool, slip: float, gamma: float, anywhere: bool) -> Task:
    """A walk to the goal."""
    world = grid_world(text, kings)
    mdp = world.mdp(gamma, slip)
    places = world.cells @ (world.shape[1], 1)
    return _task(mdp, world.start, anywhere, "grid", cautious(world), world.shape, places)


@lru_cache(maxsize=8)
def pendulum_task(gamma: float, effort: float, anywhere: bool) -> Task:
    """To swing up from hanging at rest and stay there."""
    mdp = PENDULUM.mdp(gamma, w_u=effort)
    start = int(PENDULUM.state(np.zeros(1), np.zeros(1)))
    angles, velocities = PENDULUM.shape
    i, j = np.divmod(np.arange(mdp.X), velocities)
    places = j * angles + i
    shape = (velocities, angles)
    return _task(mdp, start, anywhere, "pendulum", pd_control(PENDULUM), shape, places)


def cautious(world: GridWorld) -> np.ndarray:
    """(X,) int64: up to the top row, along it, and down in the column of the (first) goal."""
    goal = next(x for x in range(len(world.cells)) if world.kind(x) == "G")
    column = int(world.cells[goal][1])
    policy = np.zeros(len(world.cells), np.int64)
    for x, (row, here) in enumerate(world.cells):
        if here == column:
            policy[x] = 2
        elif row == 0 or not (world.index[row - 1, here] >= 0):
            policy[x] = 1 if here < column else 3
    return policy


def pd_control(grid: PendulumGrid) -> np.ndarray:
    """(X,) int64: the level nearest to tau = k_p e - k_d v, with e the angle left to upright."""
    q, v = grid.nodes.T
    tau = KP * (grid.goal[0] - q) - KD * v
    choice: np.ndarray = np.abs(tau[:, None] - grid.torques[:, 0]).argmin(axis=1)
    return choice.astype(np.int64)


def _task(
    mdp: FiniteMDP,
    start: int,
    anywhere: bool,
    system: str,
    teacher: np.ndarray,
    shape: tuple[int, int],
    places: np.ndarray,
) -> Task:
    first = np.zeros(mdp.X, np.int64) if mdp.deterministic else random_policy(mdp)
    value, _, _ = policy_iteration.optimum(mdp, first)
    starts = [int(x) for x in np.flatnonzero(~mdp.terminal)] if anywhere else [start]
    q_star = q_values(mdp, value)
    return Task(
        mdp=mdp,
        practice=problem(mdp, starts, STEPS[system]),
        trial=problem(mdp, [start], STEPS[system]),
        q_star=q_star,
        judged=mdp.reachable(starts) & ~mdp.terminal & np.isfinite(q_star).all(axis=1),
        teacher=teacher,
        shape=shape,
        places=places,
        cells=np.stack(np.divmod(places, shape[1]), axis=1),
    )


class TaskParams(Params):
    """What fixes a task."""

    system: str = WORLD.choice(
        "grid", {"grid": "Grid world", "pendulum": "Pendulum"}, "World", effect="restart"
    )
    """A walk to the goal of the map below, or a pendulum that a weak motor swings up."""
    map: str = WORLD.text(MAPS["cliff"], "Map", rows=8)
    """S start, G goal, # wall, C cliff, . free; a last row of digits is wind, upwards."""
    brush: str = WORLD.choice(
        "G",
        {"G": "moves the goal", "S": "moves the start", "#": "walls up", "C": "makes cliff"},
        "A click on a cell",
        effect="live",
    )
    """And walls or cliff clicked once more are free again."""
    kings: bool = WORLD.toggle(False, "King's moves", effect="restart")
    """Diagonal steps too: eight controls instead of four."""
    slip: float = WORLD.knob(0.0, 0.0, 0.5, r"p_{slip}", "", "Slip", step=0.01)
    """Probability that a step on the grid goes wherever it likes."""
    gamma: float = WORLD.knob(1.0, 0.0, 1.0, r"\gamma", "", "Discount", step=0.01)
    """Of the next step's cost. The pendulum's task never ends: 0.99 at most there."""
    effort: float = WORLD.knob(0.05, 0.0, 1.0, "w_u", "1/(N·m)²", "Price of torque", scale="log")
    """In the pendulum's cost, dt (e² + 0.05 v² + w_u τ²)."""
    anywhere: bool = WORLD.toggle(False, "Start anywhere")
    """Episodes begin in any state instead of the start."""

    @field_validator("map")
    @classmethod
    def _is_a_map(cls, value: str) -> str:
        try:
            grid_world(value, False)
        except LabError as error:
            raise ValueError(str(error)) from None
        return value

    @property
    def task(self) -> Task:
        """What is to be learned."""
        if self.system == "pendulum":
            gamma = min(self.gamma, PATIENCE)
            return pendulum_task(gamma, self.effort, self.anywhere)
        return grid_task(self.map, self.kings, self.slip, self.gamma, self.anywhere)

    @property
    def world(self) -> GridWorld:
        """The map."""
        return grid_world(self.map, self.kings)
