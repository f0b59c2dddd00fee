"""Multiple shooting: between single shooting and collocation (notes, 2.3.4).

The control is held on N equal pieces as in single shooting, but the integration begins anew at the
start of each of m segments of pieces (`multiple_shooting_segments`), from a state s_i that is a
variable as well. Let x_i(t; s_i, y) start from s_i and t_i be the start of segment i:

    minimise  sum_i l_i(s_i, y) + l_f(x(T))        l_i: the running cost of segment i
    subject to  s_0 - x_0 = 0,   s_(i+1) - x_i(t_(i+1); s_i, y) = 0,   x(T) = x_T,   e(x(T)) = 0,
                u_min <= y <= u_max,   x_min <= x <= x_max and g(x) <= 0 at the end of every piece

x(T) is where the last segment ends. With m = 1 this is single shooting, with s_0 for x_0; with
m = N there is a state for every piece. Where a segment begins, x_min and x_max are bounds of s_i;
all else is asked of x as integrated. Segments know nothing of each other: they are integrated, and
differentiated as in single shooting, side by side as the rows of one batch. So a gap at t_(i+1)
has derivatives by s_i, the y of segment i, and s_(i+1) alone; the Hessian is a block a segment.
With lam_i the multiplier of the gap before segment i, -lam_i is the costate there.
"""

from typing import NamedTuple, final

import numpy as np
from scipy.sparse import csc_array

from labs.algorithms.assembly import Assembly, MatrixTerms
from labs.algorithms.multiple_shooting_segments import Segments, congruent_sums, masked_block_terms
from labs.algorithms.shooting_steps import (
    CostForm,
    ShootingSteps,
    StepDerivatives,
    integrate_step,
    shooting_method,
)
from labs.algorithms.state_constraints import StateConstraints
from labs.errors import LabError
from labs.problems.continuous_control import ContinuousProblem
from labs.problems.nonlinear_program import ProgramDerivatives, ProgramValues
from labs.problems.optimal_control import LARGEST_STATE
from labs.resumable import Resumable


class Arcs(NamedTuple):
    """What the variables make of the states, of K = N M steps in the order of time."""

    z: np.ndarray
    W: np.ndarray
    """(K, nu + 1) control and T of every step."""
    X: np.ndarray
    """(K, nx) where it starts,"""
    Y: np.ndarray
    """(K, nx) and where it ends."""
    stages: np.ndarray
    """(K, q, nx)"""
    diverged: bool


class SegmentSensitivities(NamedTuple):
    """By the k variables of the segment that a step is in."""

    at: StepDerivatives
    X_z: np.ndarray
    """(K, nx, k)"""
    Y_z: np.ndarray
    """(K, nx, k)"""


@final
class MultipleShooting:
    """A problem as a nonlinear programme (`labs.problems.nonlinear_program`) of n variables, with
    this many `segments`, from 1 to N. `method` is a name of SHOOTING_METHODS. Raises LabError."""

    def __init__(
        self,
        problem: ContinuousProblem,
        N: int,
        segments: int,
        M: int = 1,
        method: str = "rk4",
        form: CostForm = "augmented",
    ) -> None:
        scheme = shooting_method(method, N, M)
        if not 1 <= segments <= N:
            raise LabError(f"{segments} segments: there are from 1 to as many as pieces, N = {N}")
        self.problem, self.N, self.M = problem, N, M
        self.nx, self.nu = problem.dynamics.nx, problem.dynamics.nu
        self.free_time = problem.T_limits is not None
        self.segments = Segments(N, segments, M, self.nx, self.nu, self.free_time)
        self.n = self.segments.n
        self.steps = ShootingSteps(problem, scheme, N * M, form)
        self._constraints = StateConstraints(problem)
        T = problem.T_limits or (0.0, 0.0)
        X_lower, X_upper = (
            np.tile(bound, (segments, 1)) for bound in (problem.x_lower, problem.x_upper)
        )
        X_lower[0], X_upper[0] = -np.inf, np.inf  # s_0 is fixed
        self.lower = self.pack(X_lower, np.tile(problem.u_lower, (N, 1)), T[0])
        self.upper = self.pack(X_upper, np.tile(problem.u_upper, (N, 1)), T[1])
        self._asked = np.ones((N, self._constraints.size), bool)
        """Which inequalities there are at the ends of the pieces: no bounds where s_i has them."""
        bounds = self._constraints.size - (problem.path.size if problem.path else 0)
        self._asked[self.segments.pieces[1:-1] - 1, :bounds] = False
        self._c_z, self._g_z, self._l_zz = self._patterns()
        self._arcs: Arcs | None = None
        self._sensitivities: tuple[np.ndarray, SegmentSensitivities] | None = None

    # Variables --------------------------------------------------------------------------------

    def pack(self, S: np.ndarray, U: np.ndarray, T: float | None = None) -> np.ndarray:
        """z (n,) of the starts S (m, nx), controls U (N, nu) and, where it is free, T [s]."""
        z = np.empty(self.n)
        z[self.segments.starts], z[self.segments.controls] = S, U
        if self.free_time:
            z[-1] = self.problem.T if T is None else T
        return z

    def variables(self, X: np.ndarray, U: np.ndarray, T: float | None = None) -> np.ndarray:
        """z (n,) of a first guess X (N + 1, nx) at the ends of the pieces, U (N, nu)."""
        return self.pack(X[self.segments.pieces[:-1]], U, T)

    def horizon(self, z: np.ndarray) -> float:
        """T [s]."""
        return float(z[-1]) if self.free_time else self.problem.T

    def controls(self, z: np.ndarray) -> np.ndarray:
        """U (N, nu)."""
        return z[self.segments.controls]

    # Arcs and their sensitivities -------------------------------------------------------------

    def arcs(self, z: np.ndarray) -> Arcs:
        """All segments, integrated side by side. The last ones are kept."""
        if self._arcs is not None and np.array_equal(self._arcs.z, z):
            return self._arcs
        cut, f = self.segments, self.problem.dynamics.f
        W = np.empty((self.steps.K, self.nu + 1))
        W[:, :-1], W[:, -1] = np.repeat(self.controls(z), self.M, axis=0), self.horizon(z)
        X, Y = np.empty((2, self.steps.K, self.nx))
        P = np.empty((self.steps.K, len(self.steps.method.b), self.nx))

        def rates(X: np.ndarray, U: np.ndarray) -> np.ndarray:
            return np.array([f(x, u) for x, u in zip(X, U, strict=True)])

        x, h = z[cut.starts], self.horizon(z) / self.steps.K
        with np.errstate(all="ignore"):
            for j, running in enumerate(cut.running):
                rows = cut.first_steps[:running] + j
                X[rows] = x = x[:running]
                stages = np.empty((P.shape[1], *x.shape))
                Y[rows] = x = integrate_step(rates, self.steps.method, x, W[rows, :-1], h, stages)
                P[rows] = stages.swapaxes(0, 1)
            diverged = not (np.abs(Y).max() <= LARGEST_STATE and np.isfinite(z).all())
        self._arcs = Arcs(z.copy(), W, X, Y, P, diverged)
        return self._arcs

    def gaps(self, z: np.ndarray) -> np.ndarray:
        """(m - 1, nx): s_(i+1) - x_i(t_(i+1))."""
        ends = self.arcs(z).Y[self.segments.first_steps[1:] - 1]
        return np.asarray(z[self.segments.starts[1:]] - ends)

    def sensitivities(self, z: np.ndarray) -> SegmentSensitivities:
        """Of all arcs, by the recursion of single shooting in each segment: first dx/ds_i = I,
        dx/dy = 0. The last ones are kept."""
        if self._sensitivities is not None and np.array_equal(self._sensitivities[0], z):
            return self._sensitivities[1]
        cut, arcs = self.segments, self.arcs(z)
        at = self.steps.linearize(arcs.X, arcs.W, gauss_newton=True)
        X_z, Y_z = np.zeros((2, self.steps.K, self.nx, cut.columns.shape[1]))
        through_w = at.B @ cut.w_z
        x_z = np.tile(np.eye(self.nx, X_z.shape[2]), (cut.m, 1, 1))
        for j, running in enumerate(cut.running):
            rows = cut.first_steps[:running] + j
            X_z[rows] = x_z = x_z[:running]
            Y_z[rows] = x_z = at.A[rows] @ x_z + through_w[rows]
        found = SegmentSensitivities(at, X_z, Y_z)
        self._sensitivities = z.copy(), found
        return found

    # As a nonlinear programme -----------------------------------------------------------------

    def values(self, z: np.ndarray) -> ProgramValues:
        """At z (n,)."""
        arcs, constraints = self.arcs(z), self._constraints
        ends, first = arcs.Y[self.M - 1 :: self.M], z[self.segments.starts[0]]
        with np.errstate(all="ignore"):
            f = self.steps.running(arcs.stages, arcs.W) + self.problem.cost.final(ends[-1])
            gaps, end = self.gaps(z).ravel(), constraints.end_values(ends[-1])
            c = np.concatenate([first - self.problem.x0, gaps, end])
            g = constraints.values(ends)[self._asked]
        sound = not arcs.diverged and np.isfinite(f)
        return ProgramValues(f if sound else np.inf, c, g)

    def derivatives(self, z: np.ndarray) -> ProgramDerivatives:
        """At z (n,)."""
        cut, constraints = self.segments, self._constraints
        at, X_z, Y_z = self.sensitivities(z)
        ends = self.arcs(z).Y[self.M - 1 :: self.M]
        by_step = np.einsum("ki,kij->kj", at.L_x, X_z) + np.einsum("ki,kij->kj", at.L_w, cut.w_z)
        by_step[-1] += self.problem.cost.final_derivatives(ends[-1], exact=False)[0] @ Y_z[-1]
        joints = Y_z[cut.first_steps[1:] - 1]
        end = constraints.end_jacobian(ends[-1]) @ Y_z[-1]
        c_z = self._c_z.matrix(np.concatenate([np.ones(1), joints.ravel(), end.ravel()]))
        g_z = constraints.jacobians(ends) @ Y_z[self.M - 1 :: self.M]
        return ProgramDerivatives(cut.sum_by_variable(by_step), c_z, self._g_z.matrix(g_z.ravel()))

    def hessian(
        self, z: np.ndarray, lam: np.ndarray, mu: np.ndarray, exact: bool
    ) -> Resumable[csc_array]:
        """Of L (n, n), or by Gauss-Newton of f alone, without how T bends it: a sum over steps of
        d(x, w)/dz' H d(x, w)/dz with H that of L + p' Phi or of L, one block a segment."""
        cut, arcs = self.segments, self.arcs(z)
        at, X_z, Y_z = self.sensitivities(z)
        yield
        final_x, final_xx = self.problem.cost.final_derivatives(arcs.Y[-1], exact)
        H = at.L_zz
        at_ends = np.zeros((self.N, self.nx, self.nx))
        if exact:
            p = self._costates(arcs, at, final_x, lam, mu)
            H = yield from self.steps.hamiltonian_hessian(arcs.X, arcs.W, p)
            ends, last = arcs.Y[self.M - 1 :: self.M], lam[cut.m * self.nx :]
            bent = self._constraints.curvature(ends, self._all_inequality_multipliers(mu), last)
            at_ends += yield from bent
        at_ends[-1] += final_xx
        Z = np.concatenate([X_z, cut.w_z], axis=1)
        blocks = congruent_sums(Z, H, cut.pieces * self.M)
        blocks += congruent_sums(Y_z[self.M - 1 :: self.M], at_ends, cut.pieces)
        return self._l_zz.matrix(0.5 * (blocks + blocks.swapaxes(1, 2)).ravel())

    # Names ------------------------------------------------------------------------------------

    def equality_name(self, i: int) -> str:
        """What c_i says."""
        (segment, k), x = divmod(i, self.nx), self.problem.x_names
        if segment >= self.segments.m:
            return self._constraints.end_names[i - self.segments.m * self.nx]
        if segment == 0:
            return f"the start of {x[k]}"
        return f"the gap of {x[k]} between segments {segment} and {segment + 1}"

    def inequality_name(self, i: int) -> str:
        """What g_i says."""
        piece, what = np.argwhere(self._asked)[i]
        return f"{self._constraints.names[what]} at the end of piece {piece + 1} of {self.N}"

    def variable_name(self, i: int) -> str:
        """What z_i is."""
        if self.free_time and i == self.n - 1:
            return "the horizon T"
        cut, problem = self.segments, self.problem
        for names, what, where, many in (
            (problem.x_names, "at the start of segment", cut.starts, cut.m),
            (problem.u_names, "in piece", cut.controls, self.N),
        ):
            row, k = np.nonzero(where == i)
            if len(row):
                return f"{names[k[0]]} {what} {row[0] + 1} of {many}"
        raise IndexError(i)

    # Parts ------------------------------------------------------------------------------------

    def _patterns(self) -> tuple[Assembly, Assembly, Assembly]:
        """Of c_z, whose sources are a one, dx_i(t_(i+1))/dz of all gaps, and what has to be zero at
        the end; of g_z; of the Hessian."""
        cut, nx, (m, k) = self.segments, self.nx, self.segments.columns.shape
        rows, ends = np.arange(m * nx).reshape(m, nx), len(self._constraints.end_names)
        size, none = m * nx, np.zeros(m * nx, int)
        joints = (m - 1) * nx * k
        c_z = Assembly(
            (size + ends, self.n),
            1 + joints + ends * k,
            MatrixTerms(rows.ravel(), cut.starts.ravel(), none, np.ones(size)),
            masked_block_terms(rows[1:], cut.columns[:-1], 1, -1.0),
            masked_block_terms(size + np.arange(ends)[None], cut.columns[-1:], 1 + joints),
        )
        rows = np.where(self._asked, np.cumsum(self._asked).reshape(self._asked.shape) - 1, -1)
        shape = (int(self._asked.sum()), self.n)
        g_z = Assembly(shape, rows.size * k, masked_block_terms(rows, cut.columns_by_piece, 0))
        blocks = masked_block_terms(cut.columns, cut.columns, 0)
        return c_z, g_z, Assembly((self.n, self.n), m * k * k, blocks)

    def _all_inequality_multipliers(self, mu: np.ndarray) -> np.ndarray:
        """(N, size): the multipliers, 0 of inequalities that are not asked for."""
        found = np.zeros(self._asked.shape)
        found[self._asked] = mu
        return found

    def _costates(
        self, arcs: Arcs, at: StepDerivatives, final_x: np.ndarray, lam: np.ndarray, mu: np.ndarray
    ) -> np.ndarray:
        """p (K, nx) after each step, of the Lagrangian: at the end of a segment -lam of its gap,
        and what constraints push."""
        cut, constraints = self.segments, self._constraints
        p, ends = np.zeros_like(arcs.Y), slice(self.M - 1, None, self.M)
        g_x = constraints.jacobians(arcs.Y[ends])
        p[ends] = np.einsum("kmi,km->ki", g_x, self._all_inequality_multipliers(mu))
        p[cut.first_steps[1:] - 1] -= lam[self.nx : cut.m * self.nx].reshape(-1, self.nx)
        p[-1] += final_x + lam[cut.m * self.nx :] @ constraints.end_jacobian(arcs.Y[-1])
        starts = set(cut.first_steps.tolist())
        for j in range(len(p) - 1, 0, -1):
            if j not in starts:
                p[j - 1] += at.L_x[j] + at.A[j].T @ p[j]
        return p
