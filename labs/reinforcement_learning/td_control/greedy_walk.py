"""What is learned, at work in the scene: walkers on a grid world, or pendulums, that follow the
greedy policies of the moment from the start, over and over."""

import numpy as np

from labs.random_numbers import uniform
from labs.reinforcement_learning.td_control.tasks import ControlTask
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.walk import GridWalk, advance_walk, choose_steps, start_walk
from labs.tasks.pendulum_table.swing import Swing, advance_swing, look_up_torques, start_swing

PERIOD = 0.01
"""[s]"""
MOVE = 20
"""Periods of a walker's step."""
LONGEST_WALK, LONGEST_SWING = 100, 80
"""Decisions after which all start anew; walkers after as many as there are states, if more."""
REST = 5
"""Decisions that walkers rest at the goal."""


def start_greedy_walk(task: ControlTask, many: int) -> GridWalk | Swing:
    """All at the start, before the first decision."""
    if isinstance(task.place, CellWorld):
        return start_walk(task.place, MOVE, many)
    return start_swing(many)


def follow_greedy_policies(
    task: ControlTask, policies: np.ndarray, walk: GridWalk | Swing, random: np.ndarray
) -> GridWalk | Swing:
    """One PERIOD later. `policies` (M, X) holds each one's controls; `random` (4,) uint64, of the
    steps' outcomes, changes in place."""
    place, mdp = task.place, task.mdp
    if isinstance(place, CellWorld):
        assert isinstance(walk, GridWalk)
        if walk.clock == 0:
            if walk.steps >= max(LONGEST_WALK, mdp.X) or walk.idle >= REST:
                walk = start_walk(place, MOVE, len(policies))
            walk = choose_steps(place, mdp, policies, walk, lambda: uniform(random))
        return advance_walk(walk)
    assert isinstance(walk, Swing)
    if walk.clock == 0:
        if walk.steps >= LONGEST_SWING:
            walk = start_swing(len(policies))
        walk = look_up_torques(place, mdp, policies, walk)
    return advance_swing(place, walk, PERIOD)
