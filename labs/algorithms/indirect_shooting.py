"""Indirect shooting (notes, 2.1.3): Pontryagin's boundary value problem (`indirect`) as a search
for p(0). From x_0 and a guess of p(0) the equations x' = H_p, p' = -H_x are integrated to T, and
Newton's method brings what fails there to zero. It is as sensitive as the dynamics are: what p(0)
is off by grows with them all the way to T.
"""

import numpy as np

from labs.algorithms.indirect import (
    Extremal,
    canonical_equations,
    check_limits,
    check_problem,
    hamiltonian_minimiser,
    terminal_residual,
)
from labs.problems.continuous_control import ContinuousProblem
from labs.resumable import Resumable

DIVERGENCE_LIMIT = 1e8
"""A motion or a costate larger than this has diverged."""
STEP_FRACTIONS = 0.5 ** np.arange(9.0)
"""Of a Newton step, that are tried."""


def shoot(
    problem: ContinuousProblem,
    p0: np.ndarray,
    steps: int = 200,
    tolerance: float = 1e-9,
    iterations: int = 30,
) -> Resumable[Extremal]:
    """The extremal from p(0) near p0 (nx,): (x, p) is integrated from the start by the classical
    Runge-Kutta method in so many steps, and Newton's method, with forward differences and a line
    search, brings what fails at the end below the tolerance, in parts of the largest costate.
    Pauses now and then."""
    check_problem(problem)
    nx, k, stopped, converged = problem.dynamics.nx, 0, "", False
    path = (yield from _integrate(problem, p0[None], steps))[:, 0]
    miss = terminal_residual(problem, path[-1])
    while not stopped:
        left, size = float(np.abs(miss).max()), 1.0 + float(np.abs(path[:, nx : 2 * nx]).max())
        better = None
        if not np.isfinite(left):
            stopped = (
                "The motion from this p(0) diverges before it comes to its end: start from another "
                "guess, or shorten the horizon."
            )
        elif left <= tolerance * size:
            converged = True
            stopped = f"Converged: after {k} Newton steps on p(0) the end is met to {left:.1e}."
        elif k >= iterations:
            stopped = (
                f"Stopped short after {k} Newton steps on p(0): at the end {left:.1e} is left. "
                "Start from another guess, or shorten the horizon."
            )
        else:
            better = yield from _newton_step(problem, p0, miss, steps)
            if better is None:
                stopped = (
                    f"The line search ends: after {k} Newton steps on p(0) no part of the next "
                    f"one meets the end better than {left:.1e}. Start from another guess, or "
                    "shorten the horizon."
                )
        if better:
            (p0, path, miss), k = better, k + 1
    finite = np.isfinite(path).all()
    z = path if finite else np.zeros_like(path)
    X, P = z[:, :nx], z[:, nx : 2 * nx]
    J = float(z[-1, -1] + problem.cost.final(X[-1]))
    left = float(np.abs(miss).max())
    t, U = np.linspace(0.0, problem.T, steps + 1), hamiltonian_minimiser(problem, X, P)
    return check_limits(problem, Extremal(t, X, P, U, J, left, k, converged, stopped))


def _newton_step(
    problem: ContinuousProblem, p0: np.ndarray, miss: np.ndarray, steps: int
) -> Resumable[tuple[np.ndarray, np.ndarray, np.ndarray] | None]:
    """p(0), its path (steps + 1, 2 nx + 1) and what fails at its end, after the longest part of a
    Newton step that makes it less, all parts being tried at once; None where none does."""
    small = 1e-7 * (1.0 + np.abs(p0))
    varied = yield from _integrate(problem, p0 + np.diag(small), steps)
    jacobian = (np.array([terminal_residual(problem, end) for end in varied[-1]]) - miss).T / small
    if not np.isfinite(jacobian).all() or np.linalg.matrix_rank(jacobian) < len(p0):
        return None
    step = np.linalg.solve(jacobian, -miss)
    tried = yield from _integrate(problem, p0 + STEP_FRACTIONS[:, None] * step, steps)
    for i, part in enumerate(STEP_FRACTIONS):
        after = terminal_residual(problem, tried[-1, i])
        if np.linalg.norm(after) < (1.0 - 1e-4 * part) * np.linalg.norm(miss):
            return p0 + part * step, tried[:, i], after
    return None


def _integrate(problem: ContinuousProblem, P0: np.ndarray, steps: int) -> Resumable[np.ndarray]:
    """(steps + 1, k, 2 nx + 1): (x, p, cost so far) from x_0 and each p(0) of P0 (k, nx); NaN once
    one has diverged."""
    k, nx = P0.shape
    h = problem.T / steps
    z = np.hstack([np.tile(problem.x0, (k, 1)), P0, np.zeros((k, 1))])
    path = np.empty((steps + 1, k, 2 * nx + 1))
    path[0] = z
    for i in range(steps):
        with np.errstate(all="ignore"):
            k1 = canonical_equations(problem, z)
            k2 = canonical_equations(problem, z + 0.5 * h * k1)
            k3 = canonical_equations(problem, z + 0.5 * h * k2)
            k4 = canonical_equations(problem, z + h * k3)
            z = z + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            z[~(np.abs(z).max(axis=1) < DIVERGENCE_LIMIT)] = np.nan
        path[i + 1] = z
        if i % 20 == 0:
            yield
    return path
