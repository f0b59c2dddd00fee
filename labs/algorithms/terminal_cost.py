"""Terminal costs of linear MPC (notes, 2.5.3): l_f(x) = x' P x / 2, what u = K x costs for ever,

    P = A_K' P A_K + Q_K,   A_K = A + B K,   Q_K = Q + K' R K,

the sum of (A_K')^i Q_K A_K^i, so that l_f(A_K x) - l_f(x) = -l(x, K x) for every stabilising K.
Riccati's P is that of the best K (`riccati.py`; the half changes neither)."""

import numpy as np

from labs.algorithms.lyapunov import solve_lyapunov


def cost_of_gain(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, K: np.ndarray
) -> np.ndarray:
    """P (n, n), symmetric, of A (n, n), B (n, m), Q (n, n), R (m, m) and K (m, n). Raises LabError
    where K does not stabilise: the sum has no limit."""
    return solve_lyapunov(A + B @ K, Q + K.T @ R @ K)
