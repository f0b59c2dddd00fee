"""The derivatives of a collocation's programme as matrices: where they have entries, and how many
(notes, 2.3.3: sparsity)."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

MAX_CELLS = 160
"""Rows and columns that are shown; a larger matrix is shown in blocks."""
MIN_ENTRY = 1e-6
"""An entry smaller than this is shown as if it were so large."""


@dataclass(frozen=True, eq=False)
class SparsityPattern:
    """Of one programme. Arrays are never written into again."""

    jacobian: np.ndarray
    """(rows, columns) of |c_y|, the largest of each block; 0 where there is no entry."""
    hessian: np.ndarray
    """Likewise, of the Lagrangian's."""
    variables: int
    constraints: int
    nonzeros: int
    """Of c_y."""
    hessian_nonzeros: int

    @property
    def density(self) -> float:
        """The part of c_y's entries that is stored."""
        return self.nonzeros / (self.variables * self.constraints)

    @property
    def hessian_density(self) -> float:
        return self.hessian_nonzeros / self.variables**2


def sparsity_pattern(c_y: csc_array, L_yy: csc_array) -> SparsityPattern:
    """Of the Jacobian (m, n) and the Hessian (n, n), with their stored zeros."""
    m, n = c_y.shape
    return SparsityPattern(
        _block_maxima(c_y), _block_maxima(L_yy), n, m, int(c_y.nnz), int(L_yy.nnz)
    )


def log_magnitudes(sizes: np.ndarray) -> np.ndarray:
    """log10, NaN where there is no entry."""
    found = np.full(sizes.shape, np.nan)
    there = sizes > 0.0
    found[there] = np.log10(sizes[there])
    return found


def cell_starts(cells: int, length: int) -> np.ndarray:
    """(cells,) the number, from 1, that each cell of a map of `length` rows begins with."""
    return 1.0 + np.arange(cells) * _block_size(length)


def _block_maxima(matrix: csc_array) -> np.ndarray:
    rows, columns = (_block_size(length) for length in matrix.shape)
    found = np.zeros([-(-length // _block_size(length)) for length in matrix.shape])
    entries = matrix.tocoo()
    sizes = np.maximum(np.abs(entries.data), MIN_ENTRY)
    np.maximum.at(found, (entries.row // rows, entries.col // columns), sizes)
    return found


def _block_size(length: int) -> int:
    """Rows in a cell."""
    return -(-length // MAX_CELLS)
