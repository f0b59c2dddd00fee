"""An optimal control problem in discrete time, as the notes' methods take it (2.1.2, 2.4.6): DDP
and MPC.

    minimise J(U) = sum_(t<N) l(x_t, u_t) + l_f(x_N)   subject to  x_(t+1) = f(x_t, u_t),  x_0 given

Here are the interfaces of f and J, their expansion about a trajectory, and the rollout of a
policy.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from labs.errors import LabError
from labs.resumable import Resumable

LARGEST_STATE = 1e6
"""A state beyond this, in its units, has diverged."""


class Dynamics(Protocol):
    """x+ = f(x, u) and its derivatives."""

    @property
    def nx(self) -> int: ...
    @property
    def nu(self) -> int: ...
    def step(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """x+ (nx,)."""
        ...

    def linearize(self, X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """X+ (N, nx), f_x (N, nx, nx), f_u (N, nx, nu) at the first N points of X; U (N, nu)."""
        ...


class CostDerivatives(NamedTuple):
    """Of l at t < N, and in the last entry of those by x alone, of l_f."""

    l_x: np.ndarray
    """(N + 1, nx)"""
    l_u: np.ndarray
    """(N, nu)"""
    l_xx: np.ndarray
    """(N + 1, nx, nx)"""
    l_ux: np.ndarray
    """(N, nu, nx)"""
    l_uu: np.ndarray
    """(N, nu, nu)"""


class Cost(Protocol):
    """sum l(x_t, u_t) + l_f(x_N)."""

    def value(self, X: np.ndarray, U: np.ndarray) -> float:
        """Of a trajectory, X (N + 1, nx), U (N, nu)."""
        ...

    def derivatives(self, X: np.ndarray, U: np.ndarray, exact: bool) -> CostDerivatives:
        """Gradients, and Hessians exactly or by Gauss-Newton (never indefinite)."""
        ...


@dataclass(frozen=True, eq=False)
class OptimalControlProblem:
    """What is to be minimised, over N controls from x_0. `bound` (nu,) limits |u|; None: no
    limit. Raises LabError where shapes do not fit."""

    dynamics: Dynamics
    cost: Cost
    x0: np.ndarray
    N: int
    bound: np.ndarray | None = None

    def __post_init__(self) -> None:
        nx, nu = self.dynamics.nx, self.dynamics.nu
        if self.N < 1:
            raise LabError(f"N = {self.N}: a horizon has at least one step")
        if self.x0.shape != (nx,):
            raise LabError(f"x_0 has shape {self.x0.shape}; this system takes ({nx},)")
        if self.bound is not None and (self.bound.shape != (nu,) or not (self.bound > 0.0).all()):
            raise LabError(f"the bound on |u| is {self.bound}; it takes {nu} positive numbers")


class Expansion(NamedTuple):
    """First derivatives of the dynamics about a trajectory, second ones or none, and the cost's."""

    A: np.ndarray
    B: np.ndarray
    second: np.ndarray
    cost: CostDerivatives


def expand(
    problem: OptimalControlProblem, X: np.ndarray, U: np.ndarray, second_order: bool
) -> Resumable[Expansion]:
    """The derivatives of dynamics and cost along a trajectory."""
    _, A, B = problem.dynamics.linearize(X, U)
    second = np.empty((0, 0, 0, 0))
    if second_order:
        second = yield from second_derivatives(problem.dynamics, X, U)
    return Expansion(A, B, second, problem.cost.derivatives(X, U, second_order))


def second_derivatives(dynamics: Dynamics, X: np.ndarray, U: np.ndarray) -> Resumable[np.ndarray]:
    """f'' (N, nx, nx + nu, nx + nu) over (x, u), by central differences of the analytical f_x and
    f_u: Pinocchio has no second derivatives of forward dynamics. The error is some 1e-9 of f''."""
    N, n, m = len(U), dynamics.nx, dynamics.nu
    second = np.empty((N, n, n + m, n + m))
    for k in range(n + m):
        point = np.concatenate([X[:N], U], axis=1)
        eps = 1e-5 * np.maximum(1.0, np.abs(point[:, k]))
        yield
        sides = []
        for sign in (1.0, -1.0):
            moved = point.copy()
            moved[:, k] += sign * eps
            _, A, B = dynamics.linearize(moved[:, :n], moved[:, n:])
            sides.append(np.concatenate([A, B], axis=2))
        second[..., k] = (sides[0] - sides[1]) / (2.0 * eps[:, None, None])
    symmetric: np.ndarray = 0.5 * (second + second.transpose(0, 1, 3, 2))
    return symmetric


def rollout(
    problem: OptimalControlProblem, X: np.ndarray, U: np.ndarray, K: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """States, controls and cost under u = U + K (x - X), within the bound; cost infinite from
    where it diverges."""
    N, f, bound = problem.N, problem.dynamics.step, problem.bound
    new_X, new_U = np.empty((N + 1, len(problem.x0))), np.array(U)
    x = new_X[0] = problem.x0
    with np.errstate(all="ignore"):
        for t in range(N):
            u = new_U[t]
            u += K[t] @ (x - X[t])
            if bound is not None:
                np.clip(u, -bound, bound, out=u)
            x = new_X[t + 1] = f(x, u)
        if not np.abs(new_X).max() <= LARGEST_STATE:
            return new_X, new_U, np.inf
        return new_X, new_U, problem.cost.value(new_X, new_U)


def diverges_at(X: np.ndarray) -> int:
    """The first step of a diverged trajectory that is too far out."""
    with np.errstate(invalid="ignore"):
        return int(np.argmax(~(np.abs(X).max(axis=1) <= LARGEST_STATE)))
