"""What moves in the scene while learners learn: a walker from state to state, or a pendulum."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from labs.problems.finite_mdp import FiniteMDP
from labs.problems.prediction import PredictionTask, sample_step
from labs.random_numbers import random_integer
from labs.tasks.pendulum_table.swing import Swing, advance_swing, look_up_torques, start_swing
from labs.tasks.pendulum_table.table import PendulumGrid

PERIOD = 0.01
"""[s]"""
WALKER_PERIODS = 20
"""Periods of a walker's step."""
MAX_DECISIONS, REST = 80, 10
"""Decisions after which a pendulum starts anew; that it stays where it was caught."""


@dataclass(frozen=True, eq=False)
class PolicyMotion:
    """Its arrays are never written into."""

    place: int
    """The state of the walker; -1 before it starts."""
    swing: Swing
    """The pendulum."""
    random: np.ndarray
    """(4,) uint64"""
    clock: int = 0
    """Periods since the walker's last step."""


def initial_motion(random: np.ndarray) -> PolicyMotion:
    """Before anything moves."""
    return PolicyMotion(-1, start_swing(), random)


def advance_walker(task: PredictionTask, motion: PolicyMotion) -> PolicyMotion:
    """A period later: a step of the policy that is followed, every now and then."""
    if motion.place >= 0 and motion.clock + 1 < WALKER_PERIODS:
        return replace(motion, clock=motion.clock + 1)
    random, here = motion.random.copy(), motion.place
    if here < 0 or task.task.terminal[here]:
        starts = task.task.starts
        place = int(starts[random_integer(random, len(starts))])
    else:
        _, place = sample_step(task, here, random)
    return replace(motion, place=place, random=random, clock=0)


def advance_pendulum(
    grid: PendulumGrid, mdp: FiniteMDP, policy: Callable[[], np.ndarray], motion: PolicyMotion
) -> PolicyMotion:
    """A period later, from hanging at rest, torques by a policy (X,) that is asked for when due."""
    swing = motion.swing
    if swing.clock == 0:
        swing = start_swing() if swing.steps >= MAX_DECISIONS else swing
        swing = look_up_torques(grid, mdp, policy()[None], swing)
    return replace(motion, swing=advance_swing(grid, swing, PERIOD))


def advance_pendulum_to_goal(
    grid: PendulumGrid, mdp: FiniteMDP, policy: np.ndarray, starts: np.ndarray, motion: PolicyMotion
) -> PolicyMotion:
    """The same from any of `starts` until a terminal state, where it is held for a while."""
    swing = motion.swing
    if swing.clock == 0:
        node = int(grid.state(swing.at[:, :1], swing.at[:, 1:])[0])
        caught = bool(mdp.terminal[node])
        waited = motion.clock + 1 if caught else 0
        if motion.place < 0 or waited > REST or swing.steps >= MAX_DECISIONS:
            random = motion.random.copy()
            place = int(starts[random_integer(random, len(starts))])
            at, none = grid.nodes[place][None], np.zeros(1)
            swing = Swing(at, at, none, none, at[None])
            motion = replace(motion, place=place, random=random, clock=0)
        elif caught:
            still = np.array([[swing.at[0, 0], 0.0]])
            swing = replace(swing, at=still, to=still, torque=np.zeros(1))
            return replace(motion, swing=swing, clock=waited)
        swing = look_up_torques(grid, mdp, policy[None], swing)
    return replace(motion, swing=advance_swing(grid, swing, PERIOD))
