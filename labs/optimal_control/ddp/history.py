"""What is kept of the iterations of a solver that improves a trajectory, to be plotted."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from labs.algorithms.ddp import Iterate

KEPT, POINTS = 10, 60
"""Iterations whose paths are kept, and points of each."""


@dataclass(frozen=True)
class History:
    """Numbers of all iterations, and the paths of the last KEPT, the newest last. Arrays are
    never written into again."""

    cost: np.ndarray
    """(k + 1,) from the first guess on."""
    expected: np.ndarray
    """(k,) change of the cost, as all that follow up to the paths."""
    actual: np.ndarray
    alpha: np.ndarray
    mu: np.ndarray
    gradient: np.ndarray
    tips: np.ndarray
    """(KEPT, POINTS, 3) [m] of a robot's tip."""
    phases: np.ndarray
    """(KEPT, POINTS, 2) angle [rad] and velocity [rad/s] of a joint."""

    @classmethod
    def begun(cls, at: Iterate, tip: np.ndarray, phase: np.ndarray, before: Self | None) -> Self:
        """Of a first guess, with its paths (POINTS, 3) and (POINTS, 2). Of what was solved
        `before`, the last paths stay in view."""
        none = np.zeros(0)
        last = (before.tips[-1], before.phases[-1]) if before else (tip, phase)
        rows = [np.tile(path, (KEPT, 1, 1)) for path in last]
        cost = np.array([at.cost])
        return cls(
            cost, none, none, none, none, none, _newest(rows[0], tip), _newest(rows[1], phase)
        )

    def after(self, at: Iterate, tip: np.ndarray, phase: np.ndarray) -> Self:
        """One iteration later."""
        return type(self)(
            np.append(self.cost, at.cost),
            np.append(self.expected, at.expected),
            np.append(self.actual, at.actual),
            np.append(self.alpha, at.alpha),
            np.append(self.mu, at.mu),
            np.append(self.gradient, at.gradient),
            _newest(self.tips, tip),
            _newest(self.phases, phase),
        )


def spread(rows: np.ndarray) -> np.ndarray:
    """POINTS of the rows, evenly from the first to the last."""
    return np.asarray(rows[np.linspace(0, len(rows) - 1, POINTS).round().astype(int)])


def _newest(rows: np.ndarray, newest: np.ndarray) -> np.ndarray:
    """The rows moved up by one, the newest last."""
    return np.concatenate([rows[1:], newest[None]])
