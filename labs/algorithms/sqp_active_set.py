"""The quadratic programme of an SQP iteration where its active set is nearly known (beyond the
notes), by the primal-dual active set method (Hintermueller, Ito and Kunisch 2003):

    minimise x'P x / 2 + q'x   subject to   A x = b,   G x <= h,   lower <= x <= upper

What is active is held: the bounded variables stay there, of the others x_f and the rows B of A and
of the active ones of G

    [ P_ff  B_f' ] [ x_f ]   [ -q_f - P_fa x_a ]
    [ B_f    0   ] [  y  ] = [  b   - B_a x_a  ]

is solved. A bound or row that is pushed away from is let go, one that is crossed is taken up, until
nothing changes: then all conditions of optimality hold, and for a convex P this is the solution, to
rounding. Rows stand between the variables that they join: ordered so, what reaches over few steps
of a motion is a band, and is factored as one.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgbtrf, dgbtrs
from scipy.sparse import csc_array, vstack

from labs.algorithms.sqp_qp_solver import MIN_BAND_RATIO, QpSolution, QuadraticProgram
from labs.compiled import compiled

MAX_ROUNDS, MAX_CHANGES = 4, 30
"""An active set that needs more of them, or more changes in one, was not nearly known."""
MAX_REFINEMENTS = 4
"""Of a solution, with the same factors; one or two are used."""


class ActiveSet(NamedTuple):
    """What a solution pushes against."""

    bounds: np.ndarray
    """(n,): 1 at an upper bound, -1 at a lower one, else 0."""
    inequalities: np.ndarray
    """(k,) bool."""

    def changes(self, other: "ActiveSet") -> int:
        """How much is active in one of them alone, or at the other bound."""
        return sum(int(np.sum(mine != theirs)) for mine, theirs in zip(self, other, strict=True))


def identify_active_set(qp: QuadraticProgram, found: QpSolution) -> ActiveSet:
    """Of an interior point's solution: where a multiplier is larger than the gap it belongs to."""
    assert found.x is not None
    gap = np.where(found.z_bounds > 0.0, qp.upper - found.x, found.x - qp.lower)
    at_bound = np.abs(found.z_bounds) > gap
    return ActiveSet(np.sign(found.z_bounds) * at_bound, found.z > qp.h - qp.G @ found.x)


def solve_active(qp: QuadraticProgram, guess: ActiveSet, tolerance: float) -> QpSolution | None:
    """From a guess of what is active; None where that does not lead to a solution in a few rounds,
    or the programme has no band. `tolerance` is absolute, of all conditions."""
    active = ActiveSet(np.where(qp.lower == qp.upper, 1.0, guess.bounds), guess.inequalities)
    for _ in range(MAX_ROUNDS):
        found = _solve_equalities(qp, active, tolerance)
        if found is None:
            return None
        after = _update_active_set(qp, active, found, tolerance)
        changes = after.changes(active)
        if not changes:
            return found
        if changes > MAX_CHANGES:
            return None
        active = after
    return None


def prepare() -> None:
    """Compiles what is asked for."""
    n = 4 * MIN_BAND_RATIO
    eye, row, none = csc_array(np.eye(n)), csc_array(np.eye(1, n)), csc_array((0, n))
    far, free = np.full(n, np.inf), ActiveSet(np.zeros(n), np.zeros(0, bool))
    qp = QuadraticProgram(eye, np.ones(n), row, np.ones(1), none, np.zeros(0), -far, far)
    solve_active(qp, free, 1e-9)


def _solve_equalities(
    qp: QuadraticProgram, active: ActiveSet, tolerance: float
) -> QpSolution | None:
    """The solution with this held, or None."""
    m, some = len(qp.b), active.inequalities.any()
    B = csc_array(vstack([qp.A, qp.G[active.inequalities]], format="csc")) if some else qp.A
    b = np.concatenate([qp.b, qp.h[active.inequalities]])
    free = active.bounds == 0.0
    x = np.where(active.bounds > 0.0, qp.upper, np.where(free, 0.0, qp.lower))
    P_parts, B_parts = _csc_arrays(qp.P), _csc_arrays(B)
    variables, rows, size, width = _band_ordering(P_parts, B_parts, len(b), free)
    if size < MIN_BAND_RATIO * width:
        return None
    band = _band_matrix(P_parts, B_parts, variables, rows, size, width)
    factors, pivots, singular = dgbtrf(band.T, width, width, overwrite_ab=1)
    if singular:
        return None
    y, step, places = np.zeros(len(b)), np.empty(size), variables[free]
    for _ in range(MAX_REFINEMENTS):
        pull = -(qp.P @ x + qp.q + B.T @ y)
        step[places] = pull[free]
        step[rows] = b - B @ x
        missed = np.abs(step).max(initial=0.0)
        if missed <= tolerance:
            z, z_bounds = np.zeros(len(qp.h)), np.zeros(len(x))
            z[active.inequalities] = y[m:]
            z_bounds[~free] = pull[~free]
            return QpSolution(x, False, y[:m], z, z_bounds)
        step, _ = dgbtrs(factors, width, width, step, pivots)
        x[free] += step[places]
        y += step[rows]
    return None


def _update_active_set(
    qp: QuadraticProgram, active: ActiveSet, found: QpSolution, tolerance: float
) -> ActiveSet:
    """Without what is pushed away from, with what is crossed."""
    assert found.x is not None
    kept = (active.bounds * found.z_bounds >= -tolerance) | (qp.lower == qp.upper)
    above, below = found.x > qp.upper + tolerance, found.x < qp.lower - tolerance
    bounds = np.where(kept, active.bounds, 0.0) + above - below
    over = qp.G @ found.x > qp.h + tolerance
    return ActiveSet(bounds, (active.inequalities & (found.z >= -tolerance)) | over)


class _CscArrays(NamedTuple):
    """Of a sparse matrix, by columns."""

    start: np.ndarray
    """Where each column begins among the entries."""
    row: np.ndarray
    value: np.ndarray


def _csc_arrays(of: csc_array) -> _CscArrays:
    return _CscArrays(
        of.indptr.astype(np.int32), of.indices.astype(np.int32), of.data.astype(float)
    )


@compiled
def _band_ordering(
    P: _CscArrays, B: _CscArrays, m: int, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int, int]:
    """Where each free variable (n,), others at -1, and each row (m,) stands among all of them, how
    many these are, and how far apart two are at most that meet."""
    n = len(free)
    first, last = np.full(m, n - 1), np.zeros(m, np.int64)
    for j in range(n):
        if free[j]:
            for k in range(B.start[j], B.start[j + 1]):
                if B.value[k] != 0.0:
                    first[B.row[k]] = min(first[B.row[k]], j)
                    last[B.row[k]] = max(last[B.row[k]], j)
    # A row stands behind the variable in its middle; those behind one variable keep their order.
    behind = np.zeros(n + 1, np.int64)
    for i in range(m):
        behind[(first[i] + last[i]) // 2 + 1] += 1
    place, variables, vacant = 0, np.full(n, -1), np.zeros(n, np.int64)
    for j in range(n):
        if free[j]:
            variables[j], place = place, place + 1
        vacant[j], place = place, place + behind[j + 1]
    rows = np.zeros(m, np.int64)
    for i in range(m):
        j = (first[i] + last[i]) // 2
        rows[i], vacant[j] = vacant[j], vacant[j] + 1
    width = 0
    for j in range(n):
        if free[j]:
            for k in range(P.start[j], P.start[j + 1]):
                if P.value[k] != 0.0 and free[P.row[k]]:
                    width = max(width, abs(variables[P.row[k]] - variables[j]))
            for k in range(B.start[j], B.start[j + 1]):
                if B.value[k] != 0.0:
                    width = max(width, abs(rows[B.row[k]] - variables[j]))
    return variables, rows, place, width


@compiled
def _band_matrix(
    P: _CscArrays,
    B: _CscArrays,
    variables: np.ndarray,
    rows: np.ndarray,
    size: int,
    width: int,
) -> np.ndarray:
    """(size, 3 width + 1) each column of the matrix, its diagonal at 2 width, as LAPACK has it."""
    band = np.zeros((size, 3 * width + 1))
    for j in range(len(variables)):
        mine = variables[j]
        if mine >= 0:
            for k in range(P.start[j], P.start[j + 1]):
                other = variables[P.row[k]]
                if other >= 0 and P.value[k] != 0.0:
                    band[mine, 2 * width + other - mine] = P.value[k]
            for k in range(B.start[j], B.start[j + 1]):
                if B.value[k] != 0.0:
                    apart = rows[B.row[k]] - mine
                    band[mine, 2 * width + apart] = B.value[k]
                    band[rows[B.row[k]], 2 * width - apart] = B.value[k]
    return band
