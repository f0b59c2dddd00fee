"""The grid of direct collocation (notes, 2.3.3): which variables are which, and the constant
matrices that tie them to the points where f and l are asked for.

    points = E z,    defects = D z - T W f(points),    cost's integral = T w' l(points)
"""

import numpy as np
from scipy.sparse import csr_array

from labs.algorithms.collocation_schemes import Scheme


class CollocationGrid:
    """N steps of a scheme, with the variables z (n,) of a trajectory in the order of time."""

    def __init__(self, scheme: Scheme, N: int, nx: int, nu: int) -> None:
        b, stride, between = nx + nu, scheme.stride, scheme.between
        many = N * stride + 1
        self.n = many * b - (nu if between else 0)
        blocks = np.arange(many * b).reshape(many, b)
        self.states = blocks[:, :nx]
        """(blocks, nx): where the states are in z."""
        self.nodes = self.states[::stride]
        """(N + 1, nx): those at the ends of steps."""
        self.controls = blocks[: N if between else many, nx:]
        """(N or blocks, nu)"""
        self.points = N if between else many
        self.point_times = (np.arange(self.points) + (0.5 if between else 0.0)) / (N * stride)
        """(points,) in parts of T."""
        self.block_times = np.arange(many) / (N * stride)
        """(blocks,) likewise, of the states."""
        self.weights = np.zeros(self.points)
        """(points,) w; their sum is 1."""
        for k, weight in enumerate(scheme.quadrature):
            self.weights[k : k + (N - 1) * stride + 1 : stride] += weight / N
        state_rows = np.arange(self.points * b).reshape(-1, b)[:, :nx]
        control_rows = np.arange(self.points * b).reshape(-1, b)[:, nx:]
        if between:
            halves = [(state_rows, self.states[:-1], 0.5), (state_rows, self.states[1:], 0.5)]
        else:
            halves = [(state_rows, self.states, 1.0)]
        shape = (self.points * b, self.n)
        self.E = _coefficient_matrix(shape, *halves, (control_rows, self.controls, 1.0))
        kinds = len(scheme.states)
        self.rows = np.arange(N * kinds * nx).reshape(N, kinds, nx)
        """(N, kinds, nx): which defect each row is; the last kind is s_(i+1) - s_i's."""
        steps = stride * np.arange(N)
        slopes = np.arange(self.points * nx).reshape(-1, nx)
        states = [
            (self.rows[:, kind], self.states[steps + k], a)
            for kind, coefficients in enumerate(scheme.states)
            for k, a in enumerate(coefficients)
            if a
        ]
        rates = [
            (self.rows[:, kind], slopes[steps + k], a / N)
            for kind, coefficients in enumerate(scheme.slopes)
            for k, a in enumerate(coefficients)
            if a
        ]
        self.D = _coefficient_matrix((self.rows.size, self.n), *states)
        self.W = _coefficient_matrix((self.rows.size, self.points * nx), *rates)


def _coefficient_matrix(
    shape: tuple[int, int], *entries: tuple[np.ndarray, np.ndarray, float]
) -> csr_array:
    """With a coefficient at all pairs of rows and columns, arrays of the same shape."""
    rows = np.concatenate([row.ravel() for row, _, _ in entries])
    columns = np.concatenate([column.ravel() for _, column, _ in entries])
    values = np.concatenate([np.full(row.size, a) for row, _, a in entries])
    return csr_array((values, (rows, columns)), shape=shape)
