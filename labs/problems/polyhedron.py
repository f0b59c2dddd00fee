"""Sets of states or controls given by linear inequalities, in linear MPC and its invariant sets
(notes, 2.5.2)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labs.errors import LabError


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """{x in R^n : H x <= h}; with no rows, all of R^n. Raises LabError where shapes do not fit or
    numbers are not finite."""

    H: np.ndarray
    """(k, n)"""
    h: np.ndarray
    """(k,)"""

    def __post_init__(self) -> None:
        if np.ndim(self.H) != 2 or np.shape(self.h) != (len(self.H),):
            raise LabError(
                f"H has shape {np.shape(self.H)} and h {np.shape(self.h)}: a polyhedron takes "
                "(k, n) and (k,)"
            )
        if not (np.isfinite(self.H).all() and np.isfinite(self.h).all()):
            raise LabError("a polyhedron takes finite numbers: leave out a row that limits nothing")

    @property
    def n(self) -> int:
        return int(self.H.shape[1])

    def contains(self, X: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
        """Whether each of the points X (..., n) meets H x <= h + tolerance."""
        return np.asarray((self.h + tolerance >= X @ self.H.T).all(axis=-1))

    def intersection(self, other: "Polyhedron") -> "Polyhedron":
        """What is in both; redundant rows stay."""
        return Polyhedron(np.vstack([self.H, other.H]), np.concatenate([self.h, other.h]))

    def preimage(self, M: np.ndarray) -> "Polyhedron":
        """{x : M x in this one}, of M (n, k)."""
        return Polyhedron(self.H @ M, self.h)


def box(lower: Sequence[float] | np.ndarray, upper: Sequence[float] | np.ndarray) -> Polyhedron:
    """{x : lower <= x <= upper}; a bound that is infinite limits nothing."""
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    eye = np.eye(len(low))
    H, h = np.vstack([eye, -eye]), np.concatenate([high, -low])
    limits = np.isfinite(h)
    return Polyhedron(H[limits], h[limits])
