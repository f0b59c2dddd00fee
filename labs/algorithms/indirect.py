"""Pontryagin's minimum principle (notes, 2.1.3): optimise first, discretise then.

For the problem of `continuous_control.py` let H(x, u, p) = l(x, u) + p' f(x, u). Along an optimal
motion there are costates p(t) with

    x' = H_p = f(x, u),    p' = -H_x = -(l_x + f_x' p),    u = argmin over [u_min, u_max] of H
    x(0) = x_0,    and at T for each state    x_i = x_T,i  where that is given, else p_i = l_f,x_i

That is a boundary value problem in (x, p): half of what is known is known at the start, half at the
end. Two ways are here: collocation on an adaptive mesh (`solve`), and shooting, Newton's method on
p(0) (`indirect_shooting`). Its solutions are extremals: local minima, or not even that.

f is affine in u, and l is quadratic in u with a positive diagonal l_uu, so that the minimiser of H
is -H_u / l_uu at u = 0, clipped. Limits on x and path constraints are not known here: an extremal
that breaks them says so and is not called converged.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicHermiteSpline

from labs.errors import LabError
from labs.problems.continuous_control import ContinuousProblem
from labs.resumable import Resumable

STATE_LIMIT_TOLERANCE = 1e-6
"""By how much a limit on x may be exceeded."""
MAX_MESHES = 25
"""Collocation tries at most."""


@dataclass(frozen=True, eq=False)
class Extremal:
    """A motion with its costates, and how well it fulfils the conditions above."""

    t: np.ndarray
    """(k,) [s] from 0 to T."""
    X: np.ndarray
    """(k, nx)"""
    P: np.ndarray
    """(k, nx) costates."""
    U: np.ndarray
    """(k, nu)"""
    cost: float
    """int l dt + l_f."""
    residual: float
    """Of the differential equations, relative, or what p(0) leaves open at the end."""
    iterations: int
    converged: bool
    stopped: str
    """Why it ended, in a sentence; empty while it goes on."""


def hamiltonian_minimiser(problem: ContinuousProblem, X: np.ndarray, P: np.ndarray) -> np.ndarray:
    """U (k, nu) that minimises H at X, P (k, nx) within the limits. Raises LabError where l is not
    strictly convex in u, with a diagonal l_uu."""
    none = np.zeros((len(X), problem.dynamics.nu))
    cost = problem.cost.running_derivatives(X, none, exact=True)
    curvature = np.diagonal(cost.l_uu, axis1=1, axis2=2)
    off = cost.l_uu * (1.0 - np.eye(problem.dynamics.nu))
    if not (curvature > 0.0).all() or off.any():
        raise LabError(
            "H has no single minimiser in u: l_uu is to be diagonal and positive. Give every "
            "control a weight above zero"
        )
    f_u = problem.dynamics.derivatives(X, none)[2]
    H_u = cost.l_u + np.einsum("kxu,kx->ku", f_u, P)
    return np.asarray(np.clip(-H_u / curvature, problem.u_lower, problem.u_upper))


def hamiltonian(
    problem: ContinuousProblem, X: np.ndarray, U: np.ndarray, P: np.ndarray
) -> np.ndarray:
    """H (k,), which is constant along an extremal."""
    f = problem.dynamics.derivatives(X, U)[0]
    return np.asarray(problem.cost.running(X, U) + np.einsum("kx,kx->k", P, f))


# Collocation ----------------------------------------------------------------------------------


def solve(
    problem: ContinuousProblem,
    t: np.ndarray,
    X: np.ndarray,
    P: np.ndarray,
    tolerance: float = 1e-6,
    nodes: int = 1500,
) -> Resumable[Extremal]:
    """The extremal near X, P (k, nx) at the times t (k,): collocation of order 4 by SciPy, on a
    mesh refined until the residual is below the tolerance, of at most so many nodes. The cost is
    integrated with it. Pauses after every mesh. Raises LabError for a free T or e(x(T)) = 0."""
    check_problem(problem)
    nx = problem.dynamics.nx
    cost = np.concatenate([[0.0], np.cumsum(np.diff(t) * _mean_cost_rates(problem, X, P))])
    z, meshes, stopped = np.vstack([X.T, P.T, cost]), 0, ""
    while not stopped:
        with np.errstate(all="ignore"):
            found = solve_bvp(
                lambda _, z: canonical_equations(problem, z.T).T,
                lambda start, end: _boundary_residual(problem, start, end),
                t,
                z,
                tol=tolerance,
                bc_tol=tolerance,
                max_nodes=len(t),
            )
        meshes += 1
        yield
        t, z, residual = found.x, found.y, float(found.rms_residuals.max())
        added = np.where(found.rms_residuals > 100.0 * tolerance, 2, 1)
        added[found.rms_residuals <= tolerance] = 0
        if found.status == 2 or not np.isfinite(z).all():
            stopped = (
                "No solution found: the equations of the boundary value problem became singular. "
                "Start from another guess."
            )
        elif found.success:
            stopped = f"Converged: on {len(t)} nodes the conditions are met to {residual:.1e}."
        elif len(t) + added.sum() > nodes or meshes >= MAX_MESHES or not added.any():
            stopped = (
                f"Stopped short: on {len(t)} nodes the conditions are met to {residual:.1e} only. "
                "Start from another guess, or shorten the horizon."
            )
        else:
            t = _refine_mesh(t, added)
            z = found.sol(t)
    z = np.where(np.isfinite(z), z, 0.0).T
    X, P = z[:, :nx], z[:, nx : 2 * nx]
    J = float(z[-1, -1] + problem.cost.final(X[-1]))
    U = hamiltonian_minimiser(problem, X, P)
    return check_limits(
        problem, Extremal(t, X, P, U, J, residual, meshes, bool(found.success), stopped)
    )


def _refine_mesh(t: np.ndarray, added: np.ndarray) -> np.ndarray:
    """The mesh t with so many nodes (0, 1 or 2) more within each of its intervals."""
    gaps = np.diff(t)
    one, two = added == 1, added == 2
    middle = t[:-1][one] + 0.5 * gaps[one]
    thirds = [t[:-1][two] + part * gaps[two] for part in (1.0 / 3.0, 2.0 / 3.0)]
    return np.sort(np.concatenate([t, middle, *thirds]))


def _mean_cost_rates(problem: ContinuousProblem, X: np.ndarray, P: np.ndarray) -> np.ndarray:
    rate = problem.cost.running(X, hamiltonian_minimiser(problem, X, P))
    return np.asarray(0.5 * (rate[1:] + rate[:-1]))


def canonical_equations(problem: ContinuousProblem, z: np.ndarray) -> np.ndarray:
    """(x', p', l) at points (x, p, cost so far), (k, 2 nx + 1)."""
    nx = problem.dynamics.nx
    X, P = z[:, :nx], z[:, nx : 2 * nx]
    U = hamiltonian_minimiser(problem, X, P)
    f, f_x, _ = problem.dynamics.derivatives(X, U)
    l_x = problem.cost.running_derivatives(X, U, exact=False).l_x
    change = -(l_x + np.einsum("kxy,kx->ky", f_x, P))
    return np.hstack([f, change, problem.cost.running(X, U)[:, None]])


def _boundary_residual(
    problem: ContinuousProblem, start: np.ndarray, end: np.ndarray
) -> np.ndarray:
    """(2 nx + 1,), zero where all that is known at both ends holds."""
    nx = problem.dynamics.nx
    return np.concatenate(
        [start[:nx] - problem.x0, terminal_residual(problem, end), start[2 * nx :]]
    )


def terminal_residual(problem: ContinuousProblem, end: np.ndarray) -> np.ndarray:
    """(nx,): what fails at T, of (x, p, cost)."""
    nx = problem.dynamics.nx
    x, p = end[:nx], end[nx : 2 * nx]
    free = p - problem.cost.final_derivatives(x, exact=False)[0]
    if problem.x_final is None:
        return np.asarray(free)
    return np.asarray(np.where(np.isnan(problem.x_final), free, x - problem.x_final))


# What both share ------------------------------------------------------------------------------


def check_problem(problem: ContinuousProblem) -> None:
    """Raises LabError where the conditions are others."""
    if problem.T_limits is not None or problem.end is not None:
        raise LabError("Pontryagin's conditions are solved for a fixed T here, without e(x(T)) = 0")


def check_limits(problem: ContinuousProblem, found: Extremal) -> Extremal:
    """The same; not converged where it breaks a limit it does not know of."""
    over = np.maximum(found.X - problem.x_upper, problem.x_lower - found.X)
    if problem.path is not None:
        over = np.hstack([over, problem.path.values(found.X)])
    if not found.converged or not over.max() > STATE_LIMIT_TOLERANCE:
        return found
    i, j = np.unravel_index(int(np.argmax(over)), over.shape)
    nx = problem.dynamics.nx
    assert problem.path is not None or j < nx
    what = f"the limit on {problem.x_names[j]}" if j < nx else problem.path.name(int(j) - nx)  # type: ignore[union-attr]
    stopped = (
        f"Infeasible: the conditions are met, but they know no limits on x, and at t = "
        f"{found.t[i]:.3g} s {what} is exceeded by {over[i, j]:.2g}."
    )
    return replace(found, converged=False, stopped=stopped)


def resample_extremal(found: Extremal, problem: ContinuousProblem, t: np.ndarray) -> Extremal:
    """The same extremal at other times t (k,) within [0, T], by cubics that meet x', p'."""
    nx = problem.dynamics.nx
    z = np.hstack([found.X, found.P, np.zeros((len(found.t), 1))])
    slopes = canonical_equations(problem, z)[:, : 2 * nx]
    z = CubicHermiteSpline(found.t, z[:, : 2 * nx], slopes)(t)
    X, P = z[:, :nx], z[:, nx:]
    return replace(found, t=t, X=X, P=P, U=hamiltonian_minimiser(problem, X, P))
