"""Finite MDPs as Gymnasium environments: grid worlds and random walks.

    observation   the number of the state x
    action        the number of the control u
    reward        -C(x, u)

They draw their transitions as the labs' learners do (labs/problems/episodes.py).
"""

from typing import Any

import gymnasium
import numpy as np

from labs.problems.episodes import episodic_task, initial_state, transition
from labs.problems.finite_mdp import FiniteMDP
from labs.random_numbers import random_states
from labs.tasks.grid_world.map import MAPS, STEP_COST, grid_world
from labs.tasks.random_walk.walks import WalkShape, walk_mdp


class TableEnv(gymnasium.Env[np.int64, np.int64]):
    """Episodes of an MDP from the state `start`."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as Gymnasium has it

    def __init__(self, mdp: FiniteMDP, start: int, render_mode: str | None) -> None:
        self.mdp = mdp
        self.render_mode = render_mode
        self.observation_space = gymnasium.spaces.Discrete(mdp.X)
        self.action_space = gymnasium.spaces.Discrete(mdp.U)
        self.task = episodic_task(mdp, [start], 0)
        self.x = start
        self.random = np.ones(4, np.uint64)
        """(4,) the generator of an episode's transitions."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.int64, dict[str, Any]]:
        """At the start, or in the state that `options` has under "state"."""
        super().reset(seed=seed)
        self.random = random_states(self.np_random, 1)[0]
        self.x = initial_state(self.task, self.random)
        if options and "state" in options:
            self.x = int(options["state"])
        return np.int64(self.x), {}

    def step(self, action: np.int64) -> tuple[np.int64, float, bool, bool, dict[str, Any]]:
        cost = float(self.mdp.C[self.x, action])
        self.x = transition(self.task, self.x, int(action), self.random)
        return np.int64(self.x), -cost, bool(self.mdp.terminal[self.x]), False, {}


class GridWorldEnv(TableEnv):
    """A walk to the goal of a map, named or written a row a line (labs/tasks/grid_world/map.py).
    With probability `slip` a step goes elsewhere, anywhere or `sideways`; each costs `living`.
    Raises LabError for what is no map."""

    def __init__(
        self,
        map: str = "4x4",
        kings: bool = False,
        slip: float = 0.0,
        sideways: bool = False,
        living: float = STEP_COST,
        render_mode: str | None = None,
    ) -> None:
        self.world = grid_world(MAPS.get(map, map), kings)
        super().__init__(self.world.mdp(1.0, slip, sideways, living), self.world.start, render_mode)


class RandomWalkEnv(TableEnv):
    """A line of states between two ends that cost `left` and `right`; a control is a jump of 1 to
    `reach` states to the left or right, the longest to the left first. Its walk is random where
    controls are."""

    def __init__(
        self,
        states: int = 19,
        left: float = 1.0,
        right: float = -1.0,
        reach: int = 1,
        render_mode: str | None = None,
    ) -> None:
        walk = WalkShape(states, left, right, reach)
        super().__init__(walk_mdp(walk), walk.start, render_mode)
