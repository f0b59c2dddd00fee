"""What is predicted in the lab of TD(lambda): the walk of 19 states and its value, and a grid world
under a policy that takes the best control, but now and then any."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from labs.algorithms import policy_iteration
from labs.algorithms.policy_evaluation import exact_values, expected_visits
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.problems.prediction import PredictionTask, prediction_task, weighted_error
from labs.tasks.grid_world.map import GridWorld, grid_world
from labs.tasks.random_walk.walks import MAX_STEPS, NINETEEN_STATE_WALK, walk_mdp

GRID_HORIZON = 1000
"""Steps after which an episode on a grid is cut."""


@dataclass(frozen=True, eq=False)
class PredictionPlace:
    """Where a policy is followed, and what it costs there."""

    task: PredictionTask
    world: GridWorld | None
    """The grid world; None: the walk."""
    mean_steps: float
    """Of an episode, on average, if none is cut."""
    about: tuple[str, ...]
    """How large it is, and what of a map was understood otherwise than written, in sentences."""

    @property
    def start(self) -> int:
        """The state every episode begins in."""
        return int(self.task.task.starts[0])

    @property
    def nonterminal(self) -> np.ndarray:
        """(X,) bool: the states that are not terminal."""
        return ~self.task.task.terminal

    @property
    def initial_error(self) -> float:
        """The error of V = 0."""
        return float(weighted_error(self.task, np.zeros(len(self.task.truth))))

    @property
    def scale(self) -> float:
        """The largest cost-to-go, in magnitude; at least 1."""
        return float(max(1.0, np.abs(self.task.truth).max()))


@lru_cache(maxsize=8)
def walk_place(gamma: float) -> PredictionPlace:
    """The even walk; the error counts all 19 states alike, as in the book."""
    free = walk_mdp(NINETEEN_STATE_WALK)
    mdp = FiniteMDP(free.C, gamma, free.terminal, successor=free.successor)
    policy, start = random_policy(mdp), NINETEEN_STATE_WALK.start
    task = prediction_task(mdp, policy, exact_values(mdp, policy), [start], MAX_STEPS)
    steps = float(expected_visits(mdp, policy, start).sum())
    return PredictionPlace(task, None, steps, (mdp.describe([start]),))


@lru_cache(maxsize=16)
def grid_place(text: str, wander: float, gamma: float) -> PredictionPlace:
    """From S to G; with probability `wander` a step takes any control. The error of a state counts
    as often as an episode comes by: what is never seen cannot be learned."""
    world = grid_world(text, False)
    mdp = world.mdp(gamma)
    _, best, _ = policy_iteration.optimum(world.mdp(1.0), np.zeros(mdp.X, np.int64))
    policy = (1.0 - wander) * np.eye(mdp.U)[best] + wander / mdp.U
    visits = expected_visits(mdp, policy, world.start)
    task = prediction_task(
        mdp, policy, exact_values(mdp, policy), [world.start], GRID_HORIZON, weight=visits
    )
    about = (mdp.describe([world.start]), *world.notes)
    return PredictionPlace(task, world, float(visits.sum()), about)
