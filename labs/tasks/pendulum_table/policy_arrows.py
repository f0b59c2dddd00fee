"""The policy of a pendulum's table as arrows on a map of the page (labs/plots.py, HeatMap)."""

import numpy as np

from labs.tasks.pendulum_table.table import PendulumGrid

ARROWS = 9
"""Along one side, at most."""


def torque_arrows(grid: PendulumGrid, policy: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """(k, 4): angle from upright [rad] and velocity [rad/s] of some nodes in `shown` (X,) bool, and
    the way right and up of an arrow: to the right by the torque of `policy` (X,), as a part of the
    largest; to the left where it is negative."""
    strides = [-(-n // ARROWS) for n in grid.shape]
    start = [n // 2 % stride for n, stride in zip(grid.shape, strides, strict=True)]
    some = np.arange(grid.X).reshape(grid.shape)
    some = some[start[0] :: strides[0], start[1] :: strides[1]].ravel()
    some = some[shown[some]]
    angle, velocity = np.unravel_index(some, grid.shape)
    torques = grid.torques[policy[some].astype(int), 0] / grid.torque
    places = [grid.angles[angle], grid.velocities[velocity]]
    return np.stack([*places, torques, np.zeros(len(some))], axis=1)
