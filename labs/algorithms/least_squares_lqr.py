"""The linear quadratic regulator as one least-squares problem (notes, 2.4).

All states follow from the first and the controls, X = H x_0 + G U with X = (x_1, ..., x_N) and
U = (u_0, ..., u_(N-1)). With the roots of the weights, Q^(1/2)' Q^(1/2) = Q,

    J - x_0' Q x_0 = |[Qbar G; Rbar] U + [Qbar H x_0; 0]|^2,
    Qbar = diag(Q^(1/2), ..., Q^(1/2), Q_f^(1/2)),   Rbar = diag(R^(1/2), ..., R^(1/2)):

N (n + m) rows and N m columns, solved by a QR decomposition, which takes O(N^3).
"""

import numpy as np
from scipy.linalg import solve_triangular

from labs.errors import LabError
from labs.problems.linear_quadratic import LqrProblem, weight_roots

MAX_MATRIX_ENTRIES = 40_000_000
"""Entries of a matrix worth building: 320 MB."""


def prediction_matrices(problem: LqrProblem) -> tuple[np.ndarray, np.ndarray]:
    """H (N n, n) and G (N n, N m) of X = H x_0 + G U."""
    n, m, steps = problem.n, problem.m, problem.horizon
    a, b = problem.terms["a"], problem.terms["b"]
    h, g = np.zeros((steps, n, n)), np.zeros((steps, n, steps, m))
    for t in range(steps):
        at = a[t % len(a)]
        h[t] = at @ h[t - 1] if t else at
        if t:
            g[t, :, :t] = np.tensordot(at, g[t - 1, :, :t], axes=1)
        g[t, :, t] = b[t % len(b)]
    return h.reshape(steps * n, n), g.reshape(steps * n, steps * m)


def solve_least_squares(problem: LqrProblem, x0: np.ndarray) -> np.ndarray:
    """The optimal controls (N, m) from x0 (n,). Raises LabError for a problem with terms beside
    A, B, Q, R and Q_f, and for one too large to write down."""
    n, m, steps = problem.n, problem.m, problem.horizon
    if problem.s is not None or not problem.homogeneous:
        raise LabError(
            "the least-squares problem takes A, B, Q, R and Q_f alone; solve this by Riccati"
        )
    if steps * (n + m) * steps * m > MAX_MATRIX_ENTRIES:
        raise LabError(
            f"N = {steps} makes a matrix of {steps * (n + m)} by {steps * m} entries, more than "
            f"{MAX_MATRIX_ENTRIES}: shorten the horizon, or solve this by Riccati"
        )
    h, g = prediction_matrices(problem)
    by_x = np.broadcast_to(weight_roots(problem.terms["q"]), (steps, n, n)).copy()
    by_x[:-1], by_x[-1] = by_x[1:], weight_roots(problem.terms["q_final"])[0]
    by_u = np.broadcast_to(weight_roots(problem.terms["r"]), (steps, m, m))
    rows, target = np.zeros((steps * (n + m), steps * m)), np.zeros(steps * (n + m))
    rows[: steps * n] = (by_x @ g.reshape(steps, n, steps * m)).reshape(steps * n, steps * m)
    target[: steps * n] = -(by_x @ (h @ x0).reshape(steps, n, 1)).ravel()
    last = rows[steps * n :].reshape(steps, m, steps, m)
    last[range(steps), :, range(steps)] = by_u
    triangle = np.asarray(np.linalg.qr(np.column_stack([rows, target]), mode="r"))
    u: np.ndarray = solve_triangular(triangle[:-1, :-1], triangle[:-1, -1])
    return u.reshape(steps, m)
