"""The steps shooting integrates by: dynamics and running cost together (notes, 2.3.2), in single
and multiple shooting.

The horizon is s = t / T in [0, 1], so that T is a control like any other and its derivatives come
by the same recursions: with w = (u, T), over K equal steps of h = 1 / K,

    dx/ds = T f(x, u),    c' = dc/ds = T l(x, u)

Stage 1 of a step is at P_1 = x, stage i + 1 at P_(i+1) = x + h a_i k_i with k_i = T f(P_i, u), and

    x+ = Phi(x, w) = x + h sum_i b_i k_i,    L(x, w) = h sum_i b_i T l(P_i, u)

L is what the step adds to c: the running cost by the augmented state (x, c). The notes' sum takes
L = h T l(x, u) instead, explicit Euler's, whatever the method. All is done for many steps at once:
X (K, nx), W (K, nu + 1).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from labs.algorithms.curvature import weighted_curvature
from labs.algorithms.sensitivities import Sensitivities, stages
from labs.errors import LabError
from labs.problems.continuous_control import ContinuousProblem
from labs.resumable import Resumable

CostForm = Literal["augmented", "sum"]
COST_FORMS: tuple[CostForm, ...] = ("augmented", "sum")


class ExplicitMethod(NamedTuple):
    """A Runge-Kutta method each of whose stages uses the one before it alone."""

    title: str
    order: int
    a: tuple[float, ...]
    b: tuple[float, ...]


SHOOTING_METHODS: Mapping[str, ExplicitMethod] = {
    "explicit-euler": ExplicitMethod("Explicit Euler", 1, (), (1.0,)),
    "midpoint": ExplicitMethod("Midpoint", 2, (0.5,), (0.0, 1.0)),
    "rk4": ExplicitMethod("Runge-Kutta 4", 4, (0.5, 0.5, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
}
"""By the names of `labs.algorithms.integrators.INTEGRATORS`."""


def shooting_method(name: str, N: int, M: int) -> ExplicitMethod:
    """The one of SHOOTING_METHODS for N pieces of M steps. Raises LabError where there is none."""
    if name not in SHOOTING_METHODS:
        raise LabError(f"no method is named {name!r}; there are {', '.join(SHOOTING_METHODS)}")
    if N < 1 or M < 1:
        raise LabError(f"N = {N}, M = {M}: there is at least one piece, and one step in each")
    return SHOOTING_METHODS[name]


def integrate_step(
    f: Callable[[np.ndarray, np.ndarray], np.ndarray],
    method: ExplicitMethod,
    x: np.ndarray,
    u: np.ndarray,
    h: float,
    P: np.ndarray,
) -> np.ndarray:
    """x+ after h [s] from x (nx,) under u (nu,); puts the stages into P (q, nx). Or of many at
    once, if f takes many: x (m, nx), u (m, nu), P (q, m, nx)."""
    P[0] = x
    k = f(x, u)
    moved = (method.b[0] * h) * k
    for i, shift in enumerate(method.a):
        P[i + 1] = point = x + (shift * h) * k
        k = f(point, u)
        moved += (method.b[i + 1] * h) * k
    moved += x
    return moved


class StepDerivatives(NamedTuple):
    """First derivatives of K steps, and the Hessian of L by Gauss-Newton if it was asked for."""

    A: np.ndarray
    """dPhi/dx (K, nx, nx)"""
    B: np.ndarray
    """dPhi/dw (K, nx, nu + 1)"""
    L_x: np.ndarray
    """(K, nx)"""
    L_w: np.ndarray
    """(K, nu + 1)"""
    L_zz: np.ndarray
    """(K, nz, nz) over z = (x, w), never indefinite; its row of T is zero. Or (0, 0, 0)."""


@dataclass(frozen=True, eq=False)
class ShootingSteps:
    """K steps of one method through the horizon of a problem."""

    problem: ContinuousProblem
    method: ExplicitMethod
    K: int
    form: CostForm

    def rollout(self, W: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """X (K + 1, nx) from x_0 and its stages P (K, q, nx), under W (K, nu + 1)."""
        X = np.empty((self.K + 1, len(self.problem.x0)))
        P = np.empty((self.K, len(self.method.b), X.shape[1]))
        x = X[0] = self.problem.x0
        f, method, h = self.problem.dynamics.f, self.method, W[:, -1] / self.K
        for X_next, P_j, u, h_j in zip(X[1:], P, W[:, :-1].copy(), h.tolist(), strict=True):
            x = X_next[:] = integrate_step(f, method, x, u, h_j, P_j)
        return X, P

    def running(self, P: np.ndarray, W: np.ndarray) -> float:
        """The running cost sum_j L_j, from the stages of a rollout."""
        U, h = W[:, :-1], W[:, -1] / self.K
        running = self.problem.cost.running
        return float(sum(b * (h @ running(P[:, i], U)) for i, b in self._nodes))

    def linearize(self, X: np.ndarray, W: np.ndarray, gauss_newton: bool) -> StepDerivatives:
        """At the first K points of X, or of any K points."""
        h, method = 1.0 / self.K, self.method
        X = X[: len(W)]
        k = stages(self._scaled_derivatives, X, W, tuple(h * a for a in method.a))
        A, B = (h * sum(b * part for b, part in zip(method.b, parts, strict=True))
                for parts in list(zip(*k, strict=True))[1:])  # fmt: skip
        A += np.eye(X.shape[1])
        nx, nw = B.shape[1:]
        L_z = np.zeros((len(W), nx + nw))
        L_zz = np.zeros((len(W), nx + nw, nx + nw) if gauss_newton else (0, 0, 0))
        for i, b in self._nodes:
            P, P_z = X, np.tile(np.eye(nx, nx + nw), (len(W), 1, 1))
            if i > 0:
                shift = h * method.a[i - 1]
                P = X + shift * k[i - 1][0]
                P_z += shift * np.concatenate(k[i - 1][1:], axis=2)
            self._add_running(P, P_z, W, h * b, L_z, L_zz)
        return StepDerivatives(A, B, L_z[:, :nx], L_z[:, nx:], L_zz)

    def hamiltonian_hessian(
        self, X: np.ndarray, W: np.ndarray, p: np.ndarray
    ) -> Resumable[np.ndarray]:
        """(K, nz, nz) of L + p' Phi over z = (x, w), with p (K, nx) the costates after the steps,
        by central differences of its gradient."""

        def derivatives(X: np.ndarray, W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            at = self.linearize(X, W, False)
            by_x = np.concatenate([at.A, at.L_x[:, None]], axis=1)
            by_w = np.concatenate([at.B, at.L_w[:, None]], axis=1)
            return by_x[:, :, 0], by_x, by_w  # the values themselves are not asked for

        weights = np.column_stack([p, np.ones(len(p))])
        return (yield from weighted_curvature(derivatives, X[: len(W)], W, weights))

    @property
    def _nodes(self) -> tuple[tuple[int, float], ...]:
        """The stages the running cost is taken at, with their weights."""
        if self.form == "sum":
            return ((0, 1.0),)
        return tuple((i, b) for i, b in enumerate(self.method.b) if b > 0.0)

    def _scaled_derivatives(self, X: np.ndarray, W: np.ndarray) -> Sensitivities:
        """T f and its derivatives over x and w."""
        f, f_x, f_u = self.problem.dynamics.derivatives(X, W[:, :-1])
        T = W[:, -1:]
        f_w = np.concatenate([T[:, :, None] * f_u, f[:, :, None]], axis=2)
        return T * f, T[:, :, None] * f_x, f_w

    def _add_running(
        self,
        P: np.ndarray,
        P_z: np.ndarray,
        W: np.ndarray,
        weight: float,
        L_z: np.ndarray,
        L_zz: np.ndarray,
    ) -> None:
        """Adds weight T l at the points P, with dP/dz (K, nx, nz), to gradient and Hessian."""
        cost, nx, U = self.problem.cost, P.shape[1], W[:, :-1]
        l = cost.running_derivatives(P, U, exact=False)  # noqa: E741 - the notes' l
        scale = weight * W[:, -1:]
        L_z += np.einsum("kij,ki->kj", P_z, scale * l.l_x)
        L_z[:, nx:-1] += scale * l.l_u
        L_z[:, -1] += weight * cost.running(P, U)
        if len(L_zz):
            y_z = np.concatenate([P_z, np.zeros((len(W), U.shape[1], P_z.shape[2]))], axis=1)
            y_z[:, range(nx, y_z.shape[1]), range(nx, y_z.shape[1])] = 1.0
            y_z[:, :, -1] = 0.0  # T: T l is no sum of squares
            full = np.block([[l.l_xx, l.l_ux.transpose(0, 2, 1)], [l.l_ux, l.l_uu]])
            L_zz += scale[:, :, None] * (y_z.transpose(0, 2, 1) @ full @ y_z)
