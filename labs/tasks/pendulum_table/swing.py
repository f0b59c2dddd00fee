"""Pendulums of one rod that swing under torques looked up in a table, one or several side by side.

A pendulum moves by its equation of motion, not by its table: every dt its state is looked up at the
nearest node, and the torque that its policy has there is held.
"""

from dataclasses import dataclass, replace

import numpy as np

from labs.problems.finite_mdp import FiniteMDP
from labs.tasks.pendulum_table.table import PendulumGrid, integrate_pendulum

PATH_LENGTH = 300
"""States kept of a motion."""


@dataclass(frozen=True, eq=False)
class Swing:
    """Where M pendulums are. Its arrays are never written into."""

    at: np.ndarray
    """(M, 2): angle q [rad] and velocity v [rad/s]."""
    to: np.ndarray
    """(M, 2): the node where the table has it at the next decision; `at` where that is due."""
    torque: np.ndarray
    """(M,) [N m] held."""
    cost: np.ndarray
    """(M,) discounted cost since the start."""
    path: np.ndarray
    """(k, M, 2): the states since the start, the last PATH_LENGTH of them."""
    steps: int = 0
    """Decisions since the start."""
    clock: int = 0
    """Periods since the last decision; 0: the next one is due."""


def start_swing(pendulums: int = 1) -> Swing:
    """Hanging at rest, before the first decision."""
    at, none = np.zeros((pendulums, 2)), np.zeros(pendulums)
    return Swing(at, at, none, none, at[None])


def look_up_torques(
    grid: PendulumGrid, mdp: FiniteMDP, policies: np.ndarray, swing: Swing
) -> Swing:
    """The decision that is due. `policies` (M, X) holds each pendulum's controls."""
    states = grid.state(swing.at[:, :1], swing.at[:, 1:])
    controls = np.array([policy[x] for policy, x in zip(policies, states, strict=True)], int)
    return replace(
        swing,
        to=grid.nodes[mdp.successors[states, controls]],
        torque=grid.torques[controls, 0],
        cost=swing.cost + mdp.gamma**swing.steps * mdp.C[states, controls],
        steps=swing.steps + 1,
    )


def advance_swing(grid: PendulumGrid, swing: Swing, period: float) -> Swing:
    """One period [s] later."""
    return _integrate(grid, swing, period, (swing.clock + 1) % round(grid.dt / period))


def advance_unpowered(grid: PendulumGrid, swing: Swing, period: float) -> Swing:
    """One period [s] later, the motors off; a decision is due then."""
    return _integrate(grid, replace(swing, torque=np.zeros(len(swing.at))), period, 0)


def change_velocity(swing: Swing, change: float) -> Swing:
    """With another velocity, by so much [rad/s]."""
    at = swing.at + np.array([0.0, change])
    return replace(swing, at=at, to=at)


def _integrate(grid: PendulumGrid, swing: Swing, period: float, clock: int) -> Swing:
    q, v = integrate_pendulum(
        swing.at[:, :1], swing.at[:, 1:], swing.torque[:, None], grid.friction, period
    )
    at = np.concatenate([q, v], axis=1)
    path = np.concatenate([swing.path, at[None]])[-PATH_LENGTH:]
    return replace(swing, at=at, to=swing.to if clock else at, path=path, clock=clock)
