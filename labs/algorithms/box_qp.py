"""A small quadratic programme within a box, compiled (beyond the notes).

    minimise w' (H + mu I) w / 2 + g' w    subject to  low <= w <= high,   low <= 0 <= high

by a primal active-set method (Nocedal and Wright, "Numerical Optimization", 16.5). Entries in
`held` rest exactly at a bound. A Newton step over the others goes as far as the first bound,
which then holds its entry too; a whole one leads to their minimum, where the entry that its
gradient pulls away from its bound the most is freed. Between two such minima the cost falls, so
none comes back, and it ends where no gradient pulls inwards: at the KKT conditions. No tolerance
says what is at a bound: what is a rounding away from it gets there by its first step.
"""

import numpy as np

from labs.compiled import compiled

MAX_ACTIVE_SET_CHANGES = 10
"""Of the entries held, at most, for each entry."""
ROUNDING = 1e-13
"""A gradient of less than this share of its terms counts as zero."""


@compiled
def box_qp(
    H: np.ndarray,
    mu: float,
    g: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    w: np.ndarray,
    held: np.ndarray,
    L: np.ndarray,
) -> bool:
    """Leaves the minimum in w (m,), in `held` (m,) what a bound holds, and in L (m, m) the factor
    of H + mu I over the others. False if that is not positive definite there or on the way, or
    MAX_ACTIVE_SET_CHANGES do not suffice."""
    m = len(w)
    gradient, rounding, newton = np.empty(m), np.empty(m), np.empty(m)
    for i in range(m):
        w[i] = 0.0
    _gradient(H, mu, g, w, gradient, rounding)
    for i in range(m):
        held[i] = (w[i] <= low[i] and gradient[i] > 0.0) or (w[i] >= high[i] and gradient[i] < 0.0)
    for _ in range(MAX_ACTIVE_SET_CHANGES * (m + 1)):
        if not cholesky(H, mu, held, L):
            return False
        for i in range(m):
            newton[i] = 0.0 if held[i] else -gradient[i]
        cholesky_solve(L, newton)
        step, first = 1.0, -1
        for i in range(m):
            room = (low[i] if newton[i] < 0.0 else high[i]) - w[i]
            if abs(room) < step * abs(newton[i]):
                step, first = room / newton[i], i
        for i in range(m):
            w[i] = min(max(w[i] + step * newton[i], low[i]), high[i])
        if first >= 0:
            w[first] = low[first] if newton[first] < 0.0 else high[first]
            held[first] = True
            _gradient(H, mu, g, w, gradient, rounding)
            continue
        _gradient(H, mu, g, w, gradient, rounding)
        freed, most = -1, 0.0
        for i in range(m):
            inwards = -gradient[i] if w[i] <= low[i] else gradient[i]
            if held[i] and inwards > rounding[i]:
                pull = inwards / np.sqrt(max(abs(H[i, i] + mu), 1e-300))
                if pull > most:
                    freed, most = i, pull
        if freed < 0:
            return True
        held[freed] = False
    return False


@compiled
def _gradient(
    H: np.ndarray,
    mu: float,
    g: np.ndarray,
    w: np.ndarray,
    gradient: np.ndarray,
    rounding: np.ndarray,
) -> None:
    """(H + mu I) w + g, and how large an entry may be by rounding alone."""
    for i in range(len(w)):
        gradient[i] = g[i] + mu * w[i]
        rounding[i] = abs(g[i]) + abs(mu * w[i])
        for j in range(len(w)):
            term = H[i, j] * w[j]
            gradient[i] += term
            rounding[i] += abs(term)
        rounding[i] *= ROUNDING


@compiled
def cholesky(H: np.ndarray, mu: float, held: np.ndarray, L: np.ndarray) -> bool:
    """L L' = H + mu I over the entries not held, those held replaced by the identity; False if
    it is not positive definite."""
    m = len(held)
    for i in range(m):
        for j in range(i + 1):
            if held[i] or held[j]:
                L[i, j] = 1.0 if i == j else 0.0
                continue
            rest = H[i, j] + (mu if i == j else 0.0)
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            if i > j:
                L[i, j] = rest / L[j, j]
            elif rest > 1e-14 * (abs(H[i, i]) + mu):
                L[i, i] = np.sqrt(rest)
            else:
                return False
    return True


@compiled
def cholesky_solve(L: np.ndarray, y: np.ndarray) -> None:
    """y becomes (L L')^-1 y."""
    m = len(y)
    for i in range(m):
        for k in range(i):
            y[i] -= L[i, k] * y[k]
        y[i] /= L[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            y[i] -= L[k, i] * y[k]
        y[i] /= L[i, i]
