"""Errors of an integration method as its step shrinks, and the orders they show (notes, A.2).

With x(t) the exact motion and x^(t, s, x(s)) what the method makes of it from time s on,

    local error   e(h) = |x(s + h) - x^(s + h, s, x(s))| = O(h^(p+1))     one step
    global error  E(h) = |x(T) - x^(T, 0, x(0))|         = O(h^p)         all steps up to T

where p is the order and |.| the Euclidean norm. On logarithmic axes both are straight
lines for small h; `fitted_order` fits them.
"""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from labs.algorithms.runge_kutta import RungeKuttaStep, VectorField

OneStepMethod = Callable[[np.ndarray, float, float], RungeKuttaStep]
"""(x (n,), t, h) to one step of a method."""

ROUNDING, ASYMPTOTIC = 1e-12, 0.5
"""Errors below the one are rounding, above the other too large to follow their power of h."""
FIT_POINTS = 3
"""Points a slope is fitted to: those of the smallest steps."""


def exact_solution(field: VectorField, x: np.ndarray, t0: float, t1: float) -> np.ndarray:
    """x(t1) (n,) from x(t0) = x, by SciPy's DOP853 at a relative tolerance of 1e-13."""
    solution = solve_ivp(
        lambda t, y: field.f(y, t), (t0, t1), x, method="DOP853", rtol=1e-13, atol=1e-14
    )
    end: np.ndarray = solution.y[:, -1]
    return end


def global_errors(
    step: OneStepMethod, x: np.ndarray, end: np.ndarray, duration: float, counts: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """(k,) E at T = `duration` [s] for each number of steps, `end` being x(T); and (k,) the
    evaluations of f it took. 0 stands for an error that is no number."""
    errors, costs = np.zeros(len(counts)), np.zeros(len(counts))
    for i, count in enumerate(counts):
        h, y = duration / count, x
        for k in range(count):
            done = step(y, k * h, h)
            y = np.full_like(x, np.nan) if done.status else done.x
            costs[i] += done.evaluations
        errors[i] = _finite_norm(y - end)
    return errors, costs


def local_errors(
    step: OneStepMethod, x: np.ndarray, t: float, ends: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """(k,) e of one step from x(t) = x for each h in `steps` (k,); `ends` (k, n) are x(t + h)."""
    done = [step(x, t, h) for h in steps]
    pairs = zip(done, ends, strict=True)
    return np.array([0.0 if d.status else _finite_norm(d.x - end) for d, end in pairs])


def fitted_order(h: np.ndarray, errors: np.ndarray) -> float:
    """d log(error) / d log(h), fitted to the smallest steps whose errors say anything; NaN when
    there are fewer than two."""
    use = np.flatnonzero((errors > ROUNDING) & (errors < ASYMPTOTIC))
    use = use[np.argsort(h[use])][:FIT_POINTS]
    if len(use) < 2:
        return float("nan")
    return float(np.polyfit(np.log(h[use]), np.log(errors[use]), 1)[0])


def _finite_norm(error: np.ndarray) -> float:
    size = float(np.linalg.norm(error))
    return size if np.isfinite(size) else 0.0
