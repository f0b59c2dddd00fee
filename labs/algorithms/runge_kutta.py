"""Runge-Kutta methods from their Butcher tableau, explicit and implicit (notes, A.1.3).

One step of x' = f(x, t) with q stages is

    k_i = f(x_n + h sum_j a_ij k_j, t_n + c_i h),    x_{n+1} = x_n + h sum_i b_i k_i

and the numbers a (q, q), b (q,), c (q,) are the tableau. With a_ij = 0 for j >= i each stage
needs only those before it: an explicit method, q evaluations of f. Otherwise the stages are the
unknowns of q n equations, solved here by Newton's method with the derivatives of f.

q is the number of stages, not the order. The order p is that of the global error O(h^p); the
local error is O(h^(p+1)). A method has order p when it meets the conditions up to p of
`order_conditions`; sum b = 1 alone is consistency. (p = q is possible up to q = 4 only, and
b_i >= 0 is not needed.)

`labs.algorithms.integrators` has four methods for q'' = a(q, v), without the tableau and fast
enough for a robot at 10 kHz. Explicit Euler, midpoint and RK4 there are EULER, MIDPOINT and RK4
here, on x = (q, v); semi-implicit Euler treats q and v apart and is no Runge-Kutta method.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from labs.algorithms.butcher_tableau import SUM_TOLERANCE, Tableau, parse_tableau

NEWTON_STEPS = 25
NEWTON_TOLERANCE = 1e-12
"""Newton stops when no component of the stage equations is off by more than this, relative to
1 + the largest |f|."""
ORDER_TOLERANCE = SUM_TOLERANCE
"""A condition of order counts as met within this."""


@dataclass(frozen=True)
class VectorField:
    """x' = f(x, t): f takes (n,) and a time to (n,), its jacobian df/dx to (n, n)."""

    f: Callable[[np.ndarray, float], np.ndarray]
    jacobian: Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True)
class RungeKuttaStep:
    """One step done."""

    x: np.ndarray
    """(n,) x_{n+1}."""
    evaluations: int
    """Of f; a Jacobian counts as n of them, what finite differences would take."""
    iterations: int
    """Newton's; 0 for an explicit method."""
    residual: float
    """Largest defect of the stage equations; 0 for an explicit method."""
    status: str
    """Why it stopped, in a sentence; empty when all is well."""


def runge_kutta_step(
    tableau: Tableau, field: VectorField, x: np.ndarray, t: float, h: float
) -> RungeKuttaStep:
    """x (n,) at time t to one h [s] later."""
    return (_explicit_step if tableau.explicit else _implicit_step)(tableau, field, x, t, h)


def runge_kutta_integrate(
    tableau: Tableau, field: VectorField, x: np.ndarray, h: float, steps: int
) -> tuple[np.ndarray, int]:
    """x after `steps` steps of h from t = 0, and the evaluations of f that took. Once a step
    fails the rest is NaN."""
    evaluations = 0
    for k in range(steps):
        done = runge_kutta_step(tableau, field, x, k * h, h)
        x, evaluations = done.x, evaluations + done.evaluations
        if done.status:
            return np.full_like(x, np.nan), evaluations
    return x, evaluations


def order_conditions(tableau: Tableau) -> np.ndarray:
    """(8,) what each condition of order 1 to 4 is off by, in this order:

    sum b = 1 | b.c = 1/2 | b.c^2 = 1/3, b.A c = 1/6 |
    b.c^3 = 1/4, (b c).A c = 1/8, b.A c^2 = 1/12, b.A A c = 1/24

    with powers and the product b c by components."""
    a, b, c = tableau.a, tableau.b, tableau.c
    found = [
        b.sum(),
        b @ c,
        b @ c**2,
        b @ a @ c,
        b @ c**3,
        (b * c) @ a @ c,
        b @ a @ c**2,
        b @ a @ a @ c,
    ]
    return np.array(found) - [1, 1 / 2, 1 / 3, 1 / 6, 1 / 4, 1 / 8, 1 / 12, 1 / 24]


def order(tableau: Tableau) -> int:
    """The order p as far as the conditions up to 4 tell: 0 (not consistent) to 4 (or more)."""
    off = np.abs(order_conditions(tableau)) > ORDER_TOLERANCE
    for p, (first, last) in enumerate(pairwise((0, 1, 2, 4, 8))):
        if off[first:last].any():
            return p
    return 4


def gauss_legendre(q: int) -> Tableau:
    """The implicit method of q stages and order 2q: collocation at the zeros of the Legendre
    polynomial, a_ij = integral of the j-th Lagrange polynomial from 0 to c_i, b_j to 1. q = 1 is
    the implicit midpoint rule."""
    c = (1.0 + np.polynomial.legendre.leggauss(q)[0]) / 2.0
    powers = np.arange(1, q + 1)
    lagrange = np.linalg.inv(np.vander(c, increasing=True))
    return Tableau((c[:, None] ** powers / powers) @ lagrange, (1.0 / powers) @ lagrange, c)


def _explicit_step(
    tableau: Tableau, field: VectorField, x: np.ndarray, t: float, h: float
) -> RungeKuttaStep:
    """Each stage from those before it."""
    a, c, f = h * tableau.a, h * tableau.c, field.f
    k = np.empty((tableau.stages, len(x)))
    k[0] = f(x, t)
    for i in range(1, tableau.stages):
        k[i] = f(x + a[i, :i] @ k[:i], t + c[i])
    return RungeKuttaStep(x + h * (tableau.b @ k), tableau.stages, 0, 0.0, "")


def _implicit_step(
    tableau: Tableau, field: VectorField, x: np.ndarray, t: float, h: float
) -> RungeKuttaStep:
    """All stages at once: zero of G_i(k) = k_i - f(x + h sum_j a_ij k_j, t + c_i h), whose
    derivative by k_j is [i = j] I - h a_ij df/dx at stage i."""
    q, n = tableau.stages, len(x)
    a, times = h * tableau.a, t + h * tableau.c
    k = np.tile(field.f(x, t), (q, 1))
    evaluations, residual = 1, np.inf
    for iteration in range(NEWTON_STEPS + 1):
        points = x + a @ k
        slopes = np.array([field.f(p, s) for p, s in zip(points, times, strict=True)])
        evaluations += q
        defect = k - slopes
        residual = float(np.abs(defect).max())
        if not np.isfinite(residual):
            break
        if residual <= NEWTON_TOLERANCE * (1.0 + float(np.abs(slopes).max())):
            return RungeKuttaStep(x + h * (tableau.b @ k), evaluations, iteration, residual, "")
        if iteration == NEWTON_STEPS:
            break
        derivatives = np.array([field.jacobian(p, s) for p, s in zip(points, times, strict=True)])
        evaluations += q * n
        blocks = np.eye(q * n).reshape(q, n, q, n) - np.einsum("ij,imn->imjn", a, derivatives)
        try:
            change = np.linalg.solve(blocks.reshape(q * n, q * n), defect.ravel())
        except np.linalg.LinAlgError:
            break
        k = k - change.reshape(q, n)
    why = f"Newton's method found no stages in {iteration} steps: residual {residual:.1e}."
    return RungeKuttaStep(x + h * (tableau.b @ k), evaluations, iteration, residual, why)


EULER = parse_tableau("0 | ; | 1")
MIDPOINT = parse_tableau("0 | ; 1/2 | 1/2; | 0 1")
HEUN = parse_tableau("0 | ; 1 | 1; | 1/2 1/2")
RK3 = parse_tableau("0 | ; 1/2 | 1/2; 1 | -1 2; | 1/6 2/3 1/6")
RK4 = parse_tableau("0 | ; 1/2 | 1/2; 1/2 | 0 1/2; 1 | 0 0 1; | 1/6 1/3 1/3 1/6")
IMPLICIT_EULER = parse_tableau("1 | 1; | 1")
TABLEAUS: Mapping[str, Tableau] = {
    "euler": EULER,
    "midpoint": MIDPOINT,
    "heun": HEUN,
    "rk3": RK3,
    "rk4": RK4,
    "implicit-euler": IMPLICIT_EULER,
    "implicit-midpoint": gauss_legendre(1),
    "gauss-legendre": gauss_legendre(2),
}
"""The named ones. RK3 is Kutta's method of order 3; Heun's is the explicit trapezoidal rule."""
