"""Second derivatives of the dynamics, or of an integrated step, as a Lagrangian's Hessian takes
them (notes, 2.3.1): at points (x_p, u_p), weighted by w_p (nx,),

    sum_k w_pk d^2 f_k / d(x, u)^2

by central differences of the analytical gradient of w_p' f, since Pinocchio has no second
derivatives of forward dynamics. The error is some 1e-10 of f''. Those by u alone are not looked
for where f is affine in u, as forces are in a mechanism's acceleration.
"""

from collections.abc import Callable

import numpy as np

from labs.algorithms.sensitivities import Derivatives
from labs.resumable import Resumable

DIFFERENCE_STEP = 1e-5
"""Of the differences, in parts of what is varied or of 1."""


def weighted_curvature(
    derivatives: Derivatives, X: np.ndarray, U: np.ndarray, weights: np.ndarray
) -> Resumable[np.ndarray]:
    """(k, nx + nu, nx + nu), from X (k, nx), U (k, nu), weights (k, nx)."""
    n, m = X.shape[1], U.shape[1]
    found = np.zeros((len(X), n + m, n + m))
    point = np.concatenate([X, U], axis=1)

    def change(direction: np.ndarray) -> np.ndarray:
        """Of the gradient of w' f (k, n + m), in differences of (k, n + m)."""
        sides = []
        for moved in (point + direction, point - direction):
            _, f_x, f_u = derivatives(moved[:, :n], moved[:, n:])
            f_z = np.concatenate([f_x, f_u], axis=2)
            sides.append(np.einsum("pk,pkj->pj", weights, f_z))
        return np.asarray(sides[0] - sides[1])

    for j in range(n + m):
        if j == n and not change(_generic_direction(n, m)[None])[:, n:].any():
            break
        eps = DIFFERENCE_STEP * np.maximum(1.0, np.abs(point[:, j]))
        direction = np.zeros_like(point)
        direction[:, j] = eps
        found[:, :, j] = change(direction) / (2.0 * eps[:, None])
        yield
    found[:, :n, n:] = found[:, n:, :n].transpose(0, 2, 1)
    symmetric: np.ndarray = 0.5 * (found + found.transpose(0, 2, 1))
    return symmetric


def weighted_constraint_curvature(
    jacobians: Callable[[np.ndarray], np.ndarray], X: np.ndarray, weights: np.ndarray
) -> Resumable[np.ndarray]:
    """sum_k w_pk d^2 g_k / dx^2 at the points X (k, nx), in the same way: (k, nx, nx) from the
    Jacobians (k, size, nx) and weights (k, size)."""
    no_control = np.zeros((len(X), 0))

    def derivatives(X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        J = jacobians(X)
        return J[:, :, 0], J, np.zeros((*J.shape[:2], 0))

    return (yield from weighted_curvature(derivatives, X, no_control, weights))


def _generic_direction(n: int, m: int) -> np.ndarray:
    """(n + m,) a direction along which only chance keeps f_u, were it not constant."""
    return np.concatenate([np.zeros(n), DIFFERENCE_STEP * (1.0 + np.sqrt(np.arange(1.0, m + 1.0)))])
