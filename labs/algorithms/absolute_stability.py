"""Absolute stability of Runge-Kutta methods: what a step does to x' = lambda x (notes, A.2).

One step multiplies x by the stability function of z = h lambda,

    R(z) = P(z) / Q(z) = det(I - z (A - 1 b^T)) / det(I - z A) = 1 + z b^T (I - z A)^-1 1

a polynomial for an explicit method (Q = 1). The error stays bounded where |R(z)| <= 1: the
region of absolute stability. A linear system x' = L x is stable under the method when h lambda
lies there for every eigenvalue lambda of L, so the region's edge limits h.
(Hairer, Wanner: Solving Ordinary Differential Equations II, IV.3.)
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from labs.algorithms.butcher_tableau import Tableau

ROUNDING = 1e-12
"""A sum whose terms cancel to less than this share of their sizes is zero. Never less than a
fixed number: the last coefficient of a method of many stages is small and decides its limit."""
UNSTABLE_GROWTH = 1e-7
"""A step that makes the state longer by more than this is seen as unstable."""


@dataclass(frozen=True, eq=False)
class StabilityFunction:
    """R = P / Q, coefficients of 1, z, z^2, ... ."""

    p: np.ndarray
    q: np.ndarray

    @classmethod
    def of(cls, tableau: Tableau) -> "StabilityFunction":
        """P is the product of Q and the series R = 1 + sum_k (b^T A^(k-1) 1) z^k, up to z^q. For
        an explicit method Q = 1, and nothing cancels."""
        q = reversed_characteristic_polynomial(tableau.a)
        powers = tableau.stages + 1
        p = np.convolve(q, _stability_series(tableau.a, tableau.b))[:powers]
        sizes = np.convolve(np.abs(q), _stability_series(np.abs(tableau.a), np.abs(tableau.b)))[
            :powers
        ]
        return cls(_trim_rounding(p, sizes), q)

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """R at complex z of any shape."""
        polynomial = np.polynomial.polynomial.polyval
        value: np.ndarray = polynomial(z, self.p) / polynomial(z, self.q)
        return value

    def spectral_radius(self, h: np.ndarray, eigenvalues: np.ndarray) -> np.ndarray:
        """max over lambda of |R(h lambda)| for each h (k,) [s]: the spectral radius of a step."""
        value: np.ndarray = np.abs(self(np.outer(h, eigenvalues))).max(axis=1)
        return value


def reversed_characteristic_polynomial(m: np.ndarray) -> np.ndarray:
    """Coefficients of det(I - z M) in 1, z, ..., z^n from Newton's identities,
    k c_k = -sum_(j<=k) tr(M^j) c_(k-j): exact for the nilpotent A of explicit methods, where
    eigenvalues would lose half of the digits."""
    n = len(m)
    powers = [np.linalg.matrix_power(m, k) for k in range(1, n + 1)]
    sizes = [np.linalg.matrix_power(np.abs(m), k) for k in range(1, n + 1)]
    coefficients, largest = np.eye(n + 1)[0], np.eye(n + 1)[0]
    for k in range(1, n + 1):
        coefficients[k] = (
            -sum(np.trace(powers[j - 1]) * coefficients[k - j] for j in _one_to(k)) / k
        )
        largest[k] = sum(np.trace(sizes[j - 1]) * largest[k - j] for j in _one_to(k)) / k
    return _trim_rounding(coefficients, largest)


def largest_stable_step(r: StabilityFunction, eigenvalues: np.ndarray) -> float:
    """The largest h [s] up to which |R(h lambda)| <= 1 for all eigenvalues (m,) [1/s], from the
    zeros of |P|^2 - |Q|^2 on the ray through lambda; infinite when there is no limit, 0 when
    every step is too long, however little it adds."""
    return min(
        (_largest_step_on_ray(r, value) for value in eigenvalues if abs(value) > 0.0),
        default=np.inf,
    )


def stability_boundary(r: StabilityFunction, reach: float, points: int = 240) -> np.ndarray:
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
        edge.append(_next_root(edge, roots))
        if abs(edge[-1]) > reach:  # the other half is its mirror image
            half = np.array(edge[:-1])
            return np.concatenate([half[::-1].conj(), half])
        if roots is sheets[0] and abs(edge[-1] - edge[0]) < ROUNDING:
            break
    return np.array(edge)


def bisect_stability_limit(
    growth: Callable[[float], float], lowest: float, highest: float
) -> float:
    """The h at which a method starts to blow up: h is raised from `lowest` by a fifth at a time
    until growth(h), the factor of one step, passes 1, then halved in between. Infinite when it
    does not up to `highest`, 0 when it does from the start."""
    unstable = 1.0 + UNSTABLE_GROWTH
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


def _largest_step_on_ray(r: StabilityFunction, eigenvalue: complex) -> float:
    """The largest h on one ray, s = h |lambda|: where excess(s) = |P|^2 - |Q|^2 first becomes
    positive. Between two zeros it has one sign; where it only touches zero, rounding may part
    the double one, and what lies between is no more than rounding."""
    excess, sizes = _excess(r, eigenvalue / abs(eigenvalue))
    if len(excess) == 0:
        return np.inf  # |R| = 1 all along
    evaluate = np.polynomial.polynomial.polyval
    edges = [0.0, *_positive_zeros(excess)]
    for low, high in zip(edges, [*edges[1:], 2.0 * edges[-1] + 1.0], strict=True):
        middle = 0.5 * (low + high)
        if evaluate(middle, excess) > ROUNDING * evaluate(middle, sizes):
            return float(low / abs(eigenvalue))
    return np.inf


def _excess(r: StabilityFunction, direction: complex) -> tuple[np.ndarray, np.ndarray]:
    """|P|^2 - |Q|^2 as a polynomial in s > 0 without its zeros at s = 0, trimmed, and the sizes of
    what its coefficients are sums of."""
    subtract, add = np.polynomial.polynomial.polysub, np.polynomial.polynomial.polyadd
    excess = subtract(_squared_magnitude(r.p, direction), _squared_magnitude(r.q, direction))
    sizes = add(_squared_magnitude(np.abs(r.p), 1.0), _squared_magnitude(np.abs(r.q), 1.0))
    excess = _trim_rounding(np.pad(excess, (0, len(sizes) - len(excess))), sizes)
    lowest = int(np.argmax(excess != 0.0)) if len(excess) else 0
    return excess[lowest:], sizes[lowest : len(excess)]


def _positive_zeros(polynomial: np.ndarray) -> list[float]:
    """Real zeros s > 0 in order, of coefficients (k,) of 1, s, ... whose first and last are not
    zero. They are looked for in s / unit, so that no coefficient is lost beside another."""
    degree = len(polynomial) - 1
    if degree < 1:
        return []
    unit = abs(polynomial[0] / polynomial[-1]) ** (1.0 / degree)
    scaled = polynomial * unit ** np.arange(degree + 1.0)
    roots = np.polynomial.polynomial.polyroots(scaled / np.abs(scaled).max())
    real = roots[np.abs(roots.imag) < 1e-6 * np.abs(roots)].real
    return sorted(float(unit * value) for value in real if value > 0.0)


def _stability_series(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(q + 1,) coefficients of 1 + z b^T (I - z A)^-1 1 up to z^q."""
    coefficients, stages = [1.0], np.ones(len(b))
    for _ in range(len(b)):
        coefficients.append(float(b @ stages))
        stages = a @ stages
    return np.array(coefficients)


def _trim_rounding(sums: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Coefficients (k,), those zero that are rounding beside the sizes (k,) of their terms,
    without zeros at the end."""
    return np.trim_zeros(np.where(np.abs(sums) > ROUNDING * sizes, sums, 0.0), "b")


def _one_to(k: int) -> range:
    return range(1, k + 1)


def _squared_magnitude(coefficients: np.ndarray, direction: complex) -> np.ndarray:
    """|P(s direction)|^2 as a real polynomial in s."""
    turned = coefficients * direction ** np.arange(len(coefficients))
    value: np.ndarray = np.convolve(turned, turned.conj()).real
    return value


def _next_root(edge: list[complex], roots: np.ndarray) -> complex:
    """The root that continues the edge: nearest to where its last two points lead."""
    ahead = 2.0 * edge[-1] - edge[-2] if len(edge) > 1 else edge[-1]
    return complex(roots[np.argmin(np.abs(roots - ahead))])
