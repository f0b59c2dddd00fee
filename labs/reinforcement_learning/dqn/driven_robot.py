"""A robot in the scene that is driven by a controller, and never stops."""

from dataclasses import dataclass, replace

import numpy as np

from labs.reinforcement_learning.dqn.controllers import Controller
from labs.reinforcement_learning.dqn.tasks import RobotTask

PATH_LENGTH = 320
"""Parts of steps whose states are kept: 4 s."""


@dataclass(frozen=True, eq=False)
class DrivenRobot:
    """Where it is. Arrays are never written into."""

    x: np.ndarray
    """(nx,)"""
    path: np.ndarray
    """(k, nx) the states it came through, the newest last."""
    torque: np.ndarray
    """(motors,) [N m] held."""
    clock: int = 0
    """Parts of the step done; 0: a decision is due."""


def initial_robot(task: RobotTask) -> DrivenRobot:
    """At rest, before the first decision."""
    return DrivenRobot(task.home, task.home[None], np.zeros(task.torques.shape[1]))


def advance_robot(task: RobotTask, controller: Controller, at: DrivenRobot) -> DrivenRobot:
    """A part of a step later."""
    if at.clock == 0:
        at = replace(at, torque=controller(at.x[None])[0])
    x = task.robot.integrate(at.x[None], at.torque[None], 1)[0]
    path = np.concatenate([at.path, x[None]])[-PATH_LENGTH:]
    return replace(at, x=x, path=path, clock=(at.clock + 1) % task.robot.substeps)


def apply_push(task: RobotTask, at: DrivenRobot, change: float) -> DrivenRobot:
    """With a first joint that is faster by so much [rad/s]."""
    x = at.x.copy()
    x[task.joints] += change
    return replace(at, x=x)


def set_target(at: DrivenRobot, posture: np.ndarray) -> DrivenRobot:
    """With a target of the reaching arm, as a posture (2,)."""
    x = at.x.copy()
    x[4:] = posture
    return replace(at, x=x)
