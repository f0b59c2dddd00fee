"""How multiple shooting cuts the horizon into segments, and which variables are which (notes,
2.3.4).

N pieces of a control are split into m segments of whole pieces: each has floor(N / m), and the
first N mod m have one more. The variables are in the order of time, T at the end where it is free,

    z = (s_0, y of segment 0, s_1, y of segment 1, ..., s_(m-1), y of segment m - 1[, T])

What happens in a segment depends on its own of them and T alone, in the order (s_i, y's, T).
"""

from itertools import pairwise

import numpy as np

from labs.algorithms.assembly import MatrixTerms, block_terms


class Segments:
    """m segments of N pieces with M steps of integration in each: K = N M steps."""

    def __init__(self, N: int, m: int, M: int, nx: int, nu: int, free_time: bool) -> None:
        self.m, self.lengths = m, N // m + (np.arange(m) < N % m)
        """(m,) pieces in each, longer ones first."""
        self.pieces = np.cumsum([0, *self.lengths])
        """(m + 1,) the first piece of each, and N."""
        self.n = m * nx + N * nu + free_time
        self.starts = np.arange(nx) + (nx * np.arange(m) + nu * self.pieces[:-1])[:, None]
        """(m, nx): where s_i is in z."""
        of_piece = np.repeat(np.arange(m), self.lengths)
        self.controls = np.arange(nu) + (nx * (of_piece + 1) + nu * np.arange(N))[:, None]
        """(N, nu): where y_k is."""
        longest = int(self.lengths[0])
        self.columns = np.full((m, nx + longest * nu + free_time), -1)
        """(m, k): the variables a segment depends on; -1: none, in shorter ones."""
        for i, (first, length) in enumerate(zip(self.pieces, self.lengths, strict=False)):
            own = self.controls[first : first + length].ravel()
            self.columns[i, : nx + len(own)] = np.concatenate([self.starts[i], own])
        if free_time:
            self.columns[:, -1] = self.n - 1
        self.first_steps = self.pieces[:-1] * M
        self.segment_of_step = np.repeat(of_piece, M)
        """(K,)"""
        in_segment = np.arange(N * M) - self.first_steps[self.segment_of_step]
        self.running = [int((self.lengths * M > j).sum()) for j in range(longest * M)]
        """How many segments, the first of them, have a j-th step."""
        k = self.columns.shape[1]
        self.w_z = np.zeros((N * M, nu + 1, k))
        """(K, nu + 1, k): which of its segment's variables a step's control and T are."""
        where = nx + (in_segment // M * nu)[:, None] + np.arange(nu)
        self.w_z[np.arange(N * M)[:, None], np.arange(nu), where] = 1.0
        self.w_z[:, nu, -1] = free_time
        behind = np.arange(k) >= nx + ((in_segment[::M] + M) // M * nu)[:, None]
        behind[:, k - free_time :] = False
        self.columns_by_piece = np.where(behind, -1, self.columns[of_piece])
        """(N, k): the variables the end of a piece depends on."""

    def sum_by_variable(self, by_step: np.ndarray) -> np.ndarray:
        """(n,) of what every step has for its segment's variables (K, k)."""
        of_segment = np.add.reduceat(by_step, self.first_steps, axis=0)
        own = self.columns >= 0
        return np.bincount(self.columns[own], of_segment[own], minlength=self.n)


def masked_block_terms(
    rows: np.ndarray, columns: np.ndarray, first: int, coefficient: float = 1.0
) -> MatrixTerms:
    """`block_terms` without those of variables -1."""
    terms = block_terms(rows, columns, first, coefficient)
    own = (terms.row >= 0) & (terms.column >= 0)
    return MatrixTerms(*(part[own] for part in terms))


def congruent_sums(Z: np.ndarray, H: np.ndarray, cuts: np.ndarray) -> np.ndarray:
    """(m, k, k): the sums of Z_j' H_j Z_j over the rows between two of the m + 1 cuts."""
    HZ, k = H @ Z, Z.shape[2]
    return np.array([Z[i:j].reshape(-1, k).T @ HZ[i:j].reshape(-1, k) for i, j in pairwise(cuts)])
