"""Absolute stability of Runge-Kutta methods: what a step does to x' = lambda x (notes, A.2).

One step multiplies x by the stability function of z = h lambda,

    R(z) = P(z) / Q(z) = det(I - z (A - 1 b^T)) / det(I - z A)

a polynomial for an explicit method (Q = 1). The error stays bounded where |R(z)| <= 1: the
region of absolute stability. A linear system x' = L x is stable under the method when h lambda
lies there for every eigenvalue lambda of L, so the region's edge limits h.
(Hairer, Wanner: Solving Ordinary Differential Equations II, IV.3.)
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labs.algorithms.runge_kutta import Tableau

ROUNDING = 1e-12
"""Coefficients of order one that are smaller than this are zero."""
GROWTH = 1e-7
"""A step that makes the state longer by more than this is seen as unstable."""


@dataclass(frozen=True, eq=False)
class StabilityFunction:
    """R = P / Q, coefficients of 1, z, z^2, ... ."""

    p: np.ndarray
    q: np.ndarray

    @classmethod
    def of(cls, tableau: Tableau) -> "StabilityFunction":
        ones = np.ones(tableau.stages)
        return cls(
            reversed_characteristic(tableau.a - np.outer(ones, tableau.b)),
            reversed_characteristic(tableau.a),
        )

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """R at complex z of any shape."""
        polynomial = np.polynomial.polynomial.polyval
        value: np.ndarray = polynomial(z, self.p) / polynomial(z, self.q)
        return value

    def growth(self, h: np.ndarray, eigenvalues: np.ndarray) -> np.ndarray:
        """max over lambda of |R(h lambda)| for each h (k,) [s]: the spectral radius of a step."""
        value: np.ndarray = np.abs(self(np.outer(h, eigenvalues))).max(axis=1)
        return value


def reversed_characteristic(m: np.ndarray) -> np.ndarray:
    """Coefficients of det(I - z M) in 1, z, ..., z^n, by Faddeev and LeVerrier: exact for the
    nilpotent A of explicit methods, where eigenvalues would lose half of the digits."""
    n = len(m)
    coefficients, power = [1.0], np.eye(n)
    for k in range(1, n + 1):
        product = m @ power
        coefficients.append(-float(np.trace(product)) / k)
        power = product + coefficients[-1] * np.eye(n)
    found = np.array(coefficients)
    found[np.abs(found) < ROUNDING] = 0.0
    return np.trim_zeros(found, "b")


def largest_step(r: StabilityFunction, eigenvalues: np.ndarray) -> float:
    """The largest h [s] up to which |R(h lambda)| <= 1 for all eigenvalues (m,) [1/s], from the
    zeros of |P|^2 - |Q|^2 on the ray through lambda; infinite when there is no limit, 0 when
    every step is too long."""
    return min((_along(r, value) for value in eigenvalues if abs(value) > 0.0), default=np.inf)


def boundary(r: StabilityFunction, reach: float, points: int = 240) -> np.ndarray:
    """Complex points in order along the edge |R(z)| = 1 that passes through z = 0, as far as
    |z| <= reach: the roots of P - e^(i theta) Q followed from theta = 0 until they return."""
    degree = max(len(r.p), len(r.q)) - 1
    if degree < 1:
        return np.zeros(0, complex)
    p, q = (np.pad(c, (0, degree + 1 - len(c))) for c in (r.p, r.q))
    angles = np.linspace(0.0, 2.0 * np.pi, points)[:-1] + 1e-6
    sheets = [np.roots((p - np.exp(1j * angle) * q)[::-1]) for angle in angles]
    edge = [complex(sheets[0][np.argmin(np.abs(sheets[0]))])]
    for roots in [*sheets[1:], sheets[0]] * degree:
        edge.append(_next(edge, roots))
        if abs(edge[-1]) > reach:  # the other half is its mirror image
            half = np.array(edge[:-1])
            return np.concatenate([half[::-1].conj(), half])
        if roots is sheets[0] and abs(edge[-1] - edge[0]) < ROUNDING:
            break
    return np.array(edge)


def measured_limit(growth: Callable[[float], float], lowest: float, highest: float) -> float:
    """The h at which a method starts to blow up: h is raised from `lowest` by a fifth at a time
    until growth(h), the factor of one step, passes 1, then halved in between. Infinite when it
    does not up to `highest`, 0 when it does from the start."""
    unstable = 1.0 + GROWTH
    low, high = 0.0, lowest
    while growth(high) <= unstable:
        if high >= highest:
            return np.inf
        low, high = high, min(1.2 * high, highest)
    if low == 0.0:
        return 0.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if growth(middle) <= unstable else (low, middle)
    return 0.5 * (low + high)


def spectral_radius(step: Callable[[np.ndarray], np.ndarray], n: int, small: float) -> float:
    """Of the derivative of a step (n,) -> (n,) at its fixed point 0, by central differences."""
    directions = small * np.eye(n)
    columns = [(step(d) - step(-d)) / (2.0 * small) for d in directions]
    derivative = np.array(columns)
    if not np.isfinite(derivative).all():
        return np.inf
    return float(np.abs(np.linalg.eigvals(derivative)).max())


def _along(r: StabilityFunction, eigenvalue: complex) -> float:
    """The largest h on one ray."""
    direction = eigenvalue / abs(eigenvalue)
    excess = np.polynomial.polynomial.polysub(_squared(r.p, direction), _squared(r.q, direction))
    excess[np.abs(excess) < ROUNDING] = 0.0
    excess = np.trim_zeros(excess, "b")
    if len(excess) == 0:
        return np.inf  # |R| = 1 all along
    roots = np.polynomial.polynomial.polyroots(excess)
    real = roots[np.abs(roots.imag) < 1e-6 * (1.0 + np.abs(roots))].real
    edges = [0.0, *sorted(value for value in real if value > 1e-9)]
    beyond = edges[-1] + 1.0
    for low, high in zip(edges, [*edges[1:], beyond], strict=True):
        if np.polynomial.polynomial.polyval(0.5 * (low + high), excess) > 0.0:
            return float(low / abs(eigenvalue))
    return np.inf


def _squared(coefficients: np.ndarray, direction: complex) -> np.ndarray:
    """|P(s direction)|^2 as a real polynomial in s."""
    turned = coefficients * direction ** np.arange(len(coefficients))
    value: np.ndarray = np.convolve(turned, turned.conj()).real
    return value


def _next(edge: list[complex], roots: np.ndarray) -> complex:
    """The root that continues the edge: nearest to where its last two points lead."""
    ahead = 2.0 * edge[-1] - edge[-2] if len(edge) > 1 else edge[-1]
    return complex(roots[np.argmin(np.abs(roots - ahead))])
