"""The quadratic programme of a Gauss-Newton step of nonlinear MPC, stage by stage (notes, 2.5.4).

About a trajectory X, U, whose x_0 is the measured state, it is the problem of
`labs.algorithms.nonlinear_mpc_problem` with, in the place of dynamics and constraint,

    x_(k+1) = y_k + A_k (x_k - X_k) + B_k (u_k - U_k)          y_k = f(X_k, U_k)
    g(X_k) + g_x (x_k - X_k) <= s_k

in the variables z = (u_0, x_1, s_1, u_1, x_2, s_2, ...), so that its matrices are banded and the
solver (piqp, by stages) takes a time linear in N. The variables are the states and controls
themselves, not their changes: only what A, B, g_x and y bring differs from one step to the next,
and where the cost has its minimum, if that moves. It is written into a structure that was set up
once. The Hessian is that of the cost, constant.
"""

from functools import lru_cache
from typing import NamedTuple, final

import numpy as np
import piqp
from scipy.sparse import csc_matrix

from labs.algorithms.assembly import Assembly, MatrixTerms, block_terms
from labs.algorithms.nonlinear_mpc_problem import NonlinearMpcProblem

MAX_ITERATIONS = 60
"""Of the solver, which otherwise needs 8 to 25."""


class Linearization(NamedTuple):
    """About a trajectory."""

    X: np.ndarray
    """(N + 1, nx)"""
    U: np.ndarray
    """(N, nu)"""
    Y: np.ndarray
    """(N, nx): f(X_k, U_k)."""
    A: np.ndarray
    """(N, nx, nx)"""
    B: np.ndarray
    """(N, nx, nu)"""
    g: np.ndarray
    """(N, size) at X_1 ... X_N"""
    g_x: np.ndarray
    """(N, size, nx)"""


class StageStep(NamedTuple):
    """What solves the programme."""

    X: np.ndarray
    """(N + 1, nx)"""
    U: np.ndarray
    """(N, nu)"""
    s: np.ndarray
    """(N,) slacks; zeros where limits are hard."""


@final
class StageQp:
    """The programmes of one problem over N steps. `tolerance` is of the solver's residuals, in
    units of the limits and of the largest weight."""

    def __init__(self, problem: NonlinearMpcProblem, N: int, tolerance: float = 1e-8) -> None:
        self.problem, self.N, self.tolerance = problem, N, tolerance
        nx, nu, soft = problem.nx, problem.nu, problem.soft
        self._u, self._x, self._s = _variable_indices(N, nx, nu, soft)
        self.n = N * (nu + nx + soft)
        self._scale, self._unit = _scales(problem)
        self._dynamics, final_rows = self._dynamics_pattern()
        self._b = np.zeros(self._dynamics.shape[0])
        self._b[N * nx :] = final_rows
        self._inequalities, self._h = self._inequality_pattern()
        self._P, self._c = self._hessian(), self._gradient()
        self._lower, self._upper = self._bounds()
        self._A = csc_matrix(self._dynamics.matrix(np.ones(self._sources)))
        G = self._inequalities
        self._G = csc_matrix(G.matrix(np.ones(self._g_sources))) if G else None
        self._solver: piqp.SparseSolver | None = None

    def set_reference(self, problem: NonlinearMpcProblem) -> None:
        """Solves this problem from now on, which differs in x_ref and u_ref alone."""
        if problem is not self.problem:
            self.problem = problem
            self._c = self._gradient()

    def solve(self, at: Linearization) -> StageStep | None:
        """Of this linearisation; None where nothing is found: it is infeasible."""
        self.write(at)
        return self.run(at.X[0])

    def write(self, at: Linearization) -> None:
        """Puts the values of a linearisation in their places."""
        N, nx = self.N, self.problem.nx
        scaled = at.B * self._scale
        sources = np.concatenate([np.ones(1), at.A[1:].ravel(), scaled.ravel()])
        self._A.data = self._dynamics.values(sources)
        b = self._b[: N * nx].reshape(N, nx)
        b[:] = at.Y
        b -= np.matmul(at.B, at.U[:, :, None])[:, :, 0]
        b[1:] -= np.matmul(at.A[1:], at.X[1:-1, :, None])[:, :, 0]
        if self._inequalities and self._G is not None and at.g.size:
            sources = np.concatenate([np.ones(1), at.g_x.ravel()])
            self._G.data = self._inequalities.values(sources)
            beyond = np.matmul(at.g_x, at.X[1:, :, None])[:, :, 0] - at.g
            self._h[-beyond.size :] = beyond.ravel()

    def run(self, x0: np.ndarray) -> StageStep | None:
        """Solves what was written."""
        if self.call_solver() != piqp.PIQP_SOLVED:
            return None
        assert self._solver is not None
        z = self._solver.result.x
        X = np.concatenate([x0[None], z[self._x]])
        s = z[self._s[:, 0]] if self.problem.soft else np.zeros(self.N)
        return StageStep(X, z[self._u] * self._scale, np.maximum(s, 0.0))

    def call_solver(self) -> piqp.Status:
        """The solver's own update and solve, nothing else; its first call sets it up."""
        h = self._h if self._G is not None else None
        if self._solver is None:
            self._solver = _solver(self.tolerance)
            given = (self._P, self._c, self._A, self._b, self._G, None, h)
            self._solver.setup(*given, self._lower, self._upper)
        else:
            self._solver.update(c=self._c, A=self._A, b=self._b, G=self._G, h_u=h)
        return self._solver.solve()

    # Parts ------------------------------------------------------------------------------------

    @property
    def _sources(self) -> int:
        nx, nu = self.problem.nx, self.problem.nu
        return 1 + (self.N - 1) * nx * nx + self.N * nx * nu

    @property
    def _g_sources(self) -> int:
        path = self.problem.path
        return 1 + (self.N * path.size * self.problem.nx if path else 0)

    def _dynamics_pattern(self) -> tuple[Assembly, np.ndarray]:
        """x_(k+1) - A_k x_k - B_k u_k of all stages, then the rows of x_N = x_T; and what those
        are to be."""
        last = self.problem.x_final
        fixed = np.flatnonzero(~np.isnan(last)) if last is not None else np.zeros(0, int)
        sizes = (self.N, self.problem.nx, self.problem.nu, self.problem.soft)
        assembly = _dynamics_assembly(*sizes, tuple(fixed.tolist()))
        return assembly, last[fixed] if last is not None else np.zeros(0)

    def _inequality_pattern(self) -> tuple[Assembly | None, np.ndarray]:
        """x - s <= x_max and -x - s <= -x_min where limits are soft, then g_x x - s; and their
        right-hand sides."""
        problem, N = self.problem, self.N
        size = problem.path.size if problem.path else 0
        terms, h, first = [], [], 0
        if problem.soft:
            for sign, bound in ((1.0, problem.x_upper), (-1.0, -problem.x_lower)):
                limited = np.flatnonzero(np.isfinite(bound))
                rows = first + np.arange(N * len(limited)).reshape(N, len(limited))
                columns = self._x[:, limited]
                terms.append(_constant_terms(rows.ravel(), columns.ravel(), sign))
                terms.append(_constant_terms(rows.ravel(), np.repeat(self._s, len(limited)), -1.0))
                h.append(np.tile(bound[limited], N))
                first += rows.size
        if size:
            rows = first + np.arange(N * size).reshape(N, size)
            terms.append(block_terms(rows, self._x, 1))
            if problem.soft:
                terms.append(_constant_terms(rows.ravel(), np.repeat(self._s, size), -1.0))
            h.append(np.zeros(N * size))
            first += rows.size
        if not first:
            return None, np.zeros(0)
        return Assembly((first, self.n), self._g_sources, *terms), np.concatenate(h)

    def _hessian(self) -> csc_matrix:
        problem = self.problem
        R = self._scale[:, None] * problem.R * self._scale
        blocks = (
            (self._u, R),
            (self._x[:-1], problem.Q),
            (self._x[-1:], problem.Q_f),
        )
        parts = [_block_entries(variables, weight) for variables, weight in blocks]
        row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
        return csc_matrix((value / self._unit, (row, column)), shape=(self.n, self.n))

    def _gradient(self) -> np.ndarray:
        """Of the cost at z = 0."""
        problem, c = self.problem, np.zeros(self.n)
        c[self._u] = -self._scale * (problem.R @ problem.u_ref)
        c[self._x] = -problem.Q @ problem.x_ref
        c[self._x[-1]] = -problem.Q_f @ problem.x_ref
        c[self._s] = problem.penalty or 0.0
        return c / self._unit

    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        problem = self.problem
        lower, upper = np.full((2, self.n), np.inf)
        lower *= -1.0
        lower[self._u], upper[self._u] = (
            problem.u_lower / self._scale,
            problem.u_upper / self._scale,
        )
        if problem.soft:
            lower[self._s] = 0.0
        else:
            lower[self._x], upper[self._x] = problem.x_lower, problem.x_upper
        return lower, upper


def _variable_indices(
    N: int, nx: int, nu: int, soft: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where u_k, x_(k+1) and s_(k+1) are in z: (N, nu), (N, nx), (N, 1 or 0)."""
    width = nu + nx + soft
    stages = np.arange(N * width).reshape(N, width)
    return stages[:, :nu], stages[:, nu : nu + nx], stages[:, nu + nx :]


@lru_cache(maxsize=128)
def _dynamics_assembly(N: int, nx: int, nu: int, soft: bool, fixed: tuple[int, ...]) -> Assembly:
    """Of sources 1, A_1 ... A_(N-1), B_0 ... B_(N-1); `fixed` are the states that x_T gives."""
    u, x, _ = _variable_indices(N, nx, nu, soft)
    rows = np.arange(N * nx).reshape(N, nx)
    ends = N * nx + np.arange(len(fixed))
    first_b = 1 + (N - 1) * nx * nx
    return Assembly(
        (N * nx + len(fixed), N * (nu + nx + soft)),
        first_b + N * nx * nu,
        _constant_terms(rows.ravel(), x.ravel()),
        block_terms(rows[1:], x[:-1], 1, -1.0),
        block_terms(rows, u, first_b, -1.0),
        _constant_terms(ends, x[-1, list(fixed)]),
    )


def _block_entries(variables: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, ...]:
    """Rows, columns and values of the same weight (n, n) on each of the variables (k, n)."""
    a, b = np.nonzero(weight)
    return variables[:, a].ravel(), variables[:, b].ravel(), np.tile(weight[a, b], len(variables))


def _scales(problem: NonlinearMpcProblem) -> tuple[np.ndarray, float]:
    """The units of the controls (nu,), the middle of their limits where there are any, and of the
    cost: so that numbers are of the size of one."""
    width = 0.5 * (problem.u_upper - problem.u_lower)
    weight = np.abs(np.concatenate([np.diag(problem.Q), np.diag(problem.Q_f)])).max()
    unit = float(weight) or 1.0
    return np.where(np.isfinite(width), width, np.sqrt(unit / np.diag(problem.R))), unit


def _constant_terms(rows: np.ndarray, columns: np.ndarray, coefficient: float = 1.0) -> MatrixTerms:
    """The coefficient itself: its source is the first, a one."""
    return MatrixTerms(rows, columns, np.zeros(len(rows), int), np.full(len(rows), coefficient))


def _solver(tolerance: float) -> piqp.SparseSolver:
    solver = piqp.SparseSolver()
    solver.settings.kkt_solver = piqp.sparse_multistage
    solver.settings.max_iter = MAX_ITERATIONS
    solver.settings.preconditioner_iter = 0  # it would scale back and forth what stays the same
    for name in ("eps_abs", "eps_rel", "eps_duality_gap_abs", "eps_duality_gap_rel"):
        setattr(solver.settings, name, tolerance)
    return solver
