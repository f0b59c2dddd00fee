"""Swinging up and balancing, to be learned: pendulums whose motors choose among a few torques, for
deep Q-learning and Gymnasium.

A substep is v += a h, q += v h, and a step costs

    l = w_q' (q - q*)^2 + w_v' v^2 + w_u' u^2       of angles within half a turn of the goal q*

The pendulum's cost and its motor, too weak to lift it, are those of Gymnasium's Pendulum-v1; its
rod is half as long.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from labs.errors import LabError
from labs.models.mechanisms import Mechanism, mechanism
from labs.models.two_link import TwoLink, simulate_two_link, two_link
from labs.random_numbers import uniform
from labs.tasks.environments.torque_task import CONTROL_PERIOD, SUBSTEPS, TorqueTask

START_VELOCITY = 1.0
"""[rad/s] Episodes begin anywhere, at most this fast."""


@dataclass(frozen=True, eq=False)
class SwingUp(TorqueTask):
    """An `Environment`: x = (q, v), of revolute joints."""

    mechanism: Mechanism
    goal: np.ndarray
    """q* (nq,) [rad]"""
    torques: np.ndarray
    """(nu, number of motors) [N m]: the controls to choose from."""
    velocity_limit: np.ndarray
    """(nq,) [rad/s]: no joint gets faster."""
    weights: tuple[np.ndarray, np.ndarray, np.ndarray]
    """w_q (nq,), w_v (nq,), w_u (number of motors,)"""

    horizon = 200

    @property
    def nx(self) -> int:
        return self.mechanism.nx

    @property
    def observation_size(self) -> int:
        return 3 * self.mechanism.nq

    @cached_property
    def dynamics(self) -> TwoLink:
        """Of the mechanism."""
        return two_link(self.mechanism.model)

    def initial_states(self, random: np.ndarray, many: int) -> np.ndarray:
        n = self.mechanism.nq
        drawn = np.array([[uniform(random) for _ in range(2 * n)] for _ in range(many)])
        return np.asarray((2.0 * drawn - 1.0) * np.repeat([np.pi, START_VELOCITY], n))

    def observe(self, X: np.ndarray) -> np.ndarray:
        """cos and sin of each angle from the goal, and each velocity in parts of its limit."""
        n = self.mechanism.nq
        angle = X[:, :n] - self.goal
        parts = [np.cos(angle), np.sin(angle), X[:, n:] / self.velocity_limit]
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def cost(self, X: np.ndarray, torques: np.ndarray) -> np.ndarray:
        n, (w_q, w_v, w_u) = self.mechanism.nq, self.weights
        angle = np.remainder(X[:, :n] - self.goal + np.pi, 2.0 * np.pi) - np.pi
        return np.asarray(angle**2 @ w_q + X[:, n:] ** 2 @ w_v + torques**2 @ w_u)

    def integrate(self, X: np.ndarray, torques: np.ndarray, parts: int = SUBSTEPS) -> np.ndarray:
        body, h = self.dynamics, CONTROL_PERIOD / SUBSTEPS
        tau = torques @ self.mechanism.S.T
        return simulate_two_link(
            body.joints, body.inertia, body.gravity, X, tau, self.velocity_limit, h, parts
        )


SWING_UPS: Mapping[str, str] = {"pendulum": "Pendulum", "double-pendulum": "Double pendulum"}


def swing_up(name: str, levels: Sequence[float] | None = None) -> SwingUp:
    """The one of this name, a key of SWING_UPS; `levels` are those of each motor's torque, in
    parts of its limit. Raises LabError."""
    if name not in SWING_UPS:
        raise LabError(f"no swing-up is named {name!r}; there are {', '.join(SWING_UPS)}")
    if name == "pendulum":
        parts, limit, fastest = levels or (-1.0, -0.5, 0.0, 0.5, 1.0), np.array([2.0]), [12.0]
        goal, weights = [np.pi], ([1.0], [0.1], [0.001])
    else:
        parts, limit, fastest = levels or (-1.0, 0.0, 1.0), np.array([7.0, 3.0]), [10.0, 15.0]
        goal, weights = [np.pi, 0.0], ([1.0, 0.5], [0.05, 0.02], [0.0005, 0.0005])
    w_q, w_v, w_u = map(np.array, weights)
    torques = limit * np.array(list(product(parts, repeat=len(limit))))
    return SwingUp(mechanism(name), np.array(goal), torques, np.array(fastest), (w_q, w_v, w_u))
