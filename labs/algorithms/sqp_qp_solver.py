"""The solver of an SQP's quadratic programmes (notes, 2.3.1: Newton's method),

    minimise x'P x / 2 + q'x   subject to   A x = b,   G x <= h,   lower <= x <= upper

by piqp, a proximal interior-point method (Schwan et al. 2023), used so that it remembers
structures: to find that of a sparse programme takes as long as half a solution,
and from iteration to iteration only numbers change.
"""

from typing import NamedTuple

import numpy as np
import piqp
from scipy.sparse import csc_array, csc_matrix

MAX_ITERATIONS = 100
"""Of the solver, which otherwise needs 10 to 30: what takes more has gone astray."""
SCALING_ITERATIONS = 3
"""Of rows and columns, to scale a programme: more take time and save no iteration."""
DUALITY_GAP_FACTOR = 0.3
"""Tolerance of the duality gap, in parts of that of the residuals: with a smaller one an SQP needs
as many iterations, and more of the solver's."""
MAX_CACHED_STRUCTURES = 4
"""Structures: a step asks for one, its elastic mode for two more."""
MIN_BAND_RATIO = 4
"""A matrix with a band of less than one in so many variables goes stage by stage."""


class QuadraticProgram(NamedTuple):
    """Infinite bounds are none."""

    P: csc_array
    q: np.ndarray
    A: csc_array
    b: np.ndarray
    G: csc_array
    h: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


class QpSolution(NamedTuple):
    """What the solver found."""

    x: np.ndarray | None
    """(n,), or None."""
    infeasible: bool
    """Whether it is sure that there is nothing."""
    y: np.ndarray
    """Multipliers of A x = b."""
    z: np.ndarray
    """Of G x <= h."""
    z_bounds: np.ndarray
    """(n,) of the bounds, positive at the upper one."""


class QpSolver:
    """Solves one quadratic programme after the other. What it finds depends on those before only
    within the tolerance."""

    def __init__(self) -> None:
        self._known: list[_StructureSolver] = []

    def solve(self, qp: QuadraticProgram, tolerance: float, stages: bool = True) -> QpSolution:
        """To this tolerance of the residuals, absolute and relative, and DUALITY_GAP_FACTOR of it
        of the duality gap; by stages, if they are wanted and the order of the variables allows it,
        and if that fails in general."""
        known = next((s for s in self._known if s.wanted == stages and s.fits(qp)), None)
        if known:
            found = known.solve(qp, tolerance)
            if found.x is not None:
                return found
            self._known.remove(known)
        structure = _StructureSolver(qp, stages, stages and has_stage_structure(qp.P))
        found = structure.solve(qp, tolerance)
        if structure.staged and found.x is None and not found.infeasible:
            structure = _StructureSolver(qp, stages, False)
            found = structure.solve(qp, tolerance)
        self._known = [structure, *self._known][:MAX_CACHED_STRUCTURES]
        return found

    def __reduce__(self) -> tuple[type["QpSolver"], tuple[()]]:
        """Copied or sent, it is a new one."""
        return QpSolver, ()


class _StructureSolver:
    """Of programmes that differ in numbers alone, with the solver that knows it."""

    def __init__(self, qp: QuadraticProgram, wanted: bool, staged: bool) -> None:
        self.wanted, self.staged = wanted, staged
        self._matrices = [_Nonzeros(qp.P), _Nonzeros(qp.A), _Nonzeros(qp.G)]
        self._bounded = bool(np.isfinite(qp.lower).any() or np.isfinite(qp.upper).any())
        self._begun = False
        self._solver = piqp.SparseSolver()
        settings = self._solver.settings
        settings.kkt_solver = piqp.sparse_multistage if staged else piqp.sparse_ldlt
        settings.max_iter = MAX_ITERATIONS
        settings.preconditioner_scale_cost = True
        settings.preconditioner_iter = SCALING_ITERATIONS

    def fits(self, qp: QuadraticProgram) -> bool:
        """Whether this is another one of them."""
        P, A, G = self._matrices
        return P.fits(qp.P) and A.fits(qp.A) and G.fits(qp.G)

    def solve(self, qp: QuadraticProgram, tolerance: float) -> QpSolution:
        """One of them."""
        settings = self._solver.settings
        settings.eps_abs = settings.eps_rel = tolerance
        settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = DUALITY_GAP_FACTOR * tolerance
        P, A, G = self._matrices
        (self._solver.update if self._begun else self._solver.setup)(
            P.matrix(qp.P),
            qp.q,
            *((A.matrix(qp.A), qp.b) if len(qp.b) else (None, None)),
            *((G.matrix(qp.G), None, qp.h) if len(qp.h) else (None, None, None)),
            *((qp.lower, qp.upper) if self._bounded else (None, None)),
        )
        self._begun = True
        status, found = self._solver.solve(), self._solver.result
        x = found.x.copy() if status == piqp.PIQP_SOLVED else None
        infeasible = status == piqp.PIQP_PRIMAL_INFEASIBLE
        return QpSolution(x, infeasible, found.y.copy(), found.z_u.copy(), found.z_bu - found.z_bl)


class _Nonzeros:
    """Of a matrix, some of whose stored entries are zero; these would cost the solver time."""

    def __init__(self, of: csc_array) -> None:
        self._of = of
        self._kept = np.flatnonzero(of.data)
        before = np.searchsorted(self._kept, of.indptr)
        parts = (of.data[self._kept], of.indices[self._kept], before.astype(np.int32))
        self._matrix = csc_matrix(parts, shape=of.shape)

    def fits(self, other: csc_array) -> bool:
        """Whether another matrix has its nonzero entries where this one has."""
        return (
            other.shape == self._of.shape
            and np.array_equal(other.indptr, self._of.indptr)
            and np.array_equal(other.indices, self._of.indices)
            and np.count_nonzero(other.data) == np.count_nonzero(other.data[self._kept])
        )

    def matrix(self, of: csc_array) -> csc_matrix:
        """Without zeros, one that fits; to be used before the next one."""
        np.take(of.data, self._kept, out=self._matrix.data)
        return self._matrix


def has_stage_structure(P: csc_array) -> bool:
    """Whether the variables are ordered so that only near ones meet, but for the last."""
    n = P.shape[0]
    filled = np.flatnonzero(np.diff(P.indptr[:-1]))
    last = P.indptr[filled + 1] - 1
    last = np.where((P.indices[last] == n - 1) & (last > P.indptr[filled]), last - 1, last)
    width = int((P.indices[last] - filled)[P.indices[last] < n - 1].max(initial=0))
    return bool(n > MIN_BAND_RATIO * width)
