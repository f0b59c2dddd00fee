"""Sparse matrices whose pattern is known beforehand (notes, 2.3.3: sparsity).

Every stored entry of the matrix is a sum of coefficient * source, over a vector of sources such
as the derivatives of the dynamics at all points of a grid. Pattern and coefficients are worked
out once; filling in new values is one product with a constant sparse matrix.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, csr_array


class MatrixTerms(NamedTuple):
    """coefficient * sources[source] belongs to entry (row, column); all (number of terms,)."""

    row: np.ndarray
    column: np.ndarray
    source: np.ndarray
    coefficient: np.ndarray


class Assembly:
    """A matrix of this shape, the sum of terms over so many sources."""

    def __init__(self, shape: tuple[int, int], sources: int, *terms: MatrixTerms) -> None:
        self.shape = shape
        row, column, source, coefficient = (
            np.concatenate(parts) for parts in zip(*terms, strict=True)
        )
        place, entry = np.unique(column * max(shape[0], 1) + row, return_inverse=True)
        self._indices = (place % max(shape[0], 1)).astype(np.int32)
        columns = np.searchsorted(place // max(shape[0], 1), np.arange(shape[1] + 1))
        self._indptr = columns.astype(np.int32)
        entries = (len(place), sources)
        self._coefficients = csr_array((coefficient, (entry, source)), shape=entries)

    def matrix(self, sources: np.ndarray) -> csc_array:
        """With the values of these sources, (number of sources,). Zeros are stored as well."""
        return csc_array((self.values(sources), self._indices, self._indptr), shape=self.shape)

    def values(self, sources: np.ndarray) -> np.ndarray:
        """The stored entries alone, in the order of the matrix's data."""
        return np.asarray(self._coefficients @ sources)


def block_terms(
    rows: np.ndarray, columns: np.ndarray, first: int, coefficient: float = 1.0
) -> MatrixTerms:
    """Dense blocks: entry (a, b) of block k belongs to (rows[k, a], columns[k, b]), and its
    sources come one after the other, block by block and row by row, from `first` on."""
    shape = (*rows.shape, columns.shape[1])
    row = np.broadcast_to(rows[:, :, None], shape).ravel()
    column = np.broadcast_to(columns[:, None, :], shape).ravel()
    source = first + np.arange(row.size)
    return MatrixTerms(row, column, source, np.full(row.size, coefficient))
