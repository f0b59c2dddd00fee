"""What the programme of a direct method is like: how large and sparse, how well conditioned, and
how far from linear."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_array, csc_array

from labs.algorithms.sqp import SqpIterate
from labs.optimal_control.direct_methods.methods import Transcription
from labs.resumable import Resumable

MAX_ROWS = 400
"""Rows of the equations whose condition number is computed, at most."""
LARGEST_CONDITION = 1e15
"""Beyond it a condition number is rounding alone."""
ROUNDING = 1e-12
"""What linear constraints miss."""
CONTROL_CHANGE = 0.1
"""[u_0] of the first control, by which it is seen how far the constraints are from linear."""


@dataclass(frozen=True, eq=False)
class ProgramStructure:
    """Of a programme with its present iterate."""

    variables: int
    constraints: int
    """Equalities and inequalities, without bounds of variables."""
    jacobian: int
    """Entries of c_y and g_y that are not zero by their pattern,"""
    hessian: int
    """and of L_yy."""
    condition: float = 0.0
    """Of the equations of a Newton step, [L_yy c_y'; c_y 0], with controls in units of u_0;
    0 where it is not known, or not to be told from singular."""
    nonlinearity: float = 0.0
    """What the linearised constraints miss when the first control changes by CONTROL_CHANGE u_0, in
    parts of what they foretell: |c(y + p) - c(y) - c_y p| / |c_y p|; 0 where it is not known
    yet."""

    @property
    def nonzeros(self) -> int:
        return self.jacobian + self.hessian

    @property
    def density(self) -> float:
        """Of L_yy and the Jacobians."""
        return self.nonzeros / (self.variables * (self.variables + self.constraints))


def program_structure(
    method: Transcription, at: SqpIterate, u_0: np.ndarray, whole: bool
) -> Resumable[ProgramStructure]:
    """At an iterate that has a value; with condition and nonlinearity if it is to be whole."""
    program, y = method.program, at.y
    d = at.derivatives or program.derivatives(y)
    L_yy = yield from program.hessian(y, at.lam, at.mu, exact=whole)
    yield
    sizes = (len(y), len(at.values.c) + len(at.values.g), d.c_y.nnz + d.g_y.nnz, L_yy.nnz)
    if not whole:
        return ProgramStructure(*sizes)
    condition = _condition_number(L_yy, d.c_y, method.controls, u_0)
    yield
    p = np.zeros(len(y))
    p[method.controls[0]] = CONTROL_CHANGE * u_0
    foretold = d.c_y @ p
    change = program.values(y + p).c - at.values.c
    size = float(np.linalg.norm(foretold))
    missed = float(np.linalg.norm(change - foretold)) / size if size > 0.0 else 0.0
    return ProgramStructure(*sizes, condition, missed if ROUNDING < missed < np.inf else 0.0)


def _condition_number(
    L_yy: csc_array, c_y: csc_array, controls: np.ndarray, u_0: np.ndarray
) -> float:
    """The ratio of the largest and the least singular value."""
    if sum(c_y.shape) > MAX_ROWS:
        return 0.0
    scale = np.ones(c_y.shape[1])
    scale[controls] = u_0
    H, J = csc_array(scale[:, None] * L_yy.toarray() * scale), csc_array(c_y * scale)
    matrix = block_array([[H, J.T], [J, None]]).toarray() if J.shape[0] else H.toarray()
    values = np.abs(np.linalg.eigvalsh(matrix))
    ratio = values.max() / max(values.min(), 1e-300)
    return float(ratio) if ratio < LARGEST_CONDITION else 0.0
