"""Single shooting: the controls are the variables, the states follow from them (notes, 2.3.2).

The control is held on N equal pieces, u(t) = y_i for t in [t_i, t_(i+1)), and each piece is
integrated in M steps of a Runge-Kutta method (`labs.algorithms.shooting_steps`):

    minimise c(T; y) + l_f(x(T; y))   subject to   y within the bounds of u,   x(T; y) = x_T,
                                                   x_min <= x(t_i; y) <= x_max,   g(x(t_i; y)) <= 0

The dynamics are no constraint, and the variables y = (y_0, ..., y_(N-1)), with T behind them where
it is free, are few; but every state depends on all controls before it. By x_(j+1) = Phi(x_j, y),

    dx_(j+1)/dy = dPhi/dx dx_j/dy + dPhi/dy,    dx_0/dy = 0
    dJ/dy = sum_j (dL/dx dx_j/dy + dL/dy) + dl_f/dx dx_NM/dy

or, beyond the notes, by one sweep backward in time that needs no dx/dy (`labs.algorithms.adjoint`):

    p_j = dL/dx + dPhi/dx' p_(j+1),    p_NM = dl_f/dx,    dJ/dy = sum_j (dL/dy + dPhi/dy' p_(j+1))

The Hessian is sum_j Z_j' H_j Z_j + dx_NM/dy' l_f'' dx_NM/dy with Z_j = d(x_j, w_j)/dy: H_j that of
L + p' Phi, or by Gauss-Newton of L alone. Constraints enter it through p.
"""

from functools import cached_property
from typing import Literal, NamedTuple, final

import numpy as np
from scipy.sparse import csc_array

from labs.algorithms.adjoint import adjoint_gradient
from labs.algorithms.shooting_steps import CostForm, ShootingSteps, StepDerivatives, shooting_method
from labs.algorithms.state_constraints import StateConstraints
from labs.problems.continuous_control import ContinuousProblem
from labs.problems.nonlinear_program import ProgramDerivatives, ProgramValues
from labs.problems.optimal_control import LARGEST_STATE, diverges_at
from labs.resumable import Resumable

DifferenceScheme = Literal["forward", "central"]


class Rollout(NamedTuple):
    """What the controls y make of the state."""

    y: np.ndarray
    W: np.ndarray
    """(N M, nu + 1) control and T of every step."""
    X: np.ndarray
    """(N M + 1, nx)"""
    stages: np.ndarray
    """(N M, stages, nx)"""
    diverged: bool


@final
class SingleShooting:
    """A problem as a nonlinear programme (`labs.problems.nonlinear_program`) of n variables.
    `method` is a name of SHOOTING_METHODS; `form` is how the running cost is integrated. Raises
    LabError."""

    def __init__(
        self,
        problem: ContinuousProblem,
        N: int,
        M: int = 1,
        method: str = "rk4",
        form: CostForm = "augmented",
    ) -> None:
        scheme = shooting_method(method, N, M)
        self.problem, self.N, self.M = problem, N, M
        self.nx, self.nu = problem.dynamics.nx, problem.dynamics.nu
        self.free_time = problem.T_limits is not None
        self.n = N * self.nu + self.free_time
        self.steps = ShootingSteps(problem, scheme, N * M, form)
        self._constraints = StateConstraints(problem)
        self._rollout: Rollout | None = None

    # Variables --------------------------------------------------------------------------------

    def pack(self, U: np.ndarray, T: float | None = None) -> np.ndarray:
        """y (n,) of the controls U (N, nu) and, where it is free, the horizon T [s]."""
        return np.append(U, self.problem.T if T is None else T)[: self.n]

    def controls(self, y: np.ndarray) -> np.ndarray:
        """U (N, nu)."""
        return y[: self.N * self.nu].reshape(self.N, self.nu)

    def horizon(self, y: np.ndarray) -> float:
        """T [s]."""
        return float(y[-1]) if self.free_time else self.problem.T

    def times(self, y: np.ndarray) -> np.ndarray:
        """t_j of every step (N M + 1,) [s]."""
        return np.linspace(0.0, self.horizon(y), self.N * self.M + 1)

    @cached_property
    def lower(self) -> np.ndarray:
        limits = self.problem.T_limits or (0.0, 0.0)
        return self.pack(np.tile(self.problem.u_lower, (self.N, 1)), limits[0])

    @cached_property
    def upper(self) -> np.ndarray:
        limits = self.problem.T_limits or (0.0, 0.0)
        return self.pack(np.tile(self.problem.u_upper, (self.N, 1)), limits[1])

    # States and their sensitivities -----------------------------------------------------------

    def rollout(self, y: np.ndarray) -> Rollout:
        """The states under y. The last one is kept, and asked for again costs nothing."""
        kept = self._rollout
        if kept is not None and np.array_equal(kept.y, y):
            return kept
        U = np.repeat(self.controls(y), self.M, axis=0)
        W = np.column_stack([U, np.full(len(U), self.horizon(y))])
        with np.errstate(all="ignore"):
            X, P = self.steps.rollout(W)
            diverged = not np.abs(X).max() <= LARGEST_STATE
        self._rollout = Rollout(y.copy(), W, X, P, diverged)
        return self._rollout

    def diverges_at(self, y: np.ndarray) -> tuple[int, float]:
        """The step, from 1, at which a diverged rollout is too far out, and the time [s] there."""
        j = diverges_at(self.rollout(y).X)
        return j, float(self.times(y)[j])

    def sensitivities(self, at: StepDerivatives) -> np.ndarray:
        """dx_j/dy (N M + 1, nx, n), by the recursion of the notes."""
        nu, S = self.nu, np.zeros((self.N * self.M + 1, self.nx, self.n))
        for j, (A, B) in enumerate(zip(at.A, at.B, strict=True)):
            begin = j // self.M * nu
            end = begin + nu
            np.matmul(A, S[j, :, :end], out=S[j + 1, :, :end])
            S[j + 1, :, begin:end] += B[:, :nu]
            if self.free_time:
                S[j + 1, :, -1] = A @ S[j, :, -1] + B[:, nu]
        return S

    def end_sensitivities(self, y: np.ndarray, S: np.ndarray) -> np.ndarray:
        """(number of equalities, n): the derivative of what has to be zero at the end."""
        return np.asarray(self._constraints.end_jacobian(self.rollout(y).X[-1]) @ S[-1])

    def linearize(self, y: np.ndarray, gauss_newton: bool = False) -> StepDerivatives:
        """First derivatives of all steps along the rollout of y."""
        at = self.rollout(y)
        return self.steps.linearize(at.X, at.W, gauss_newton)

    # The cost and its gradient, in three ways -------------------------------------------------

    def cost(self, y: np.ndarray) -> float:
        """J(y); infinite where the rollout diverges."""
        at = self.rollout(y)
        if at.diverged:
            return np.inf
        with np.errstate(all="ignore"):
            J = self.steps.running(at.stages, at.W) + self.problem.cost.final(at.X[-1])
        return float(J) if np.isfinite(J) else np.inf

    def gradient_by_sensitivities(
        self, y: np.ndarray, at: StepDerivatives, S: np.ndarray
    ) -> np.ndarray:
        """dJ/dy (n,), from dx/dy."""
        final, _ = self.problem.cost.final_derivatives(self.rollout(y).X[-1], exact=False)
        through_x = np.tensordot(at.L_x, S[:-1], axes=2) + final @ S[-1]
        return np.asarray(through_x + self._to_variables(at.L_w))

    def gradient_by_adjoint(self, y: np.ndarray, at: StepDerivatives) -> np.ndarray:
        """dJ/dy (n,), from one sweep backward."""
        final, _ = self.problem.cost.final_derivatives(self.rollout(y).X[-1], exact=False)
        l_x = np.concatenate([at.L_x, final[None]])
        return self._to_variables(adjoint_gradient(at.A, at.B, l_x, at.L_w))

    def gradient_by_differences(
        self, y: np.ndarray, eps: float, kind: DifferenceScheme
    ) -> Resumable[np.ndarray]:
        """dJ/dy (n,), from n or 2 n more rollouts, y_k moved by eps (1 + |y_k|)."""
        gradient, J = np.empty(self.n), self.cost(y)
        for k in range(self.n):
            yield
            step = np.zeros(self.n)
            step[k] = eps * (1.0 + abs(y[k]))
            ahead = self.cost(y + step)
            behind = J if kind == "forward" else self.cost(y - step)
            gradient[k] = (ahead - behind) / (step[k] * (1.0 if kind == "forward" else 2.0))
        return gradient

    # As a nonlinear programme -----------------------------------------------------------------

    def values(self, y: np.ndarray) -> ProgramValues:
        X, constraints = self.rollout(y).X, self._constraints
        with np.errstate(all="ignore"):
            g = constraints.values(X[self.M :: self.M])
            return ProgramValues(self.cost(y), constraints.end_values(X[-1]), g.ravel())

    def derivatives(self, y: np.ndarray) -> ProgramDerivatives:
        """The gradient by the adjoint; the constraints' Jacobians by the sensitivities."""
        at, constraints = self.linearize(y), self._constraints
        f_y = self.gradient_by_adjoint(y, at)
        if not constraints.end_names and not constraints.size:
            none = csc_array((0, self.n))
            return ProgramDerivatives(f_y, none, none)
        S, X = self.sensitivities(at)[self.M :: self.M], self.rollout(y).X[self.M :: self.M]
        g_y = (constraints.jacobians(X) @ S).reshape(-1, self.n)
        c_y = self.end_sensitivities(y, S)
        return ProgramDerivatives(f_y, full_csc(c_y), csc_from_pattern(self._g_pattern, g_y))

    def hessian(
        self, y: np.ndarray, lam: np.ndarray, mu: np.ndarray, exact: bool
    ) -> Resumable[csc_array]:
        """Of L; full, as every control acts on all that follows."""
        at, steps = self.rollout(y), self.linearize(y, gauss_newton=not exact)
        yield
        S = self.sensitivities(steps)
        if not exact:
            return full_csc(self.gauss_newton_hessian(y, steps, S))
        gradient, final = self.problem.cost.final_derivatives(at.X[-1], exact)
        p = self._costates(at.X, steps, gradient, lam, mu)
        H = yield from self.steps.hamiltonian_hessian(at.X, at.W, p)
        X, S_i = at.X[self.M :: self.M], S[self.M :: self.M]
        bent = yield from self._constraints.curvature(X, mu.reshape(self.N, -1), lam)
        hessian = np.tensordot(S_i, bent @ S_i, axes=([0, 1], [0, 1]))
        return full_csc(self._assemble(S, H, final) + 0.5 * (hessian + hessian.T))

    def gauss_newton_hessian(self, y: np.ndarray, at: StepDerivatives, S: np.ndarray) -> np.ndarray:
        """(n, n) of J, from a linearisation with L_zz."""
        _, final = self.problem.cost.final_derivatives(self.rollout(y).X[-1], exact=False)
        return self._assemble(S, at.L_zz, final)

    def equality_name(self, i: int) -> str:
        return str(self._constraints.end_names[i])

    def inequality_name(self, i: int) -> str:
        piece, what = divmod(i, self._constraints.size)
        return f"{self._constraints.names[what]} at the end of piece {piece + 1} of {self.N}"

    def variable_name(self, i: int) -> str:
        if i == self.N * self.nu:
            return "the horizon T"
        piece, motor = divmod(i, self.nu)
        return f"{self.problem.u_names[motor]} in piece {piece + 1} of {self.N}"

    @cached_property
    def _w_y(self) -> np.ndarray:
        """dw_j/dy (N M, nu + 1, n): which variables the steps' controls are."""
        pieces = np.zeros((self.N, self.nu + 1, self.n))
        controls = pieces[:, :-1, : self.N * self.nu].reshape(self.N, self.nu, self.N, self.nu)
        controls[range(self.N), :, range(self.N)] = np.eye(self.nu)
        pieces[:, :-1, : self.N * self.nu] = controls.reshape(self.N, self.nu, -1)
        if self.free_time:
            pieces[:, -1, -1] = 1.0
        return np.repeat(pieces, self.M, axis=0)

    @cached_property
    def _g_pattern(self) -> np.ndarray:
        """(N m, n) whether a state at t_i may depend on a variable: on those before it, and T."""
        i, k = np.arange(1, self.N + 1), np.arange(self.n)
        acts = (k < i[:, None] * self.nu) | (k >= self.N * self.nu)
        return np.repeat(acts, self._constraints.size, axis=0)

    def _assemble(self, S: np.ndarray, H: np.ndarray, final: np.ndarray) -> np.ndarray:
        """sum_j Z_j' H_j Z_j + dx_NM/dy' l_f'' dx_NM/dy."""
        Z = np.concatenate([S[:-1], self._w_y], axis=1)
        hessian = S[-1].T @ final @ S[-1] + np.tensordot(Z, H @ Z, axes=([0, 1], [0, 1]))
        return np.asarray(0.5 * (hessian + hessian.T))

    def _to_variables(self, by_w: np.ndarray) -> np.ndarray:
        """d/dy (n,) from d/dw of every step (N M, nu + 1)."""
        pieces = by_w[:, :-1].reshape(self.N, self.M, self.nu).sum(axis=1)
        return self.pack(pieces, by_w[:, -1].sum())

    def _costates(
        self,
        X: np.ndarray,
        at: StepDerivatives,
        final: np.ndarray,
        lam: np.ndarray,
        mu: np.ndarray,
    ) -> np.ndarray:
        """p (N M, nx) after each step, of the Lagrangian: the constraints push, too."""
        push, constraints = np.zeros_like(X), self._constraints
        g_x = constraints.jacobians(X[self.M :: self.M])
        push[self.M :: self.M] = np.einsum("kmi,km->ki", g_x, mu.reshape(self.N, -1))
        push[-1] += final + lam @ constraints.end_jacobian(X[-1])
        p = push[1:]
        for j in range(len(p) - 1, 0, -1):
            p[j - 1] += at.L_x[j] + at.A[j].T @ p[j]
        return p


def full_csc(matrix: np.ndarray) -> csc_array:
    """The matrix with all its entries, also those that happen to be zero."""
    return csc_from_pattern(np.ones(matrix.shape, bool), matrix)


def csc_from_pattern(pattern: np.ndarray, matrix: np.ndarray) -> csc_array:
    """The entries of the matrix where the pattern is true."""
    columns, rows = np.nonzero(pattern.T)
    starts = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
    return csc_array((matrix[rows, columns], rows, starts), shape=matrix.shape)
