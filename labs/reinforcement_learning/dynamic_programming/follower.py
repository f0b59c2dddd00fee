"""Who follows the policy shown: a walker on the grid world, or the pendulum, from the start to the
goal (or to where the time is up), over and over."""

from dataclasses import dataclass, replace

import numpy as np

from labs.problems.finite_mdp import random_policy
from labs.reinforcement_learning.dynamic_programming.iteration_comparison import RANDOM_CONTROL
from labs.reinforcement_learning.dynamic_programming.tasks import TabularTask
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.walk import (
    GridWalk,
    advance_walk,
    choose_steps,
    is_valid_walk,
    start_walk,
)
from labs.tasks.pendulum_table.swing import (
    Swing,
    advance_swing,
    advance_unpowered,
    change_velocity,
    look_up_torques,
    start_swing,
)
from labs.tasks.pendulum_table.table import PendulumGrid

PERIOD = 0.01
"""[s]"""
MOVE, REST = 30, 100
"""Periods of a walker's step, and of a rest before it starts anew."""
MAX_WALK_STEPS = 120
"""Steps after which a walker starts anew, or as many as there are states."""
PUSH_VELOCITY = 4.0
"""[rad/s] that a push gives the pendulum."""


@dataclass(frozen=True, eq=False)
class PolicyFollower:
    """Where it is."""

    walk: GridWalk | Swing
    """Of one walker or pendulum."""
    draws: int = 0
    """Decisions and pushes since t = 0: with the seed, what their random numbers are drawn from."""
    resting: int = 0
    """Periods left until it starts anew."""


def start_follower(task: TabularTask, draws: int = 0) -> PolicyFollower:
    """At the start."""
    return PolicyFollower(_start(task), draws)


def follow_policy(
    task: TabularTask, follower: PolicyFollower, policy: np.ndarray | None, seed: int
) -> PolicyFollower:
    """One PERIOD [s] later. `policy` (X,) says what to do at the next decision; None: nothing is
    left to do."""
    if follower.resting == 1:
        return start_follower(task, follower.draws)
    if follower.resting:
        return _rest(task, follower, follower.resting - 1)
    if follower.walk.clock == 0:
        if policy is None or _is_over(task, follower.walk):
            return _rest(task, follower, REST)
        follower = _decide(task, follower, policy, seed)
    return replace(follower, walk=_advance(task, follower.walk))


def apply_push(task: TabularTask, follower: PolicyFollower, seed: int) -> PolicyFollower:
    """The pendulum gets PUSH_VELOCITY, a walker finds itself in some other cell."""
    if isinstance(follower.walk, Swing):
        return replace(follower, walk=change_velocity(follower.walk, PUSH_VELOCITY))
    assert isinstance(task.place, CellWorld)
    rng = np.random.default_rng((seed, follower.draws))
    x = int(rng.choice(np.flatnonzero(~task.mdp.terminal)))
    return PolicyFollower(start_walk(task.place, MOVE, start=x), follower.draws + 1)


def carry_over(task: TabularTask, follower: PolicyFollower) -> PolicyFollower:
    """The same on a task that has changed; at the start where its cells are no longer there."""
    place, walk = task.place, follower.walk
    if isinstance(place, CellWorld) and isinstance(walk, GridWalk):
        fits = is_valid_walk(place, walk)
    else:
        fits = isinstance(place, PendulumGrid) and isinstance(walk, Swing)
    return follower if fits else start_follower(task, follower.draws)


def _start(task: TabularTask) -> GridWalk | Swing:
    return start_walk(task.place, MOVE) if isinstance(task.place, CellWorld) else start_swing()


def _is_over(task: TabularTask, walk: GridWalk | Swing) -> bool:
    lost = isinstance(walk, GridWalk) and walk.steps >= max(MAX_WALK_STEPS, task.mdp.X)
    return lost or bool(task.mdp.terminal[task.state(walk.at[0])])


def _decide(
    task: TabularTask, follower: PolicyFollower, policy: np.ndarray, seed: int
) -> PolicyFollower:
    walk, place, mdp = follower.walk, task.place, task.mdp
    if isinstance(walk, Swing):
        assert isinstance(place, PendulumGrid)
        walk = look_up_torques(place, mdp, policy[None], walk)
    else:
        assert isinstance(place, CellWorld)
        rng = np.random.default_rng((seed, follower.draws))
        if policy[0] == RANDOM_CONTROL:
            own = np.flatnonzero(random_policy(mdp)[task.state(walk.at[0])])
            policy = np.full(mdp.X, own[rng.integers(len(own))])
        walk = choose_steps(place, mdp, policy[None], walk, rng.random)
    return replace(follower, walk=walk, draws=follower.draws + 1)


def _advance(task: TabularTask, walk: GridWalk | Swing) -> GridWalk | Swing:
    if isinstance(walk, GridWalk):
        return advance_walk(walk)
    assert isinstance(task.place, PendulumGrid)
    return advance_swing(task.place, walk, PERIOD)


def _rest(task: TabularTask, follower: PolicyFollower, resting: int) -> PolicyFollower:
    """For a period: a walker stands, the pendulum swings with its motor off."""
    walk = follower.walk
    if isinstance(walk, Swing):
        assert isinstance(task.place, PendulumGrid)
        walk = advance_unpowered(task.place, walk, PERIOD)
    return replace(follower, walk=walk, resting=resting)
