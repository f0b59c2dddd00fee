"""The gradient of the cost of a rollout with respect to its controls (single shooting; notes,
2.3.2), by the adjoint recursion. With f_x = A_t, f_u = B_t and the costate p,

    p_N = l_x(x_N),    p_t = l_x(x_t, u_t) + A_t' p_(t+1),    dJ/du_t = l_u(x_t, u_t) + B_t' p_(t+1)

which takes one sweep backward in time, whatever the number of controls.
"""

import numpy as np

from labs.compiled import compiled
from labs.problems.optimal_control import Expansion, OptimalControlProblem

AT_BOUND = 1e-12
"""A control within this part of its bound is at it: sums such as U + w round."""


@compiled
def adjoint_gradient(A: np.ndarray, B: np.ndarray, l_x: np.ndarray, l_u: np.ndarray) -> np.ndarray:
    """dJ/dU (N, m), from A (N, n, n), B (N, n, m), l_x (N + 1, n) and l_u (N, m)."""
    N, n, m = B.shape
    p, earlier, gradient = l_x[N].copy(), np.empty(n), l_u.copy()
    for t in range(N - 1, -1, -1):
        earlier[:] = l_x[t]
        for i in range(n):
            for j in range(m):
                gradient[t, j] += B[t, i, j] * p[i]
            for j in range(n):
                earlier[j] += A[t, i, j] * p[i]
        p[:] = earlier
    return gradient


def gradient_norm(problem: OptimalControlProblem, expansion: Expansion, U: np.ndarray) -> float:
    """max |dJ/dU| on the trajectory of the expansion, without what pushes against the bound.
    U (N, nu)."""
    cost = expansion.cost
    gradient = adjoint_gradient(expansion.A, expansion.B, cost.l_x, cost.l_u)
    if problem.bound is not None:
        most = (1.0 - AT_BOUND) * problem.bound
        gradient[((most <= U) & (gradient < 0.0)) | ((-most >= U) & (gradient > 0.0))] = 0.0
    return float(np.abs(gradient).max())
