"""Robots whose motors choose among a few torques (labs/tasks/environments), in Gymnasium.

    observation   what deep Q-learning's network is told, numbers of about one, float32
    action        the index of a torque, or of one for each motor
    reward        -l(x, u)
    info          "state": x, (nx,) [rad], [rad/s], in the order of the task

They step bit for bit as the lab's own; all chance is in where an episode begins.
"""

from typing import Any

import gymnasium
import numpy as np

from labs.problems.environment import Environment
from labs.random_numbers import random_states
from labs.tasks.environments.reach import JOINT_RANGES, VELOCITY_LIMIT, reach
from labs.tasks.environments.swing_up import swing_up
from labs.tasks.environments.torque_task import CONTROL_PERIOD

LARGEST_TIP_DISTANCE = 2.0
"""[m] Between two places of the UR5's tip at most."""


class TorqueEnv(gymnasium.Env[np.ndarray, np.int64]):
    """One robot of an `Environment`, whose observations lie within `limit` (o,)."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as Gymnasium has it

    def __init__(
        self, environment: Environment, limit: np.ndarray, render_mode: str | None
    ) -> None:
        self.environment = environment
        self.render_mode = render_mode
        limit = limit.astype(np.float32)
        self.observation_space = gymnasium.spaces.Box(-limit, limit, dtype=np.float32)
        self.action_space = gymnasium.spaces.Discrete(environment.control_count)
        self.X = np.zeros((1, environment.nx))
        """(1, nx) where it is."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """A start drawn anew, or the state (nx,) that `options` has under "state"."""
        super().reset(seed=seed)
        self.X = self.environment.initial_states(random_states(self.np_random, 1)[0], 1)
        if options and "state" in options:
            self.X = np.array(options["state"], float).reshape(1, self.environment.nx)
        return self._observation()

    def step(self, action: np.int64) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self.X, costs, ends = self.environment.step(self.X, np.array([action], np.int32))
        seen, info = self._observation()
        return seen, -float(costs[0]), bool(ends[0]), False, info

    def _observation(self) -> tuple[np.ndarray, dict[str, Any]]:
        return self.environment.observe(self.X)[0], {"state": self.X[0].copy()}


class _SwingUpEnv(TorqueEnv):
    name = ""

    def __init__(self, render_mode: str | None = None) -> None:
        environment = swing_up(self.name)
        super().__init__(environment, np.ones(environment.observation_size), render_mode)


class PendulumEnv(_SwingUpEnv):
    """Swing a pendulum up with a motor too weak to lift it: 5 torques, the cost of Gymnasium's
    Pendulum-v1."""

    name = "pendulum"


class DoublePendulumEnv(_SwingUpEnv):
    """Swing a double pendulum up: 3 torques at each of 2 motors."""

    name = "double-pendulum"


class UR5ReachEnv(TorqueEnv):
    """Reach a posture with a UR5's shoulder and elbow: 3 torques at each."""

    def __init__(self, render_mode: str | None = None) -> None:
        environment = reach()
        # As far as its joints get within an episode.
        farthest = (
            0.5 * np.ptp(JOINT_RANGES, axis=1)
            + VELOCITY_LIMIT * CONTROL_PERIOD * environment.horizon
        )
        limit = np.concatenate([farthest / np.pi, np.ones(2), np.full(4, LARGEST_TIP_DISTANCE)])
        super().__init__(environment, limit, render_mode)
