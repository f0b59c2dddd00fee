"""What is kept of the iterations, to be plotted and drawn."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from labs.algorithms.sqp import SqpIterate

KEPT_PATHS = 7
"""Iterations whose paths are drawn."""


@dataclass(frozen=True, eq=False)
class ShootingHistory:
    """Numbers of all iterations and the last paths. Arrays are never written into again."""

    cost: np.ndarray
    """(k + 1,) from the first guess on."""
    violation: np.ndarray
    """(k + 1,) the largest of the constraints"""
    residual: np.ndarray
    """(k,) of the conditions of optimality after each iteration."""
    alpha: np.ndarray
    """(k,) the step lengths."""
    paths: np.ndarray
    """(KEPT_PATHS, points, 3) [m] of the tip, the newest last."""

    @classmethod
    def start(cls, at: SqpIterate, path: np.ndarray) -> Self:
        """Of a first guess with its path (points, 3)."""
        none, paths = np.zeros(0), np.tile(path, (KEPT_PATHS, 1, 1))
        return cls(np.array([at.values.f]), np.array([at.violation]), none, none, paths)

    def append(self, at: SqpIterate, path: np.ndarray) -> Self:
        """One iteration later."""
        return type(self)(
            np.append(self.cost, at.values.f),
            np.append(self.violation, at.violation),
            np.append(self.residual, at.optimality.residual if at.optimality else 0.0),
            np.append(self.alpha, at.alpha),
            np.concatenate([self.paths[1:], path[None]]),
        )
