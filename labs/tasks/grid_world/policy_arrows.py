"""The policy of a grid world as arrows on a map of the page (labs/plots.py, HeatMap)."""

import numpy as np

from labs.tasks.grid_world.map import GridWorld


def policy_arrows(world: GridWorld, policy: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """(k, 4): column and row from below, from 1, of the middle, and the way right and up. One for
    each state in `shown` (X,) bool that is not terminal; of a random policy (X, U), short ones for
    each control it may take."""
    shown = shown & ~world.terminal
    if policy.ndim == 1:
        states = np.flatnonzero(shown)
        controls, length, ahead = policy[states].astype(int), 1.0, 0.0
    else:
        states, controls = np.nonzero((policy > 0.0) & shown[:, None])
        length, ahead = 0.4, 0.25
    down, right = world.moves[controls].T
    ways = np.stack([right, -down], axis=1) / np.maximum(np.hypot(down, right), 1.0)[:, None]
    row, column = world.cells[states].T
    middles = np.stack([column + 1.0, world.shape[0] - row], axis=1)
    return np.hstack([middles + ahead * ways, length * ways])
