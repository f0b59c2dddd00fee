"""What is learned, at work in the scene: walkers on a grid world, or pendulums, that follow the
greedy policies of the moment from the start, over and over.

A walker takes a cell every MOVE. A pendulum swings by its equation of motion, not by its table:
every dt its state is looked up at the nearest node and the torque found there is held."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from labs.problems.episodes import transition
from labs.reinforcement_learning.td_control.tasks import PENDULUM, Task
from labs.tasks.pendulum_table.table import advance

PERIOD = 0.01
"""[s]"""
MOVE = 0.2
"""[s]"""
LONGEST = {"grid": 100, "pendulum": 80}
"""Decisions after which a walk starts anew."""
REST = 5
"""Decisions a walker rests at the goal."""


@dataclass(frozen=True)
class Walk:
    """One walk of each of M policies."""

    at: np.ndarray
    """(M, 2) grid: row and column; pendulum: q [rad] and v [rad/s]."""
    to: np.ndarray
    """(M, 2) grid: where the present step leads; pendulum: the torque held [N m], and 0."""
    paid: np.ndarray
    """(M,) discounted cost so far."""
    luck: np.ndarray
    """(4,) uint64: of the steps' outcomes."""
    decisions: int = 0
    idle: int = 0
    """Decisions since all arrived."""
    clock: int = 0
    """Periods since the last decision."""


def set_out(system: str, task: Task, many: int, luck: np.ndarray) -> Walk:
    """At the start, before the first decision."""
    start = np.zeros(2) if system == "pendulum" else task.cells[task.start].astype(float)
    at = np.tile(start, (many, 1))
    return Walk(at, np.zeros_like(at) if system == "pendulum" else at, np.zeros(many), luck)


def pause(system: str) -> int:
    """Periods from one decision to the next."""
    return round((PENDULUM.dt if system == "pendulum" else MOVE) / PERIOD)


def walked(system: str, task: Task, policies: Sequence[np.ndarray], walk: Walk) -> Walk:
    """One PERIOD later. `policies` has (X,) controls for each walker."""
    if walk.clock == 0:
        if walk.decisions >= LONGEST[system] or walk.idle >= REST:
            walk = set_out(system, task, len(policies), walk.luck)
        walk = _decided(system, task, policies, walk)
    clock = (walk.clock + 1) % pause(system)
    if system == "pendulum":
        q, v = walk.at[:, :1], walk.at[:, 1:]
        q, v = advance(q, v, walk.to[:, :1], PENDULUM.friction, PERIOD)
        return replace(walk, at=np.concatenate([q, v], axis=1), clock=clock)
    return replace(walk, at=walk.at if clock else walk.to, clock=clock)


def _decided(system: str, task: Task, policies: Sequence[np.ndarray], walk: Walk) -> Walk:
    at, to, paid, luck = walk.at.copy(), walk.to.copy(), walk.paid.copy(), walk.luck.copy()
    discount = task.mdp.gamma**walk.decisions
    arrived = True
    for m, policy in enumerate(policies):
        x = _state(system, task, at[m])
        u = int(policy[x])
        paid[m] += discount * task.mdp.C[x, u]
        if system == "pendulum":
            to[m, 0], arrived = PENDULUM.torques[u, 0], False
        else:
            at[m] = task.cells[x]
            to[m] = task.cells[transition(task.trial, x, u, luck)]
            arrived = arrived and bool(task.mdp.terminal[x])
    idle = walk.idle + 1 if arrived else 0
    return replace(
        walk, at=at, to=to, paid=paid, luck=luck, decisions=walk.decisions + 1, idle=idle
    )


def _state(system: str, task: Task, at: np.ndarray) -> int:
    """The state of a walker. Where the map was changed under it, it is back at the start."""
    if system == "pendulum":
        return int(PENDULUM.state(at[:1], at[1:]))
    row, column = at.astype(int)
    rows, columns = task.shape
    x = int(task.index[row, column]) if row < rows and column < columns else -1
    return task.start if x < 0 else x
