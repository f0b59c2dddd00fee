"""Linear systems in discrete time: what one period of x' = A x + B u makes of x, u
held (notes, A.2).

    x+ = Phi x + Gamma u,   Phi = exp(A T),   Gamma = int_0^T exp(A s) ds B

exactly (zero-order hold; Åström and Wittenmark, Computer-Controlled Systems, 2.3), or as one of
`labs.algorithms.integrators` has it in T/h steps.
"""

from math import factorial

import numpy as np
from scipy.linalg import expm

from labs.algorithms.integrators import INTEGRATORS


def zero_order_hold(a: np.ndarray, b: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Phi = exp(A T) and Gamma = int_0^T exp(A s) ds B, both from one exponential."""
    n, m = b.shape
    both = expm(np.block([[a, b], [np.zeros((m, n + m))]]) * period)
    return both[:n, :n], both[:n, n:]


def zero_order_hold_integrated(
    integrator: str, step: float, a: np.ndarray, b: np.ndarray, period: float
) -> tuple[np.ndarray, np.ndarray]:
    """Phi and Gamma as this integrator makes them, in period/step steps with u held."""
    return repeat_held(*linear_step(integrator, step, a, b), round(period / step))


def repeat_held(p: np.ndarray, q: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """P^k and (P^(k-1) + ... + I) Q: k = `steps` steps x+ = P x + Q u, (n, n) and (n, m), under
    one u."""
    n, m = q.shape
    both = np.block([[p, q], [np.zeros((m, n)), np.eye(m)]])
    power = np.linalg.matrix_power(both, steps)
    return power[:n, :n].copy(), power[:n, n:].copy()


def linear_step(
    integrator: str, h: float, a: np.ndarray, b: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """P and Q of x+ = P x + Q u over one step. A Runge-Kutta method of as many stages as its
    order p (up to 4) has P = sum_(k<=p) (hA)^k / k! and Q = h sum_(k<p) (hA)^k / (k+1)! B."""
    eye = np.eye(len(a))
    if integrator == "semi-implicit-euler":
        half = len(a) // 2
        drift = eye + h * np.eye(len(a), k=half)
        kick = eye.copy()
        kick[half:] += h * a[half:]
        return drift @ kick, drift @ (h * b)
    order = INTEGRATORS[integrator].order
    powers = [np.linalg.matrix_power(h * a, k) for k in range(order + 1)]
    p = sum(power / factorial(k) for k, power in enumerate(powers))
    q = sum(power / factorial(k + 1) for k, power in enumerate(powers[:-1]))
    return np.asarray(p), h * np.asarray(q) @ b
