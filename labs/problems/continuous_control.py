"""An optimal control problem in continuous time (notes, 2.1.2), in the direct methods, Pontryagin's
and Hamilton-Jacobi-Bellman's.

    minimise int_0^T l(x, u) dt + l_f(x(T))
    subject to  x' = f(x, u),  x(0) = x_0,  and where they are given  x(T) = x_T,  e(x(T)) = 0,
                x_min <= x <= x_max,  u_min <= u <= u_max,  g(x) <= 0

T is fixed, or free within limits. All functions take many points at once: X (k, nx), U (k, nu).
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from labs.errors import LabError


class ContinuousDynamics(Protocol):
    """x' = f(x, u), as `labs.models.mechanisms.Mechanism`."""

    @property
    def nx(self) -> int: ...
    @property
    def nu(self) -> int: ...
    def f(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """x' (nx,) at one point."""
        ...

    def derivatives(
        self, X: np.ndarray, U: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """f (k, nx), f_x (k, nx, nx), f_u (k, nx, nu), arrays of the caller's own."""
        ...


class RunningDerivatives(NamedTuple):
    """Of l."""

    l_x: np.ndarray
    """(k, nx)"""
    l_u: np.ndarray
    """(k, nu)"""
    l_xx: np.ndarray
    """(k, nx, nx)"""
    l_ux: np.ndarray
    """(k, nu, nx)"""
    l_uu: np.ndarray
    """(k, nu, nu)"""


class ContinuousCost(Protocol):
    """int l dt + l_f."""

    def running(self, X: np.ndarray, U: np.ndarray) -> np.ndarray:
        """l (k,), per second."""
        ...

    def running_derivatives(self, X: np.ndarray, U: np.ndarray, exact: bool) -> RunningDerivatives:
        """Gradients, and Hessians exactly or by Gauss-Newton (never indefinite)."""
        ...

    def final(self, x: np.ndarray) -> float:
        """l_f at x (nx,)."""
        ...

    def final_derivatives(self, x: np.ndarray, exact: bool) -> tuple[np.ndarray, np.ndarray]:
        """Its gradient (nx,) and Hessian (nx, nx), exactly or by Gauss-Newton."""
        ...


class StateConstraint(Protocol):
    """g(x) <= 0 on the way, as that a tip stays out of obstacles; or e(x) = 0 at the end, as that
    it is at its target."""

    @property
    def size(self) -> int:
        """How many g has, for every x."""
        ...

    def values(self, X: np.ndarray) -> np.ndarray:
        """(k, size)"""
        ...

    def jacobians(self, X: np.ndarray) -> np.ndarray:
        """(k, size, nx)"""
        ...

    def name(self, i: int) -> str:
        """What g_i says, for a sentence: "the tip's distance from obstacle 1"."""
        ...


@dataclass(frozen=True, eq=False)
class ContinuousProblem:
    """What is to be minimised. Bounds may be infinite. Raises LabError where shapes do not fit."""

    dynamics: ContinuousDynamics
    cost: ContinuousCost
    x0: np.ndarray
    T: float
    """[s]; of a free one, where to begin."""
    x_lower: np.ndarray
    x_upper: np.ndarray
    u_lower: np.ndarray
    u_upper: np.ndarray
    x_final: np.ndarray | None = None
    """(nx,), NaN where the end is free."""
    T_limits: tuple[float, float] | None = None
    """[s] between which T is free."""
    path: StateConstraint | None = None
    """g"""
    end: StateConstraint | None = None
    """e"""
    x_names: tuple[str, ...] = ()
    """What each state is called in a sentence; empty: x_1, x_2, ..."""
    u_names: tuple[str, ...] = ()
    """Likewise of each control; empty: u_1, u_2, ..."""

    def __post_init__(self) -> None:
        nx, nu = self.dynamics.nx, self.dynamics.nu
        for what, n in (("x", nx), ("u", nu)):
            names = getattr(self, f"{what}_names") or tuple(f"{what}_{i + 1}" for i in range(n))
            if len(names) != n:
                raise LabError(f"{what}_names are {len(names)}; this system takes {n}")
            object.__setattr__(self, f"{what}_names", names)
        shapes = {"x_0": nx, "x_lower": nx, "x_upper": nx, "u_lower": nu, "u_upper": nu}
        given = (self.x0, self.x_lower, self.x_upper, self.u_lower, self.u_upper)
        for (name, n), array in zip(shapes.items(), given, strict=True):
            if array.shape != (n,):
                raise LabError(f"{name} has shape {array.shape}; this system takes ({n},)")
        if self.x_final is not None and self.x_final.shape != (nx,):
            raise LabError(f"x_T has shape {self.x_final.shape}; this system takes ({nx},)")
        if not 0.0 < self.T < np.inf:
            raise LabError(f"T = {self.T}: a horizon takes a positive time in seconds")
        if self.T_limits is not None and not 0.0 < self.T_limits[0] <= self.T <= self.T_limits[1]:
            raise LabError(
                f"T = {self.T} is to lie within its limits {self.T_limits}, from above 0"
            )
