"""The Riccati recursion, compiled: P_t and K_t from P_(t+1) (notes, 2.4.1).

In the arithmetic, with R + B' P B = L L' and Y = L^-1 (B' P A + S'):  K = -L'^-1 Y  and
P = Q + A' P A - Y' Y. One step takes some 4 n^2 (n + m) operations.
"""

import numpy as np

from labs.compiled import compiled


@compiled
def backward_pass(
    a: np.ndarray,
    b: np.ndarray,
    q: np.ndarray,
    r: np.ndarray,
    s: np.ndarray,
    values: np.ndarray,
    gains: np.ndarray,
) -> int:
    """Fills values (N + 1, n, n) from its last, and gains (N, m, n). The terms are stacks of N or
    1. Returns the step at which it fails, or -1."""
    steps, m, n = gains.shape
    pa, pb, h = np.empty((n, n)), np.empty((n, m)), np.empty((m, m))
    for t in range(steps - 1, -1, -1):
        sound = _step(
            a[t % len(a)],
            b[t % len(b)],
            q[t % len(q)],
            r[t % len(r)],
            s[t % len(s)],
            values[t + 1],
            values[t],
            gains[t],
            pa,
            pb,
            h,
        )
        if not sound:
            return t
    return -1


@compiled
def iterate(
    a: np.ndarray,
    b: np.ndarray,
    q: np.ndarray,
    r: np.ndarray,
    s: np.ndarray,
    values: np.ndarray,
    gain: np.ndarray,
    tolerance: float,
    most: int,
) -> tuple[int, float]:
    """Steps from P = values[0] until it rests; leaves P there and K in gain. Returns how many
    steps it took and the relative change in the last: infinite where that step fails, which
    leaves P and K as they were."""
    n, m = b.shape[1:]
    pa, pb, h = np.empty((n, n)), np.empty((n, m)), np.empty((m, m))
    next_gain, change = np.empty((m, n)), np.inf
    for count in range(1, most + 1):
        sound = _step(a[0], b[0], q[0], r[0], s[0], values[0], values[1], next_gain, pa, pb, h)
        if not sound:
            return count, np.inf
        change = relative_change(values[1], values[0])
        values[0], gain[:] = values[1], next_gain
        if change <= tolerance:
            return count, change
    return most, change


@compiled
def relative_change(new: np.ndarray, old: np.ndarray) -> float:
    """The largest |new_ij - old_ij| / sqrt(new_ii new_jj) of two semidefinite matrices (n, n): the
    same in all units of the coordinates."""
    n, largest = len(new), 0.0
    size = np.empty(n)
    for i in range(n):
        size[i] = np.sqrt(max(new[i, i], 0.0))
        for j in range(i + 1):
            change = abs(new[i, j] - old[i, j])
            if change > largest * size[i] * size[j]:
                product = size[i] * size[j]
                largest = change / product if product > 0.0 else np.inf
    return largest


@compiled
def _step(
    a: np.ndarray,
    b: np.ndarray,
    q: np.ndarray,
    r: np.ndarray,
    s: np.ndarray,
    p: np.ndarray,
    value: np.ndarray,
    gain: np.ndarray,
    pa: np.ndarray,
    pb: np.ndarray,
    h: np.ndarray,
) -> bool:
    """One step of the recursion: P_t into value (n, n) and K_t into gain (m, n) from P_(t+1) = p.
    pa (n, n), pb (n, m) and h (m, m) are workspaces. Sums run along rows, as memory does.
    Returns whether R + B' P B was positive definite and all stayed finite."""
    n, m = b.shape
    pa[:], pb[:], h[:], value[:] = 0.0, 0.0, r, q
    for i in range(n):
        for k in range(n):
            pik = p[i, k]
            for j in range(n):
                pa[i, j] += pik * a[k, j]
            for j in range(m):
                pb[i, j] += pik * b[k, j]
        for j in range(m):
            gain[j, i] = s[i, j]
    for k in range(n):
        for i in range(n):
            aki = a[k, i]
            for j in range(n):
                value[i, j] += aki * pa[k, j]
        for i in range(m):
            bki = b[k, i]
            for j in range(n):
                gain[i, j] += bki * pa[k, j]
            for j in range(m):
                h[i, j] += bki * pb[k, j]
    for i in range(m):  # h = L L' in its lower half, gain = L^-1 (B' P A + S')
        for k in range(i + 1):
            total = h[i, k]
            for j in range(k):
                total -= h[i, j] * h[k, j]
            if k < i:
                h[i, k] = total / h[k, k]
            elif total > 0.0:
                h[i, i] = np.sqrt(total)
            else:
                return False
        for k in range(i):
            for j in range(n):
                gain[i, j] -= h[i, k] * gain[k, j]
        for j in range(n):
            gain[i, j] /= h[i, i]
        for k in range(n):
            for j in range(n):
                value[k, j] -= gain[i, k] * gain[i, j]
    for i in range(m - 1, -1, -1):  # gain = -L'^-1 gain
        for k in range(i + 1, m):
            for j in range(n):
                gain[i, j] += h[k, i] * gain[k, j]
        for j in range(n):
            gain[i, j] /= -h[i, i]
    finite = True
    for i in range(n):
        for j in range(i + 1):
            value[i, j] = value[j, i] = 0.5 * (value[i, j] + value[j, i])
            finite = finite and np.isfinite(value[i, j])
    return bool(finite)
