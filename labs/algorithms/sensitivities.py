"""One step of x' = f(x, u) with its sensitivities (notes, 2.3.2): from x+ = Phi(x, u),

    A = dPhi/dx,    B = dPhi/du

For RK4 with k_1 = f(x, u), k_2 = f(x + h/2 k_1, u), k_3 = f(x + h/2 k_2, u), k_4 = f(x + h k_3, u):

    dk_1/dx = f_x|1                         dk_1/du = f_u|1
    dk_2/dx = f_x|2 (I + h/2 dk_1/dx)       dk_2/du = f_u|2 + h/2 f_x|2 dk_1/du
    dk_3/dx = f_x|3 (I + h/2 dk_2/dx)       dk_3/du = f_u|3 + h/2 f_x|3 dk_2/du
    dk_4/dx = f_x|4 (I + h dk_3/dx)         dk_4/du = f_u|4 + h f_x|4 dk_3/du
    A = I + h/6 (dk_1 + 2 dk_2 + 2 dk_3 + dk_4)/dx,  B alike with du and without the I

and the other methods of `labs.algorithms.integrators` by the same chain rule. Everything is done
for N points (x_i, u_i) at once: X (N, nx), U (N, nu) give X+ (N, nx), A (N, nx, nx),
B (N, nx, nu). The control is held during a step.
"""

from collections.abc import Callable, Mapping

import numpy as np

Derivatives = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""(X, U) to f (N, nx), f_x (N, nx, nx), f_u (N, nx, nu), as arrays of the caller's own."""

Sensitivities = tuple[np.ndarray, np.ndarray, np.ndarray]
"""X+, A, B."""


def explicit_euler(f: Derivatives, X: np.ndarray, U: np.ndarray, h: float) -> Sensitivities:
    """x+ = x + h f(x, u): A = I + h f_x, B = h f_u."""
    k, A, B = f(X, U)
    A *= h
    B *= h
    return X + h * k, _plus_identity(A), B


def semi_implicit_euler(f: Derivatives, X: np.ndarray, U: np.ndarray, h: float) -> Sensitivities:
    """v+ = v + h a(q, v, u), q+ = q + h v+. With the rows of v first, as in explicit Euler, those
    of q are the rows of the identity plus h times those of v+."""
    n = X.shape[1] // 2
    Y, A, B = explicit_euler(f, X, U, h)
    Y[:, :n] = X[:, :n] + h * Y[:, n:]
    A[:, :n] = np.eye(n, 2 * n) + h * A[:, n:]
    B[:, :n] = h * B[:, n:]
    return Y, A, B


def midpoint(f: Derivatives, X: np.ndarray, U: np.ndarray, h: float) -> Sensitivities:
    """x+ = x + h f(x + h/2 f(x, u), u)."""
    _, second = stages(f, X, U, (0.5 * h,))
    return X + h * second[0], _plus_identity(h * second[1]), h * second[2]


def rk4(f: Derivatives, X: np.ndarray, U: np.ndarray, h: float) -> Sensitivities:
    """The classical Runge-Kutta method."""
    found = stages(f, X, U, (0.5 * h, 0.5 * h, h))
    k, k_x, k_u = (
        h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4) for k1, k2, k3, k4 in zip(*found, strict=True)
    )
    return X + k, _plus_identity(k_x), k_u


SENSITIVITIES: Mapping[
    str, Callable[[Derivatives, np.ndarray, np.ndarray, float], Sensitivities]
] = {
    "explicit-euler": explicit_euler,
    "semi-implicit-euler": semi_implicit_euler,
    "midpoint": midpoint,
    "rk4": rk4,
}
"""By the names of `labs.algorithms.integrators.INTEGRATORS`."""


def stages(
    f: Derivatives, X: np.ndarray, U: np.ndarray, shifts: tuple[float, ...]
) -> list[Sensitivities]:
    """k_i, dk_i/dx, dk_i/du of all stages: the first is at x, stage i + 1 at x + shifts[i] k_i."""
    found = [f(X, U)]
    for shift in shifts:
        k, k_x, k_u = found[-1]
        slope, f_x, f_u = f(X + shift * k, U)
        found.append((slope, f_x + shift * f_x @ k_x, f_u + shift * f_x @ k_u))
    return found


def _plus_identity(A: np.ndarray) -> np.ndarray:
    diagonal = range(A.shape[1])
    A[:, diagonal, diagonal] += 1.0
    return A
