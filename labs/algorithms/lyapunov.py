"""Exponential Lyapunov functions (notes, B.1): conditions on V, and what they promise.

V is one of x+ = f(x) on a positively invariant set if for some alpha_1, alpha_2, alpha_3 > 0

    alpha_1 |x|^2 <= V(x) <= alpha_2 |x|^2,    V(f(x)) - V(x) <= -alpha_3 |x|^2

there, with squares as suit quadratic V (2.5.3). Then V(x_(k+1)) <= (1 - alpha_3 / alpha_2) V(x_k),
and with both bounds

    |x_k| <= c gamma^k |x_0|,    c = sqrt(alpha_2 / alpha_1),    gamma = sqrt(1 - alpha_3 / alpha_2)

Of x+ = A x and V = x' P x they are eigenvalues, exact and for all x; of any f and V they are taken
from samples, and are no better than these. A level set {V <= l} in which V decreases everywhere is
positively invariant, where it is bounded and in one piece: no step leads to a higher level.
"""

from dataclasses import dataclass

import numpy as np

from labs.errors import LabError
from labs.problems.polyhedron import Polyhedron

MAX_DOUBLINGS = 60
"""Of a sum of A'^k Q A^k, in which terms die out unless |A| is one to a relative 1e-17."""


@dataclass(frozen=True)
class LyapunovConstants:
    """The largest alpha_1 and alpha_3 and the least alpha_2 with which the conditions hold; a
    condition that holds with no positive number fails."""

    alpha_1: float
    alpha_2: float
    alpha_3: float

    @property
    def holds(self) -> bool:
        """Whether V is an exponential Lyapunov function."""
        return self.alpha_1 > 0.0 and self.alpha_3 > 0.0

    @property
    def c(self) -> float:
        """At least 1; NaN where V is no Lyapunov function."""
        return float(np.sqrt(self.alpha_2 / self.alpha_1)) if self.holds else np.nan

    @property
    def gamma(self) -> float:
        """In [0, 1); NaN where V is no Lyapunov function."""
        return float(np.sqrt(1.0 - self.alpha_3 / self.alpha_2)) if self.holds else np.nan

    def bound(self, steps: int) -> np.ndarray:
        """(steps + 1,): c gamma^k, of |x_k| / |x_0|."""
        return np.asarray(self.c * self.gamma ** np.arange(steps + 1))


def linear_constants(A: np.ndarray, P: np.ndarray) -> LyapunovConstants:
    """Of x+ = A x and V = x' P x, both (n, n), P symmetric: of all x, exact. The least eigenvalue
    of P, the largest, and the least of P - A' P A."""
    eigenvalues = np.linalg.eigvalsh(P)
    decrease = P - A.T @ P @ A
    least = np.linalg.eigvalsh(0.5 * (decrease + decrease.T))[0]
    return LyapunovConstants(float(eigenvalues[0]), float(eigenvalues[-1]), float(least))


def sampled_constants(X: np.ndarray, V: np.ndarray, V_next: np.ndarray) -> LyapunovConstants:
    """Of states X (k, n) with V(x) (k,) and V(f(x)) (k,): the conditions at these states alone,
    the origin left out. Raises LabError where there is no other."""
    squares = np.square(X).sum(axis=1)
    some = squares > 0.0
    if not some.any():
        raise LabError("no state but the origin: the conditions need others to be asked of")
    ratios, decreases = V[some] / squares[some], (V - V_next)[some] / squares[some]
    return LyapunovConstants(float(ratios.min()), float(ratios.max()), float(decreases.min()))


def solve_lyapunov(A: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """P (n, n) with A' P A - P + Q = 0: with V = x' P x, V(A x) - V(x) = -x' Q x. The sum of
    A'^k Q A^k by doubling, P <- P + A' P A, A <- A A. Raises LabError where it has no end: where
    A (n, n) has an eigenvalue on or outside the unit circle."""
    radius = float(np.abs(np.linalg.eigvals(A)).max())
    if not radius < 1.0:
        raise LabError(
            f"no P: A has an eigenvalue of magnitude {radius:.6g}, and the system must be stable"
        )
    P, power = 0.5 * (Q + Q.T), A
    for _ in range(MAX_DOUBLINGS):
        more = power.T @ P @ power
        P, power = P + more, power @ power
        if np.abs(more).max() <= 1e-17 * np.abs(P).max():
            break
    return np.asarray(0.5 * (P + P.T))


def largest_level_inside(P: np.ndarray, allowed: Polyhedron) -> float:
    """The largest l with {x' P x <= l} within {H x <= h}, P (n, n) positive definite:
    min of h_i^2 / (H_i P^-1 H_i'), which is exact; 0 where the origin is not allowed, infinite
    where nothing limits it."""
    if (allowed.h <= 0.0).any():
        return 0.0
    reach = np.einsum("ij,ji->i", allowed.H, np.linalg.solve(P, allowed.H.T))
    with np.errstate(divide="ignore"):
        return float((np.square(allowed.h) / reach).min(initial=np.inf))


def largest_invariant_level(V: np.ndarray, V_next: np.ndarray, allowed: np.ndarray) -> float:
    """The largest l such that V decreases at every state of the grid with V < l, and all of them
    are allowed: V, V(f) and `allowed` (...) on a grid, and the border is not allowed, for what lies
    behind it is not known. As fine as the grid; NaN in V is not allowed, NaN in V(f) no decrease.
    The origin, where V = 0, need not decrease; 0 where V is not positive elsewhere."""
    if (V <= 0.0).sum() > 1:
        return 0.0
    bad = ~allowed | np.isnan(V) | (~(V_next < V) & (V > 0.0))
    for axis in range(V.ndim):
        edges = np.moveaxis(bad, axis, 0)
        edges[0] = edges[-1] = True
    return float(np.where(np.isnan(V), np.inf, V)[bad].min())
