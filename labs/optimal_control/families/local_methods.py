"""The two local families: each improves one motion from x_0, from a first guess of it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from labs.algorithms import indirect, indirect_shooting, sqp
from labs.algorithms.collocation import Collocation
from labs.algorithms.indirect import Extremal
from labs.optimal_control.families.motion import MethodMotion, no_motion
from labs.problems.continuous_control import ContinuousProblem
from labs.resumable import Resumable

TOLERANCE = 1e-6
"""Of Pontryagin's differential equations."""
MESH = 61
"""Nodes of the first mesh."""
OPTIONS = sqp.SqpOptions(hessian="exact", tolerance=1e-6, iterations=100)


def solve_pontryagin(
    problem: ContinuousProblem, guess: MethodMotion, method: str, tolerance: float = TOLERANCE
) -> Resumable[MethodMotion]:
    """By "collocation" or "shooting", from the states and costates of a motion."""
    some = np.round(np.linspace(0, len(guess.t) - 1, MESH)).astype(int)
    if method == "shooting":
        found = yield from indirect_shooting.shoot(problem, guess.P[0])
    else:
        t, X, P = guess.t[some], guess.X[some], guess.P[some]
        found = yield from indirect.solve(problem, t, X, P, tolerance)
    return motion_of_extremal(problem, found)


def motion_of_extremal(problem: ContinuousProblem, found: Extremal) -> MethodMotion:
    """Without a motion where nothing was found: half-solved equations are none."""
    motion = no_motion(problem)
    if not found.converged:
        return replace(motion, iterations=found.iterations, message=found.stopped)
    found = indirect.resample_extremal(found, problem, motion.t)
    return replace(
        motion,
        X=found.X,
        U=found.U[:, 0],
        P=found.P,
        cost=found.cost,
        promised=found.cost,
        iterations=found.iterations,
        known=True,
        converged=True,
        message=found.stopped,
    )


def solve_direct(
    problem: ContinuousProblem, guess: MethodMotion, N: int
) -> Iterator[MethodMotion | None]:
    """By trapezoidal collocation in N steps, from the states and controls of a motion: after each
    iteration of SQP; None where it may pause within one."""
    program = Collocation(problem, N, "trapezoidal")
    t = np.linspace(0.0, problem.T, N + 1)
    X = np.stack([np.interp(t, guess.t, column) for column in guess.X.T], axis=1)
    U = np.interp(t, guess.t, guess.U)[:, None]
    at = sqp.init(program, program.variables(X, U[:-1]), OPTIONS)
    while not at.stopped:
        at = yield from sqp.resumable_step(program, OPTIONS, at)
        yield motion_of_iterate(problem, program, at)
    if not at.iteration:
        yield motion_of_iterate(problem, program, at)


def motion_of_iterate(
    problem: ContinuousProblem, program: Collocation, at: sqp.SqpIterate
) -> MethodMotion:
    """Its multipliers, one for each step, are the costates in the middle of the step, with the
    other sign; that of x(0) = x_0 is the costate at the start, and l_f,x that at the end."""
    motion, N = no_motion(problem), program.N
    _, X, U = program.trajectory(at.y)
    nx = problem.dynamics.nx
    t = np.linspace(0.0, problem.T, N + 1)
    last = problem.cost.final_derivatives(X[-1], exact=False)[0]
    P = np.vstack([-at.lam[:nx], -at.lam[nx : nx * (N + 1)].reshape(N, nx), last])
    middles = np.concatenate([[0.0], 0.5 * (t[1:] + t[:-1]), [problem.T]])
    cost = at.values.f if np.isfinite(at.values.f) else 0.0
    return replace(
        motion,
        X=np.stack([np.interp(motion.t, t, column) for column in X.T], axis=1),
        U=np.interp(motion.t, t, U[:, 0]),
        P=np.stack([np.interp(motion.t, middles, column) for column in P.T], axis=1),
        cost=float(cost),
        promised=float(cost),
        iterations=at.iteration,
        known=bool(np.isfinite(at.values.f)) and (at.converged or not at.stopped),
        converged=at.converged,
        message=at.stopped or motion.message,
    )
