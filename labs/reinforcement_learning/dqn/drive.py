"""A robot in the scene that is driven by a controller, and never stops."""

from dataclasses import dataclass, replace

import numpy as np

from labs.reinforcement_learning.dqn.controllers import Controller
from labs.reinforcement_learning.dqn.tasks import RobotTask

PATH = 320
"""Parts of steps whose states are kept: 4 s."""


@dataclass(frozen=True, eq=False)
class Drive:
    """Where it is. Arrays are never written into."""

    x: np.ndarray
    """(nx,)"""
    path: np.ndarray
    """(k, nx) the states it came through, the newest last."""
    torque: np.ndarray
    """(motors,) [N m] held."""
    clock: int = 0
    """Parts of the step done; 0: a decision is due."""


def begin(task: RobotTask) -> Drive:
    """At rest, before the first decision."""
    return Drive(task.home, task.home[None], np.zeros(task.torques.shape[1]))


def drive(task: RobotTask, controller: Controller, at: Drive) -> Drive:
    """A part of a step later."""
    if at.clock == 0:
        at = replace(at, torque=controller(at.x[None])[0])
    x = task.robot.hold(at.x[None], at.torque[None], 1)[0]
    path = np.concatenate([at.path, x[None]])[-PATH:]
    return replace(at, x=x, path=path, clock=(at.clock + 1) % task.robot.substeps)


def push(task: RobotTask, at: Drive, change: float) -> Drive:
    """With a first joint that is faster by so much [rad/s]."""
    x = at.x.copy()
    x[task.joints] += change
    return replace(at, x=x)


def aim(at: Drive, posture: np.ndarray) -> Drive:
    """With a target of the reaching arm, as a posture (2,)."""
    x = at.x.copy()
    x[4:] = posture
    return replace(at, x=x)
