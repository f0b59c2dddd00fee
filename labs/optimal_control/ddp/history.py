"""What is kept of the iterations of a solver that improves a trajectory, to be plotted."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from labs.algorithms.ddp import DdpIterate

KEPT_PATHS, PATH_POINTS = 10, 60
"""Iterations whose paths are kept, and points of each."""


@dataclass(frozen=True)
class DdpHistory:
    """Numbers of all iterations, and the paths of the last KEPT_PATHS, the newest last. Arrays are
    never written into again."""

    cost: np.ndarray
    """(k + 1,) from the first guess on."""
    expected: np.ndarray
    """(k,) change of the cost, like all that follow up to the paths."""
    actual: np.ndarray
    alpha: np.ndarray
    mu: np.ndarray
    gradient: np.ndarray
    tip_paths: np.ndarray
    """(KEPT_PATHS, PATH_POINTS, 3) [m] of a robot's tip."""
    phase_paths: np.ndarray
    """(KEPT_PATHS, PATH_POINTS, 2) angle [rad] and velocity [rad/s] of a joint."""

    @classmethod
    def start(cls, at: DdpIterate, tip: np.ndarray, phase: np.ndarray, before: Self | None) -> Self:
        """Of a first guess, with its paths (PATH_POINTS, 3) and (PATH_POINTS, 2). The last paths
        of what was solved `before` stay in view."""
        none = np.zeros(0)
        last = (before.tip_paths[-1], before.phase_paths[-1]) if before else (tip, phase)
        rows = [np.tile(path, (KEPT_PATHS, 1, 1)) for path in last]
        cost = np.array([at.cost])
        return cls(
            cost,
            none,
            none,
            none,
            none,
            none,
            _append_row(rows[0], tip),
            _append_row(rows[1], phase),
        )

    def append(self, at: DdpIterate, tip: np.ndarray, phase: np.ndarray) -> Self:
        """One iteration later."""
        return type(self)(
            np.append(self.cost, at.cost),
            np.append(self.expected, at.expected),
            np.append(self.actual, at.actual),
            np.append(self.alpha, at.alpha),
            np.append(self.mu, at.mu),
            np.append(self.gradient, at.gradient),
            _append_row(self.tip_paths, tip),
            _append_row(self.phase_paths, phase),
        )


def subsample(rows: np.ndarray) -> np.ndarray:
    """PATH_POINTS of the rows, evenly from the first to the last."""
    return np.asarray(rows[np.linspace(0, len(rows) - 1, PATH_POINTS).round().astype(int)])


def _append_row(rows: np.ndarray, newest: np.ndarray) -> np.ndarray:
    """The rows moved up by one, the newest last."""
    return np.concatenate([rows[1:], newest[None]])
