"""What nonlinear MPC solves at every period (notes, 2.5.1): a finite-horizon problem with limits.

    V_N(x) = minimise  sum_(k<N) l(x_k, u_k) + l_f(x_N) + gamma sum_(k=1..N) s_k
    subject to  x_(k+1) = f(x_k, u_k),   x_0 = x,   u_min <= u_k <= u_max
                x_min - s_k <= x_k <= x_max + s_k,   g(x_k) <= s_k,   s_k >= 0,   k = 1 ... N
                x_N = x_T where that is given

    l(x, u) = (x - xr)' Q (x - xr) / 2 + (u - ur)' R (u - ur) / 2
    l_f(x)  = (x - xr)' Q_f (x - xr) / 2

Hard limits have no slack, s = 0. Soft ones are an exact penalty: the slack s_k is by how much step
k exceeds the worst of its limits, each in its own unit; with gamma larger than every multiplier of
the hard problem, s is zero wherever the hard problem has a solution. Controls never have a slack.
"""

from dataclasses import dataclass

import numpy as np

from labs.errors import LabError
from labs.problems.continuous_control import StateConstraint
from labs.problems.linear_quadratic import check_shape, check_weight
from labs.problems.optimal_control import Dynamics


@dataclass(frozen=True, eq=False)
class NonlinearMpcProblem:
    """One problem for every x. Bounds may be infinite. Raises LabError where shapes do not fit,
    numbers are not finite, R is not positive definite, or Q or Q_f are not semidefinite."""

    dynamics: Dynamics
    N: int
    """At least 1."""
    Q: np.ndarray
    """(nx, nx)"""
    R: np.ndarray
    """(nu, nu)"""
    Q_f: np.ndarray
    """(nx, nx)"""
    x_ref: np.ndarray
    """xr (nx,)"""
    u_ref: np.ndarray
    """ur (nu,)"""
    x_lower: np.ndarray
    x_upper: np.ndarray
    u_lower: np.ndarray
    u_upper: np.ndarray
    path: StateConstraint | None = None
    """g"""
    x_final: np.ndarray | None = None
    """x_T (nx,), NaN where the end is free. It is never softened."""
    penalty: float | None = None
    """gamma; None: the limits are hard."""

    def __post_init__(self) -> None:
        if self.N < 1:
            raise LabError(f"N = {self.N}: a horizon has at least one step")
        nx, nu = self.nx, self.nu
        for name, shape in (
            ("Q", (nx, nx)),
            ("R", (nu, nu)),
            ("Q_f", (nx, nx)),
            ("x_ref", (nx,)),
            ("u_ref", (nu,)),
        ):
            check_shape(name, getattr(self, name), shape)
        for name, size in (("x", nx), ("u", nu)):
            lower, upper = getattr(self, f"{name}_lower"), getattr(self, f"{name}_upper")
            if lower.shape != (size,) or upper.shape != (size,) or not (lower < upper).all():
                raise LabError(
                    f"{name} lies between {lower} and {upper}; it takes ({size},) each, the lower "
                    "below the upper"
                )
        if self.x_final is not None and self.x_final.shape != (nx,):
            raise LabError(f"x_T has shape {self.x_final.shape}; this system takes ({nx},)")
        if self.penalty is not None and not 0.0 < self.penalty < np.inf:
            raise LabError(f"gamma = {self.penalty}: a penalty is positive and finite")
        check_weight("R", self.R[None], definite=True)
        check_weight("Q", self.Q[None])
        check_weight("Q_f", self.Q_f[None])

    @property
    def nx(self) -> int:
        return self.dynamics.nx

    @property
    def nu(self) -> int:
        return self.dynamics.nu

    @property
    def soft(self) -> bool:
        return self.penalty is not None

    def cost(self, X: np.ndarray, U: np.ndarray) -> float:
        """sum l + l_f of X (N + 1, nx), U (N, nu) of any length, without the penalty."""
        dX, dU = X - self.x_ref, U - self.u_ref
        running = np.vdot(dX[:-1] @ self.Q, dX[:-1]) + np.vdot(dU @ self.R, dU)
        return float(0.5 * (running + dX[-1] @ self.Q_f @ dX[-1]))
