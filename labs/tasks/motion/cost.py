"""The cost of a motion, in DDP and in the direct methods: quadratic in state and control, and where
the tip ends.

    J = sum_(t<N) (x_t - x_ref)' Q (x_t - x_ref) + (u_t - u_ref)' R (u_t - u_ref)
        + (x_N - x_ref)' Q_f (x_N - x_ref) + rho |p(q_N) - p*|^2

with p(q) [m] the position of a mechanism's tip.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labs.models.mechanisms import Mechanism
from labs.problems.optimal_control import CostDerivatives

EPSILON = 1e-6
"""[rad] of the central differences that give the curvature of p."""


@dataclass(frozen=True, eq=False)
class TipCost:
    """rho |p(q) - p*|^2, with p* (3,) [m] and rho [1/m^2]."""

    mechanism: Mechanism
    target: np.ndarray
    rho: float

    def value(self, x: np.ndarray) -> float:
        """At x (nx,)."""
        error = self.mechanism.tip(x[: self.mechanism.nq]) - self.target
        return float(self.rho * error @ error)

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """(nq,): 2 rho J' (p - p*)."""
        q = x[: self.mechanism.nq]
        return self._gradient(q, self.mechanism.tip(q) - self.target)

    def hessian(self, x: np.ndarray, exact: bool) -> np.ndarray:
        """(nq, nq): 2 rho J'J, exactly with the curvature of p besides."""
        q = x[: self.mechanism.nq]
        J = self.mechanism.tip_jacobian(q)
        hessian = 2.0 * self.rho * J.T @ J
        if exact:
            error = self.mechanism.tip(q) - self.target
            for k, e in enumerate(np.eye(len(q)) * EPSILON):
                ahead, behind = self._gradient(q + e, error), self._gradient(q - e, error)
                hessian[:, k] += (ahead - behind) / (2.0 * EPSILON)
        symmetric: np.ndarray = 0.5 * (hessian + hessian.T)
        return symmetric

    def _gradient(self, q: np.ndarray, error: np.ndarray) -> np.ndarray:
        """2 rho J(q)' error."""
        gradient: np.ndarray = 2.0 * self.rho * self.mechanism.tip_jacobian(q).T @ error
        return gradient


@dataclass(frozen=True, eq=False)
class MotionCost:
    """J of N steps. Q, Q_f (nx, nx) and R (nu, nu) symmetric; x_ref (nx,) or (N + 1, nx), u_ref
    (nu,) or (N, nu)."""

    N: int
    Q: np.ndarray
    R: np.ndarray
    Q_f: np.ndarray
    x_ref: np.ndarray
    u_ref: np.ndarray
    tip_cost: TipCost | None = None

    def value(self, X: np.ndarray, U: np.ndarray) -> float:
        dX, dU = X - self.x_ref, U - self.u_ref
        running = np.vdot(dX[:-1] @ self.Q, dX[:-1]) + np.vdot(dU @ self.R, dU)
        final = dX[-1] @ self.Q_f @ dX[-1]
        return float(running + final) + (self.tip_cost.value(X[-1]) if self.tip_cost else 0.0)

    def derivatives(self, X: np.ndarray, U: np.ndarray, exact: bool) -> CostDerivatives:
        dX, dU = X - self.x_ref, U - self.u_ref
        l_x = 2.0 * dX @ self.Q
        l_x[-1] = 2.0 * self.Q_f @ dX[-1]
        l_xx, l_ux, l_uu = self._hessians
        if self.tip_cost:
            n, l_xx = self.tip_cost.mechanism.nq, l_xx.copy()
            l_x[-1, :n] += self.tip_cost.gradient(X[-1])
            l_xx[-1, :n, :n] += self.tip_cost.hessian(X[-1], exact)
        return CostDerivatives(l_x, 2.0 * dU @ self.R, l_xx, l_ux, l_uu)

    @cached_property
    def _hessians(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        nx, nu = len(self.Q), len(self.R)
        l_xx = np.tile(2.0 * self.Q, (self.N + 1, 1, 1))
        l_xx[-1] = 2.0 * self.Q_f
        return l_xx, np.zeros((self.N, nu, nx)), np.tile(2.0 * self.R, (self.N, 1, 1))
