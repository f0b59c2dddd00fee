"""The cost of a motion in continuous time, in shooting, collocation and Pontryagin's method to
come: of time, state and control, of limits passed, and of where and how fast it ends.

    l   = w_T + (x - x_ref)' Q (x - x_ref) + (u - u_ref)' R (u - u_ref) + w_s |excess(x)|^2
    l_f = (x - x_ref)' Q_f (x - x_ref) - c' x + rho |p(q) - p*|^2

excess(x) is what a state has beyond soft limits, and what a constraint g(x) <= 0 is missed by.
"""

from dataclasses import dataclass

import numpy as np

from labs.problems.continuous_control import RunningDerivatives, StateConstraint
from labs.tasks.motion.cost import TipCost


@dataclass(frozen=True, eq=False)
class SoftLimits:
    """w_s |excess(x)|^2, beyond `lower` and `upper` (nx,), infinite where there is none."""

    weight: float
    lower: np.ndarray
    upper: np.ndarray
    path: StateConstraint | None = None

    def value(self, X: np.ndarray) -> np.ndarray:
        """(k,)"""
        excess = self._excess(X)
        found = (excess**2).sum(axis=1)
        if self.path:
            found += (np.maximum(self.path.values(X), 0.0) ** 2).sum(axis=1)
        return np.asarray(self.weight * found)

    def derivatives(self, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradients (k, nx), and Hessians (k, nx, nx) without the curvature of g."""
        excess = self._excess(X)
        gradient = 2.0 * self.weight * excess
        hessian = np.zeros((*X.shape, X.shape[1]))
        diagonal = np.arange(X.shape[1])
        hessian[:, diagonal, diagonal] = 2.0 * self.weight * (excess != 0.0)
        if self.path:
            over, J = np.maximum(self.path.values(X), 0.0), self.path.jacobians(X)
            gradient += 2.0 * self.weight * np.einsum("ks,ksi->ki", over, J)
            missed = J * (over > 0.0)[:, :, None]
            hessian += 2.0 * self.weight * np.einsum("ksi,ksj->kij", missed, J)
        return gradient, hessian

    def _excess(self, X: np.ndarray) -> np.ndarray:
        return np.asarray(np.maximum(X - self.upper, 0.0) + np.minimum(X - self.lower, 0.0))


@dataclass(frozen=True, eq=False)
class ContinuousMotionCost:
    """int l dt + l_f, with Q, Q_f (nx, nx) and R (nu, nu) symmetric, c (nx,)."""

    w_T: float
    Q: np.ndarray
    R: np.ndarray
    Q_f: np.ndarray
    c: np.ndarray
    x_ref: np.ndarray
    u_ref: np.ndarray
    tip_cost: TipCost | None = None
    soft: SoftLimits | None = None

    def running(self, X: np.ndarray, U: np.ndarray) -> np.ndarray:
        """l (k,) at X (k, nx), U (k, nu)."""
        dX, dU = X - self.x_ref, U - self.u_ref
        found = self.w_T + ((dX @ self.Q) * dX).sum(axis=1) + ((dU @ self.R) * dU).sum(axis=1)
        return np.asarray(found + self.soft.value(X) if self.soft else found)

    def running_derivatives(self, X: np.ndarray, U: np.ndarray, exact: bool) -> RunningDerivatives:
        """Of l. Exact ones leave out the curvature of a soft g."""
        k, nx, nu = len(X), len(self.Q), len(self.R)
        l_x, l_u = 2.0 * (X - self.x_ref) @ self.Q, 2.0 * (U - self.u_ref) @ self.R
        l_xx, l_uu = np.tile(2.0 * self.Q, (k, 1, 1)), np.tile(2.0 * self.R, (k, 1, 1))
        if self.soft:
            by_x, by_xx = self.soft.derivatives(X)
            l_x, l_xx = l_x + by_x, l_xx + by_xx
        return RunningDerivatives(l_x, l_u, l_xx, np.zeros((k, nu, nx)), l_uu)

    def final(self, x: np.ndarray) -> float:
        """l_f at x (nx,)."""
        dx = x - self.x_ref
        found = float(dx @ self.Q_f @ dx - self.c @ x)
        return found + (self.tip_cost.value(x) if self.tip_cost else 0.0)

    def final_derivatives(self, x: np.ndarray, exact: bool) -> tuple[np.ndarray, np.ndarray]:
        """Of l_f: (nx,), (nx, nx)."""
        gradient, hessian = 2.0 * self.Q_f @ (x - self.x_ref) - self.c, 2.0 * self.Q_f
        if self.tip_cost:
            n = self.tip_cost.mechanism.nq
            hessian = hessian.copy()
            gradient[:n] += self.tip_cost.gradient(x)
            hessian[:n, :n] += self.tip_cost.hessian(x, exact)
        return gradient, hessian
