"""A convex model for an SQP step with exact second derivatives (beyond the notes). The Hessian H of
the Lagrangian need be positive definite only along the constraints, A p = -c with A = c_y. So

    P = theta H + (1 - theta) H_GN + rho (A' A + D) + delta I

with H_GN the Hessian of f alone by Gauss-Newton, never indefinite, and D the identity over what
rests at a bound. The rho term is constant for all steps that meet the constraints and stay at
their bounds: it changes multipliers, lam by -rho A p, and not the step. Where H curves upward
along the constraints, as it does near a minimum, theta = 1 and the step is Newton's own; else
theta is as near to 1 as is convex, and only where not even theta = 0 is convex, as without any
cost on the way, delta is raised. Definiteness is found out by a Cholesky factorisation of P as a
band matrix, its last variable apart where that one meets all others, as a free final time does.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.sparse import csc_array, diags_array

RHO_FACTOR, RHO_LIMIT = 10.0, 1e8
"""By what rho grows; the most it may be in parts of what makes A'A as large as H."""
BISECTIONS, SAFETY = 4, 0.75
"""Of theta; how much of the largest one is used, since there P is singular."""
DELTA_FACTOR, DELTA_LIMIT = 5.0, 1e8
MIN_DELTA = 1e-4
"""In parts of the size of H, as the limit."""
MARGIN = 1e-6
"""P stays positive definite with this part of H's size taken from its diagonal."""


class ConvexModel(NamedTuple):
    """P, and how it came about."""

    P: csc_array
    theta: float = 1.0
    rho: float = 0.0
    delta: float = 0.0


def convexify(
    H: csc_array,
    gauss_newton: csc_array,
    A: csc_array,
    at_bounds: np.ndarray,
    least_size: float,
    delta: float,
    most: float = 1.0,
) -> ConvexModel | None:
    """With as little change as suffices. `at_bounds` (n,): what rests at a bound; `least_size` is
    that of H where it vanishes, `delta` what was needed last, and `most` the largest theta wanted.
    None where the limit of delta does not suffice."""
    size = max(_median_nonzero(np.abs(H.diagonal())), least_size)
    margin = MARGIN * size
    if most == 1.0 and is_positive_definite(H, margin):
        return ConvexModel(H)
    n = len(at_bounds)
    square = csc_array(A.T @ A + diags_array(at_bounds.astype(float), format="csc"))
    like = _median_nonzero(square.diagonal())
    unit = size / like if like > 0.0 else 0.0
    one, (h, g, s, identity) = _align_patterns(
        H, gauss_newton, square, diags_array(np.ones(n)).tocsc()
    )

    def combined_hessian(theta: float, rho: float, delta: float = 0.0) -> np.ndarray:
        return np.asarray(theta * h + (1.0 - theta) * g + rho * s + delta * identity)

    def is_convex(data: np.ndarray) -> bool:
        return one.is_positive_definite(data, margin)

    def convex_at(theta: float) -> bool:
        return is_convex(combined_hessian(theta, RHO_LIMIT * unit))

    theta = most
    if not convex_at(most):
        low, high = 0.0, most
        if convex_at(0.0):
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if convex_at(middle) else (low, middle)
        else:
            delta = max(delta / DELTA_FACTOR, MIN_DELTA * size)
            while delta <= DELTA_LIMIT * size:
                data = combined_hessian(0.0, unit, delta)
                if is_convex(data):
                    return ConvexModel(one.matrix(data), 0.0, unit, delta)
                delta *= DELTA_FACTOR
            return None
        theta = SAFETY * low
    rho = unit
    while rho < RHO_LIMIT * unit and not is_convex(combined_hessian(theta, rho)):
        rho *= RHO_FACTOR
    return ConvexModel(one.matrix(combined_hessian(theta, rho)), theta, rho)


def is_positive_definite(P: csc_array, margin: float) -> bool:
    """Whether P - margin I is, by its Cholesky factor."""
    return _Pattern(P.indices, P.indptr).is_positive_definite(P.data, margin)


class _Pattern:
    """Of a symmetric sparse matrix, whose values are given apart."""

    def __init__(self, indices: np.ndarray, indptr: np.ndarray) -> None:
        self.indices, self.indptr = indices, indptr
        self.n = n = len(indptr) - 1
        columns = np.repeat(np.arange(n), np.diff(indptr))
        self._border = np.flatnonzero(columns == n - 1)
        self._apart = n > 2 and len(self._border) > n // 2
        self._inner = n - 1 if self._apart else n
        self._below = np.flatnonzero((indices >= columns) & (indices < self._inner))
        self._columns = columns[self._below]
        self._diagonals = indices[self._below] - self._columns
        self._width = int(self._diagonals.max(initial=0))

    def matrix(self, data: np.ndarray) -> csc_array:
        """With these values."""
        return csc_array((data, self.indices, self.indptr), shape=(self.n, self.n))

    def is_positive_definite(self, data: np.ndarray, margin: float) -> bool:
        """Of the matrix with these values, less the margin on its diagonal."""
        band = np.zeros((self._width + 1, self._inner))
        band[self._diagonals, self._columns] = data[self._below]
        band[0] -= margin
        try:
            factor = cholesky_banded(band, lower=True, check_finite=False)
        except LinAlgError:
            return False
        if not self._apart:
            return True
        last = np.zeros(self.n)
        last[self.indices[self._border]] = data[self._border]
        solved = cho_solve_banded((factor, True), last[:-1], check_finite=False)
        return bool(last[-1] - margin > last[:-1] @ solved)


def _align_patterns(*matrices: csc_array) -> tuple[_Pattern, list[np.ndarray]]:
    """A pattern that holds all of them, and the values of each in it."""
    n = matrices[0].shape[0]
    places = []
    for matrix in matrices:
        columns = np.repeat(np.arange(n), np.diff(matrix.indptr))
        places.append(columns * n + matrix.indices)
    every = np.sort(np.concatenate(places), kind="stable")
    union = every[np.append(True, every[1:] != every[:-1])]
    values = []
    for matrix, place in zip(matrices, places, strict=True):
        data = np.zeros(len(union))
        data[np.searchsorted(union, place)] = matrix.data
        values.append(data)
    indptr = np.searchsorted(union // n, np.arange(n + 1))
    return _Pattern((union % n).astype(np.int32), indptr.astype(np.int32)), values


def _median_nonzero(diagonal: np.ndarray) -> float:
    """The median of what is not zero."""
    some = diagonal[diagonal > 1e-12 * diagonal.max(initial=0.0)]
    return float(np.median(some)) if some.size else 0.0
