"""What the multipliers of collocation mean: costates."""

from dataclasses import dataclass

import numpy as np

from labs.algorithms.collocation import Collocation
from labs.algorithms.sqp import SqpIterate
from labs.tasks.direct.motions import collocation_motion


@dataclass(frozen=True, eq=False)
class Costates:
    """Along a motion, in units of the cost by units of a state. Arrays are never written into."""

    times: np.ndarray
    """(N,) [s] the middles of steps."""
    multipliers: np.ndarray
    """(N, nx): -lam of each step's defect."""
    grid: np.ndarray
    """(N + 1,) [s]"""
    costate: np.ndarray
    """(N + 1, nx)"""


def costates(program: Collocation, at: SqpIterate) -> Costates:
    """The multipliers of an iterate whose derivatives are known, beside Pontryagin's costate along
    the same motion (notes, 2.1.3),

        p' = -(l_x + f_x' p),   p(T) = l_f,x + e_x' lam_e + lam_T

    backward by the trapezoidal rule; limits and constraints of a state push p where they act."""
    assert at.derivatives
    problem, motion, grid = program.problem, collocation_motion(program, at), program.grid
    nx, N, h = problem.dynamics.nx, program.N, motion.T / program.N
    first_after = nx + grid.rows.size
    of_end = at.derivatives.c_y[first_after:].T @ at.lam[first_after:]
    push = (of_end + at.nu + at.derivatives.g_y.T @ at.mu)[grid.nodes]
    # At a grid point the control is the mean of those on both sides.
    U = np.concatenate([motion.U[:1, 0], motion.U[:, 1]])
    U[1:-1] = 0.5 * (motion.U[:-1, 1] + motion.U[1:, 0])
    X, U = (along[:: program.scheme.stride] for along in (motion.X, U))
    f_x = problem.dynamics.derivatives(X, U)[1]
    l_x = problem.cost.running_derivatives(X, U, exact=False).l_x
    p = np.empty((N + 1, nx))
    p[N] = problem.cost.final_derivatives(X[-1], exact=False)[0] + push[N]
    for i in range(N - 1, -1, -1):
        later = p[i + 1] + 0.5 * h * (l_x[i] + l_x[i + 1] + f_x[i + 1].T @ p[i + 1])
        p[i] = np.linalg.solve(np.eye(nx) - 0.5 * h * f_x[i].T, later)
        if i > 0:
            p[i] += push[i]
    lam = at.lam[nx:first_after].reshape(N, -1, nx)[:, -1]
    times = h * np.arange(N + 1)
    return Costates(times[:-1] + 0.5 * h, -lam, times, p)
