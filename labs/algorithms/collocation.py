"""Direct collocation (notes, 2.3.3): states and controls on a grid of N steps of h = T / N are
the variables, in the order of time, and T at the end where it is free,

    z = (s_0, y_0, s_1, y_1, ..., s_N[, y_N][, T])

    minimise  sum_p T w_p l(x_p, u_p) + l_f(s_N)
    subject to  s_0 = x_0,   each step's defects = 0 (`collocation_schemes`),   s_N = x_T,
                e(s_N) = 0,  x_min <= s_i <= x_max,  u_min <= y_i <= u_max,  g(s_i) <= 0

The points (x_p, u_p) where f and l are asked for are linear in z, and so are the defects but for
f (`collocation_grid`). So every entry of the derivatives is a sum of constant multiples of the
dynamics' and the cost's own: a pattern known beforehand, filled in by one product (`assembly`).
Defects have the units of a state. With lam the multiplier of a step's, -lam is the costate.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array

from labs.algorithms.collocation_grid import CollocationGrid
from labs.algorithms.collocation_patterns import derivative_assemblies
from labs.algorithms.collocation_schemes import SCHEMES
from labs.algorithms.curvature import weighted_constraint_curvature, weighted_curvature
from labs.errors import LabError
from labs.problems.continuous_control import ContinuousProblem
from labs.problems.nonlinear_program import ProgramDerivatives, ProgramValues
from labs.resumable import Resumable


class CollocationTrajectory(NamedTuple):
    """What the variables say."""

    T: float
    """[s]"""
    X: np.ndarray
    """(N + 1, nx) at the times i T / N."""
    U: np.ndarray
    """(k, nu): N controls, each of a step; or one at each block of the scheme."""


class Collocation:
    """The nonlinear programme, by the rule of this name, a key of SCHEMES. Raises LabError."""

    def __init__(self, problem: ContinuousProblem, N: int, scheme: str = "midpoint") -> None:
        if scheme not in SCHEMES:
            raise LabError(f"no rule is named {scheme!r}; there are {', '.join(SCHEMES)}")
        if N < 1:
            raise LabError(f"N = {N}: a grid has at least one step")
        nx, nu = problem.dynamics.nx, problem.dynamics.nu
        self.problem, self.N, self.scheme = problem, N, SCHEMES[scheme]
        self.grid = CollocationGrid(self.scheme, N, nx, nu)
        self.free_time = problem.T_limits is not None
        self.n = self.grid.n + self.free_time
        x_final = np.full(nx, np.nan) if problem.x_final is None else problem.x_final
        self._ends = np.flatnonzero(~np.isnan(x_final))
        """Components of x_T that are given."""
        sizes = [nx, self.grid.rows.size, len(self._ends), problem.end.size if problem.end else 0]
        self._starts = np.cumsum([0, *sizes])
        """Where x_0, the defects, x_T and e begin among the equalities; and how many there are."""
        self._x_final = x_final[self._ends]
        self.lower, self.upper = self._bounds()
        self._c_y, self._g_y, self._l_yy = derivative_assemblies(
            problem, self.grid, self._starts, self._ends
        )

    # What the variables say ------------------------------------------------------------------

    def horizon(self, y: np.ndarray) -> float:
        """T [s]."""
        return float(y[-1]) if self.free_time else self.problem.T

    def trajectory(self, y: np.ndarray) -> CollocationTrajectory:
        """Of the variables (n,)."""
        return CollocationTrajectory(self.horizon(y), y[self.grid.nodes], y[self.grid.controls])

    def variables(self, X: np.ndarray, U: np.ndarray, T: float | None = None) -> np.ndarray:
        """(n,) of a trajectory X (N + 1, nx), U (N, nu), as a first guess: between grid points
        states are interpolated, and a control at a point is that of the step after it."""
        y, grid, stride = np.empty(self.n), self.grid, self.scheme.stride
        y[grid.nodes] = X
        if stride == 2:
            y[grid.states[1::2]] = 0.5 * (X[1:] + X[:-1])
        y[grid.controls] = U[np.minimum(np.arange(len(grid.controls)) // stride, self.N - 1)]
        if self.free_time:
            y[-1] = self.problem.T if T is None else T
        return y

    def defects(self, c: np.ndarray) -> np.ndarray:
        """(N, nx): of the equalities, by how much each step ends elsewhere than s_(i+1)."""
        return np.asarray(c[self._starts[1] + self.grid.rows[:, -1]])

    # The programme ---------------------------------------------------------------------------

    def values(self, y: np.ndarray) -> ProgramValues:
        """At y (n,)."""
        problem, T = self.problem, self.horizon(y)
        nodes, (X, U) = y[self.grid.nodes], self._points(y)
        with np.errstate(all="ignore"):
            F = np.array([problem.dynamics.f(x, u) for x, u in zip(X, U, strict=True)])
            f = T * float(self.grid.weights @ problem.cost.running(X, U))
            f += problem.cost.final(nodes[-1])
            defects = self.grid.D @ y[: self.grid.n] - T * (self.grid.W @ F.ravel())
            ends = nodes[-1, self._ends] - self._x_final
            e = problem.end.values(nodes[-1:]).ravel() if problem.end else np.zeros(0)
            c = np.concatenate([nodes[0] - problem.x0, defects, ends, e])
            g = problem.path.values(nodes).ravel() if problem.path else np.zeros(0)
        sound = np.isfinite(f) and np.isfinite(c).all() and np.isfinite(g).all()
        return ProgramValues(f if sound else np.inf, c, g)

    def derivatives(self, y: np.ndarray) -> ProgramDerivatives:
        """At y (n,)."""
        problem, grid, T = self.problem, self.grid, self.horizon(y)
        nodes, (X, U) = y[grid.nodes], self._points(y)
        F, f_z = self._dynamics(X, U)
        slopes = problem.cost.running_derivatives(X, U, exact=False)
        l_z = grid.weights[:, None] * np.concatenate([slopes.l_x, slopes.l_u], axis=1)
        f_y = np.zeros(self.n)
        f_y[: grid.n] = T * (grid.E.T @ l_z.ravel())
        f_y[grid.nodes[-1]] += problem.cost.final_derivatives(nodes[-1], exact=False)[0]
        sources = [np.ones(1), T * f_z.ravel()]
        if self.free_time:
            f_y[-1] = grid.weights @ problem.cost.running(X, U)
            sources.append(grid.W @ F.ravel())
        if problem.end:
            sources.append(problem.end.jacobians(nodes[-1:]).ravel())
        by_path = problem.path.jacobians(nodes).ravel() if problem.path else np.zeros(0)
        c_y = self._c_y.matrix(np.concatenate(sources))
        return ProgramDerivatives(f_y, c_y, self._g_y.matrix(by_path))

    def hessian(
        self, y: np.ndarray, lam: np.ndarray, mu: np.ndarray, exact: bool
    ) -> Resumable[csc_array]:
        """Of L (n, n), or by Gauss-Newton of f alone, without how T bends it."""
        problem, grid, T = self.problem, self.grid, self.horizon(y)
        nodes, (X, U) = y[grid.nodes], self._points(y)
        second = problem.cost.running_derivatives(X, U, exact)
        upper = np.concatenate([second.l_xx, second.l_ux.transpose(0, 2, 1)], axis=2)
        lower = np.concatenate([second.l_ux, second.l_uu], axis=2)
        l_zz = (T * grid.weights)[:, None, None] * np.concatenate([upper, lower], axis=1)
        at_nodes = np.zeros((len(nodes), nodes.shape[1], nodes.shape[1]))
        at_nodes[-1] = problem.cost.final_derivatives(nodes[-1], exact)[1]
        by_T = np.zeros(l_zz.shape[:2])
        if exact:
            weights = (grid.W.T @ lam[self._starts[1] : self._starts[2]]).reshape(len(X), -1)
            derivatives = problem.dynamics.derivatives
            l_zz -= T * (yield from weighted_curvature(derivatives, X, U, weights))
            if self.free_time:
                l_z = np.concatenate([second.l_x, second.l_u], axis=1)
                f_z = self._dynamics(X, U)[1]
                by_T = grid.weights[:, None] * l_z - np.einsum("pk,pkj->pj", weights, f_z)
            if problem.path:
                mu = mu.reshape(len(nodes), -1)
                bent = weighted_constraint_curvature(problem.path.jacobians, nodes, mu)
                at_nodes += yield from bent
            if problem.end:
                last = lam[None, self._starts[3] :]
                bent = weighted_constraint_curvature(problem.end.jacobians, nodes[-1:], last)
                at_nodes[-1:] += yield from bent
        sources = [l_zz.ravel(), at_nodes.ravel(), *([by_T.ravel()] if self.free_time else [])]
        return self._l_yy.matrix(np.concatenate(sources))

    # Names -----------------------------------------------------------------------------------

    def equality_name(self, i: int) -> str:
        """What c_i says."""
        part = int(np.searchsorted(self._starts, i, side="right")) - 1
        k, x = i - int(self._starts[part]), self.problem.x_names
        if part == 0:
            return f"the start of {x[k]}"
        if part == 1:
            step, _, component = (int(a[0]) for a in np.nonzero(self.grid.rows == k))
            return f"the defect of {x[component]} in step {step + 1}{self._time_text(step)}"
        if part == 2:
            return f"{x[self._ends[k]]} at the end"
        assert self.problem.end
        return f"{self.problem.end.name(k)} at the end"

    def inequality_name(self, i: int) -> str:
        """What g_i says."""
        assert self.problem.path
        node, k = divmod(i, self.problem.path.size)
        return f"{self.problem.path.name(k)}{self._time_text(node)}"

    def variable_name(self, i: int) -> str:
        """What y_i is."""
        if self.free_time and i == self.n - 1:
            return "the horizon T"
        names, grid = self.problem.x_names + self.problem.u_names, self.grid
        block, k = divmod(i, len(names))
        return f"{names[k]}{self._time_text(grid.block_times[block] * self.N)}"

    def _time_text(self, step: float) -> str:
        """At the start of a step."""
        if self.free_time:
            return f" at t = {step / self.N:.3g} T"
        return f" at t = {step / self.N * self.problem.T:.3g} s"

    # Parts -----------------------------------------------------------------------------------

    def _points(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nx = self.problem.dynamics.nx
        Z = (self.grid.E @ y[: self.grid.n]).reshape(self.grid.points, -1)
        return np.ascontiguousarray(Z[:, :nx]), np.ascontiguousarray(Z[:, nx:])

    def _dynamics(self, X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f and its derivatives by state and control together."""
        F, f_x, f_u = self.problem.dynamics.derivatives(X, U)
        return F, np.concatenate([f_x, f_u], axis=2)

    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the variables; none on what an equality fixes, unless it is fixed beyond them."""
        problem, grid = self.problem, self.grid
        lower, upper = np.empty(self.n), np.empty(self.n)
        lower[grid.states], upper[grid.states] = problem.x_lower, problem.x_upper
        lower[grid.controls], upper[grid.controls] = problem.u_lower, problem.u_upper
        if problem.T_limits:
            lower[-1], upper[-1] = problem.T_limits
        fixed = [(grid.nodes[0], problem.x0), (grid.nodes[-1][self._ends], self._x_final)]
        for where, value in fixed:
            inside = where[(lower[where] <= value) & (value <= upper[where])]
            lower[inside], upper[inside] = -np.inf, np.inf
        return lower, upper
