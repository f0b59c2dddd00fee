"""The backward pass of differential dynamic programming (notes, 2.4.6), compiled.

From the end to the start, with V' the value function of the next step and f the dynamics,

    Q_x  = l_x  + f_x' V'_x                    Q_u  = l_u  + f_u' V'_x
    Q_xx = l_xx + f_x' V'_xx f_x + V'_x f_xx   Q_uu = l_uu + f_u' V'_xx f_u + V'_x f_uu
    Q_ux = l_ux + f_u' V'_xx f_x + V'_x f_ux
    w = -(Q_uu + mu I)^-1 Q_u,                 K = -(Q_uu + mu I)^-1 Q_ux
    V_x  = Q_x + K' Q_u + K' Q_uu w + Q_xu w
    V_xx = Q_xx + K' Q_uu K + K' Q_ux + Q_xu K, symmetrised

and the expected change of the cost for a step alpha w is alpha d_1 + alpha^2 d_2 / 2 with
d_1 = sum w' Q_u, d_2 = sum w' Q_uu w.

With bounds on the control (beyond the notes) w minimises the same quadratic model within them,
by an active-set method, and K is zero in the rows of w that a bound holds (Tassa, Mansard and
Todorov, "Control-limited differential dynamic programming", 2014).
"""

import numpy as np

from labs.algorithms.box_qp import box_qp, cholesky, cholesky_solve
from labs.compiled import compiled


@compiled
def backward_pass(
    A: np.ndarray,
    B: np.ndarray,
    second: np.ndarray,
    l_x: np.ndarray,
    l_u: np.ndarray,
    l_xx: np.ndarray,
    l_ux: np.ndarray,
    l_uu: np.ndarray,
    mu: float,
    low: np.ndarray,
    high: np.ndarray,
    w: np.ndarray,
    K: np.ndarray,
) -> tuple[int, float, float]:
    """Fills w (N, m) and K (N, m, n); gives -1, d_1, d_2, or the step where Q_uu + mu I is not
    positive definite.

    A (N, n, n) and B (N, n, m) are f_x and f_u; `second` is f'' (N, n, n + m, n + m) over (x, u),
    or empty for none of it (Gauss-Newton, iLQR); l_x and l_xx have N + 1 entries, the last of
    the final cost. `low` and `high` (N, m) bound w; both empty: no bounds."""
    N, n, m = B.shape
    bounded = low.shape[0] > 0
    V_x, V_xx = l_x[N].copy(), l_xx[N].copy()
    F, VF, H = np.empty((n, n + m)), np.empty((n, n + m)), np.empty((n + m, n + m))
    L, Q_u, held = np.empty((m, m)), np.empty(m), np.zeros(m, np.bool_)
    lower, slopes = np.empty((n + m, n)), np.empty(n + m)
    d_1 = d_2 = 0.0
    for t in range(N - 1, -1, -1):
        for i in range(n):
            F[i, :n], F[i, n:] = A[t, i], B[t, i]
        # H = [Q_xx Q_xu; Q_ux Q_uu], slopes = [Q_x; Q_u].
        _matrix_product(V_xx, F, VF)
        for j in range(n + m):
            for i in range(n):
                lower[j, i] = F[i, j]
        _matrix_product(lower, VF, H)
        slopes[:n], slopes[n:] = l_x[t], l_u[t]
        for j in range(n + m):
            for i in range(n):
                slopes[j] += lower[j, i] * V_x[i]
        H[:n, :n] += l_xx[t]
        H[n:, :n] += l_ux[t]
        H[:n, n:] += l_ux[t].T
        H[n:, n:] += l_uu[t]
        if second.shape[0] > 0:
            for i in range(n):
                p = V_x[i]
                for j in range(n + m):
                    for k in range(n + m):
                        H[j, k] += p * second[t, i, j, k]
        Q_u[:] = slopes[n:]
        for i in range(m):
            held[i] = False
        if bounded:
            if not box_qp(H[n:, n:], mu, Q_u, low[t], high[t], w[t], held, L):
                return t, 0.0, 0.0
        elif not cholesky(H[n:, n:], mu, held, L):
            return t, 0.0, 0.0
        else:
            for i in range(m):
                w[t, i] = -Q_u[i]
            cholesky_solve(L, w[t])
        gain = K[t]
        for i in range(m):
            for j in range(n):
                gain[i, j] = 0.0 if held[i] else -H[n + i, j]
        _solve_columns(L, gain)
        for i in range(m):
            curved = 0.0
            for j in range(m):
                curved += H[n + i, n + j] * w[t, j]
            d_1 += w[t, i] * Q_u[i]
            d_2 += w[t, i] * curved
            slopes[n + i] = curved
        _value_update(H, slopes, Q_u, w[t], gain, V_x, V_xx)
    return -1, d_1, d_2


@compiled
def _matrix_product(left: np.ndarray, right: np.ndarray, out: np.ndarray) -> None:
    """out = left right, row by row, so that the inner loop runs along memory."""
    for i in range(left.shape[0]):
        row = out[i]
        row[:] = 0.0
        for k in range(left.shape[1]):
            factor = left[i, k]
            if factor != 0.0:
                for j in range(right.shape[1]):
                    row[j] += factor * right[k, j]


@compiled
def _value_update(
    H: np.ndarray,
    curved: np.ndarray,
    Q_u: np.ndarray,
    w: np.ndarray,
    K: np.ndarray,
    V_x: np.ndarray,
    V_xx: np.ndarray,
) -> None:
    """V_x and V_xx of this step, into those of the next; `curved` is [Q_x; Q_uu w]."""
    m, n = K.shape
    QK = np.empty((m, n))
    for i in range(m):
        for j in range(n):
            QK[i, j] = H[n + i, j]
        for k in range(m):
            factor = H[n + i, n + k]
            for j in range(n):
                QK[i, j] += factor * K[k, j]
    for i in range(n):
        V_x[i] = curved[i]
        for k in range(m):
            V_x[i] += K[k, i] * (Q_u[k] + curved[n + k]) + H[n + k, i] * w[k]
        for j in range(n):
            V_xx[i, j] = H[i, j]
    # K' (Q_uu K + Q_ux) + Q_xu K
    for k in range(m):
        for i in range(n):
            left, cross = K[k, i], H[n + k, i]
            for j in range(n):
                V_xx[i, j] += left * QK[k, j] + cross * K[k, j]
    for i in range(n):
        for j in range(i):
            V_xx[i, j] = V_xx[j, i] = 0.5 * (V_xx[i, j] + V_xx[j, i])


@compiled
def _solve_columns(L: np.ndarray, Y: np.ndarray) -> None:
    """Y becomes (L L')^-1 Y."""
    m, n = Y.shape
    for i in range(m):
        for k in range(i):
            for j in range(n):
                Y[i, j] -= L[i, k] * Y[k, j]
        for j in range(n):
            Y[i, j] /= L[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            for j in range(n):
                Y[i, j] -= L[k, i] * Y[k, j]
        for j in range(n):
            Y[i, j] /= L[i, i]
