"""The minimal robust positively invariant set of x+ = A x + w, w in W (notes, 2.5.5), from outside.

Where A is stable, the states that disturbances can reach from the origin fill

    F = W + A W + A^2 W + ...          (Minkowski sums)

the smallest set that A and W cannot leave. It seldom has finitely many corners; a partial sum F_s
is not invariant, but a scaled one is: with A^s W inside alpha W and alpha < 1,

    S = F(alpha, s) = (W + A W + ... + A^(s-1) W) / (1 - alpha)

is invariant and contains F. No point of S is farther than alpha M / (1 - alpha) from F in the
maximum norm, with M the largest |x_i| in F_s: s grows until that is at most what was asked for.

S. V. Rakovic, E. C. Kerrigan, K. I. Kouramas, D. Q. Mayne, "Invariant approximations of the
minimal robust positively invariant set", IEEE TAC 50, 2005 (algorithm 1).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from labs.algorithms import polytopes
from labs.algorithms.polygons import (
    UnboundedError,
    minkowski_sum,
    polyhedron_from_vertices,
    support_of_points,
    vertices,
)
from labs.errors import LabError
from labs.problems.polyhedron import Polyhedron

MAX_TERMS = 1000
"""Of the sum; slower contractions are refused."""


@dataclass(frozen=True, eq=False)
class RobustInvariantSet:
    """S = (W + A W + ... + A^(s-1) W) / (1 - alpha), with A S + W inside S."""

    A: np.ndarray
    """(n, n), stable."""
    W: Polyhedron
    s: int
    alpha: float
    """Least one with A^s W inside alpha W."""
    error: float
    """No point of S is farther from the minimal set, in the maximum norm."""

    def support(self, directions: np.ndarray) -> np.ndarray:
        """max d' x over x in S for each row d of directions (k, n): (k,)."""
        total, d, W = (
            np.zeros(len(directions)),
            np.asarray(directions, float),
            _support_function(self.W),
        )
        for _ in range(self.s):
            total += W(d)
            d = d @ self.A
        return np.asarray(total / (1.0 - self.alpha))

    def polygon(self) -> np.ndarray:
        """The corners (k, 2) of S in the plane, counter-clockwise. Raises LabError elsewhere."""
        term = corners = vertices(self.W)
        for _ in range(1, self.s):
            term = term @ self.A.T
            corners = minkowski_sum(corners, term)
        return np.asarray(corners / (1.0 - self.alpha))

    def polyhedron(self) -> Polyhedron:
        """S in the plane by its edges. Raises LabError elsewhere."""
        return polyhedron_from_vertices(self.polygon())


def robust_invariant_set(A: np.ndarray, W: Polyhedron, error: float) -> RobustInvariantSet:
    """The set within `error` of the minimal one with the fewest terms. Raises LabError where A
    (n, n) is not stable or contracts too slowly, where W is not bounded, or where the origin is
    not in its interior."""
    n = len(A)
    if not W.h.min(initial=np.inf) > 0.0:
        raise LabError("the origin must lie inside the set of disturbances W, not on its boundary")
    radius = float(np.abs(np.linalg.eigvals(A)).max())
    if not radius < 1.0:
        raise LabError(
            f"the spectral radius of A is {radius:.3g}, not below 1: disturbances add up without "
            "end; choose a gain K that stabilises"
        )
    try:
        support = _support_function(W)
    except UnboundedError:
        raise LabError("the set of disturbances W must be bounded") from None
    axes = np.vstack([np.eye(n), -np.eye(n)])
    if not np.isfinite(support(axes)).all():
        raise LabError("the set of disturbances W must be bounded")
    extent, power = np.zeros(2 * n), np.eye(n)
    for s in range(1, MAX_TERMS + 1):
        extent += support(axes @ power)
        power = A @ power
        alpha = float((support(W.H @ power) / W.h).max())
        M = float(extent.max())
        if alpha * M <= error * (1.0 - alpha):
            return RobustInvariantSet(A, W, s, alpha, alpha * M / (1.0 - alpha))
    raise LabError(
        f"with a spectral radius of {radius:.4g} it takes more than {MAX_TERMS} terms to come "
        f"within {error:.3g} of the minimal set: choose a gain K that contracts faster"
    )


def _support_function(W: Polyhedron) -> Callable[[np.ndarray], np.ndarray]:
    """max d' w over w in W for each row d: from its corners in the plane, else by linear
    programmes."""
    if W.n == 2:
        return partial(support_of_points, vertices(W))
    return partial(polytopes.support, W)
