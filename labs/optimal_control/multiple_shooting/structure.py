"""What multiple shooting makes of a problem: where its segments begin, how much a deviation grows
within them, and how sparse and how well conditioned its equations are."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_array, csc_array

from labs.algorithms.multiple_shooting import MultipleShooting
from labs.resumable import Resumable

MAX_ROWS = 250
"""Rows of the equations whose condition number is computed, at most."""
LARGEST_CONDITION = 1e15
"""Beyond it a condition number is rounding alone."""
MAX_CELLS = 120
"""Rows and columns of the map of nonzeros, at most."""
EMPTY, HESSIAN, JACOBIAN = 0.0, 1.0, 2.0


@dataclass(frozen=True, eq=False)
class ShootingStructure:
    """Of one iterate. Plain data; arrays are never written into again."""

    cuts: np.ndarray
    """(m + 1,) the step at which each segment begins, and how many steps there are."""
    growth: np.ndarray
    """(K,) |dx_j/ds_i| of each step's end by the start of its segment, in the states' units,"""
    growth_whole: np.ndarray
    """(K,) and by x_0, as single shooting has it."""
    pattern: np.ndarray
    """(rows, rows) of the equations of a Newton step, [L_zz c_z'; c_z 0]: EMPTY, HESSIAN or
    JACOBIAN, where it is large a cell for several rows."""
    variables: int
    equalities: int
    nonzeros: int
    """Entries of L_zz and c_z that are not zero by their pattern."""
    condition: float
    """Of the equations, controls in units of u_0; 0 where they are singular or too many."""

    @property
    def density(self) -> float:
        """Of L_zz and c_z."""
        return self.nonzeros / (self.variables * (self.variables + self.equalities))


def shooting_structure(
    shooting: MultipleShooting, z: np.ndarray, u_0: np.ndarray
) -> Resumable[ShootingStructure]:
    """Of the variables z (n,), whose arcs do not diverge."""
    cut, nx = shooting.segments, shooting.nx
    sensitivities = shooting.sensitivities(z)
    x, whole = np.eye(nx), np.empty(shooting.steps.K)
    for j, A in enumerate(sensitivities.at.A):
        x = A @ x
        whole[j] = np.linalg.norm(x, 2)
    growth = np.linalg.norm(sensitivities.Y_z[:, :, :nx], 2, axis=(1, 2))
    yield
    c_z = shooting.derivatives(z).c_y
    values = shooting.values(z)
    hessian = shooting.hessian(z, np.zeros(len(values.c)), np.zeros(len(values.g)), exact=False)
    L_zz = yield from hessian
    yield
    scale = np.ones(shooting.n)
    scale[cut.controls] = u_0
    return ShootingStructure(
        np.append(cut.first_steps, shooting.steps.K),
        growth,
        whole,
        _pattern(L_zz, c_z),
        shooting.n,
        len(values.c),
        L_zz.nnz + c_z.nnz,
        _condition_number(L_zz, c_z, scale),
    )


def _pattern(L_zz: csc_array, c_z: csc_array) -> np.ndarray:
    """A cell shows what is in any of its rows and columns."""
    n, k = L_zz.shape[0], c_z.shape[0]
    size = -(-(n + k) // MAX_CELLS)
    cells = -(-(n + k) // size)
    shown = np.full((cells, cells), EMPTY)
    inner, outer = L_zz.tocoo(), c_z.tocoo()
    shown[(outer.row + n) // size, outer.col // size] = JACOBIAN
    shown[outer.col // size, (outer.row + n) // size] = JACOBIAN
    shown[inner.row // size, inner.col // size] = HESSIAN
    return shown


def _condition_number(L_zz: csc_array, c_z: csc_array, scale: np.ndarray) -> float:
    """The ratio of the largest and the least singular value."""
    if sum(c_z.shape) > MAX_ROWS:
        return 0.0
    H = scale[:, None] * L_zz.toarray() * scale
    J = csc_array(c_z * scale)
    values = np.abs(np.linalg.eigvalsh(block_array([[csc_array(H), J.T], [J, None]]).toarray()))
    ratio = values.max() / max(values.min(), 1e-300)
    return float(ratio) if ratio < LARGEST_CONDITION else 0.0
