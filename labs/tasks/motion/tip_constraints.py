"""Where a mechanism's tip may be, and where it has to end, in shooting, collocation and MPC to
come: outside of spheres,

    r^2 - |p(q) - m|^2 <= 0,    in parts of 2 r: near a sphere it is the depth [m]

and at a target, p(q) - p* = 0.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from labs.models.mechanisms import Mechanism


class Ball(NamedTuple):
    """A sphere: centre m (3,) and radius r [m]."""

    center: np.ndarray
    radius: float


@dataclass(frozen=True, eq=False)
class ObstacleConstraint:
    """g(x) <= 0, one for each ball."""

    mechanism: Mechanism
    balls: tuple[Ball, ...]

    @property
    def size(self) -> int:
        return len(self.balls)

    def values(self, X: np.ndarray) -> np.ndarray:
        """(k, size) [m]"""
        places = self.mechanism.tip_positions(X)
        gaps = [
            (ball.radius**2 - ((places - ball.center) ** 2).sum(axis=1)) / (2.0 * ball.radius)
            for ball in self.balls
        ]
        return np.stack(gaps, axis=1)

    def jacobians(self, X: np.ndarray) -> np.ndarray:
        """(k, size, nx)"""
        places, J = self.mechanism.tip_positions(X), tip_jacobians(self.mechanism, X)
        rows = [
            -np.einsum("ki,kij->kj", places - ball.center, J) / ball.radius for ball in self.balls
        ]
        return np.stack(rows, axis=1)

    def name(self, i: int) -> str:
        """What g_i says."""
        return f"the tip's distance from obstacle {i + 1}"


@dataclass(frozen=True, eq=False)
class TipTargetConstraint:
    """e(x) = p(q) - p*, for a tip that moves in all directions."""

    mechanism: Mechanism
    target: np.ndarray
    """p* (3,) [m]"""

    @property
    def size(self) -> int:
        return 3

    def values(self, X: np.ndarray) -> np.ndarray:
        """(k, 3) [m]"""
        return np.asarray(self.mechanism.tip_positions(X) - self.target)

    def jacobians(self, X: np.ndarray) -> np.ndarray:
        """(k, 3, nx)"""
        return tip_jacobians(self.mechanism, X)

    def name(self, i: int) -> str:
        """What e_i says."""
        return f"the tip's distance from its target along {'xyz'[i]}"


def tip_jacobians(mechanism: Mechanism, X: np.ndarray) -> np.ndarray:
    """(k, 3, nx): of p by the state."""
    found = np.zeros((len(X), 3, mechanism.nx))
    for J, x in zip(found, X, strict=True):
        J[:, : mechanism.nq] = mechanism.tip_jacobian(x[: mechanism.nq])
    return found
