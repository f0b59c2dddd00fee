"""The linear quadratic regulator by dynamic programming (notes, 2.4.1 to 2.4.4).

For the problem of `linear_quadratic.py`, V_t(x) = min over u of the cost of step t + V_(t+1)(x+).
It stays quadratic, V_t(x) = x' P_t x: with P_N = Q_f, backward from t = N - 1,

    K_t = -(R + B' P_(t+1) B)^-1 (B' P_(t+1) A + S')
    P_t = Q + A' P_(t+1) A + (A' P_(t+1) B + S) K_t.

Linear and constant terms are carried by the augmented state (x, 1). In the arithmetic, with
R + B' P B = L L' and Y = L^-1 (B' P A + S'):  K = -L'^-1 Y  and  P = Q + A' P A - Y' Y.
One step takes some 4 n^2 (n + m) operations, so N steps take O(N).

As t decreases P_t usually converges to P_s (2.4.2), the fixed point of this map, the discrete
algebraic Riccati equation.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from labs.algorithms.stabilizability import require_detectable, require_stabilizable
from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.linear_quadratic import LqrPolicy, LqrProblem


def solve(problem: LqrProblem) -> LqrPolicy:
    """The optimal policy with its value at every step. Raises LabError where P leaves the range
    of numbers, as it does over long horizons where (A, B) is not stabilizable."""
    n, m, steps = problem.n, problem.m, problem.horizon
    terms = problem.terms if problem.homogeneous else problem.augmented()
    size = n if problem.homogeneous else n + 1
    gains, values = np.zeros((steps, m, size)), np.zeros((steps + 1, size, size))
    values[steps] = terms["q_final"][0]
    # Compiled for one layout of memory: another one would be compiled while somebody waits.
    a, b, q, r, s = (np.ascontiguousarray(terms[name]) for name in "abqrs")
    failed = _backward(a, b, q, r, s, values, gains)
    if failed >= 0:
        raise LabError(
            f"P grows beyond all numbers {steps - failed} steps before the end of N = {steps}: "
            "shorten the horizon, or give B a grip on what grows"
        )
    if problem.homogeneous:
        nothing = np.zeros((steps, m)), np.zeros((steps + 1, n)), np.zeros(steps + 1)
        return LqrPolicy(gains, values, *nothing)
    return LqrPolicy(
        gains=gains[:, :, :n].copy(),
        values=values[:, :n, :n].copy(),
        offsets=gains[:, :, n].copy(),
        linear=values[:, :n, n].copy(),
        constants=values[:, n, n].copy(),
    )


@dataclass(frozen=True, eq=False)
class SteadyState:
    """The policy u = K x for ever, its value x' P x, and how it was found."""

    gain: np.ndarray
    """K (m, n)."""
    value: np.ndarray
    """P (n, n), symmetric."""
    iterations: int
    """Steps of the recursion; 0 where SciPy solved the equation itself."""
    residual: float
    """Largest entry of one more step's change, as a share of P's largest."""
    trouble: str = ""
    """Empty where it is solved, else a sentence."""


def steady_state(
    a: np.ndarray,
    b: np.ndarray,
    q: np.ndarray,
    r: np.ndarray,
    tolerance: float = 1e-13,
    most: int = 100_000,
) -> SteadyState:
    """Iterates the recursion from P = Q until a step changes no entry of P by more than
    `tolerance` of the largest, at most `most` times. A (n, n), B (n, m), Q (n, n), R (m, m).
    Raises LabError where there is no steady state: (A, B) is not stabilizable, or Q does not see
    a mode that does not decay."""
    terms = _lasting(a, b, q, r)
    values, gain = np.stack([q, q]).astype(float), np.zeros(b.T.shape)
    iterations, residual = _iterate(*terms, values, gain, tolerance, most)
    trouble = ""
    if not residual <= tolerance:
        trouble = (
            f"After {iterations} steps of the recursion P still changes by {residual:.1e} of its "
            "size a step: allow more of them, or make the loop faster by raising Q or lowering R."
        )
    return SteadyState(gain, values[0].copy(), iterations, residual, trouble)


def steady_state_directly(
    a: np.ndarray, b: np.ndarray, q: np.ndarray, r: np.ndarray
) -> SteadyState:
    """The same by SciPy, from the eigenvectors of the extended symplectic pencil. Raises LabError
    as `steady_state` does, and where SciPy finds no solution."""
    terms = _lasting(a, b, q, r)
    try:
        p = solve_discrete_are(a, b, q, r)
    except np.linalg.LinAlgError as error:
        raise LabError(
            f"SciPy does not solve the Riccati equation ({error}): bring the weights closer "
            "together, or the step away from zero"
        ) from None
    values, gain = np.stack([p, p]), np.zeros(b.T.shape)
    residual = _iterate(*terms, values, gain, 0.0, 1)[1]
    return SteadyState(gain, p, 0, residual)


def prepare() -> None:
    """Compiles both recursions."""
    one = np.eye(1)
    solve(LqrProblem(1, one, one, one, one, one))
    steady_state(one, one, one, one)


def _lasting(
    a: np.ndarray, b: np.ndarray, q: np.ndarray, r: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, B, Q, R and S = 0 as stacks of one, checked for a steady state."""
    problem = LqrProblem(1, a, b, q, r, q)
    require_stabilizable(a, b)
    require_detectable(a, q)
    terms = problem.terms
    return terms["a"], terms["b"], terms["q"], terms["r"], terms["s"]


@compiled
def _backward(
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
def _iterate(
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
    steps it took and the relative change in the last."""
    n, m = b.shape[1:]
    pa, pb, h = np.empty((n, n)), np.empty((n, m)), np.empty((m, m))
    change = np.inf
    for count in range(1, most + 1):
        sound = _step(a[0], b[0], q[0], r[0], s[0], values[0], values[1], gain, pa, pb, h)
        size = np.abs(values[1]).max()
        change = np.abs(values[1] - values[0]).max() / size if size > 0.0 else 0.0
        values[0] = values[1]
        if not sound or change <= tolerance:
            return count, change
    return most, change


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
