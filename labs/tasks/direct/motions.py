"""The motion that an iterate of a direct method stands for, in collocation, multiple shooting and
the race of direct methods."""

import numpy as np

from labs.algorithms.collocation import Collocation
from labs.algorithms.multiple_shooting import MultipleShooting
from labs.algorithms.single_shooting import SingleShooting
from labs.algorithms.sqp import SqpIterate
from labs.tasks.direct.trajectory import PiecewiseTrajectory


def collocation_motion(program: Collocation, at: SqpIterate) -> PiecewiseTrajectory:
    """A piece for each kind of defect a step has; the defect is its gap."""
    grid, y, nx = program.grid, at.y, program.problem.dynamics.nx
    X, U = y[grid.states], y[grid.controls]
    both = (U, U) if program.scheme.between else (U[:-1], U[1:])
    defects = at.values.c[nx : nx + grid.rows.size].reshape(-1, nx)
    return PiecewiseTrajectory(program.horizon(y), X, X[1:] - defects, np.stack(both, axis=1))


def multiple_shooting_motion(shooting: MultipleShooting, z: np.ndarray) -> PiecewiseTrajectory:
    """Step by step. There are gaps where a segment begins."""
    arcs = shooting.arcs(z)
    X = np.concatenate([arcs.X, arcs.Y[-1:]])
    return _piecewise_constant(shooting.horizon(z), X, arcs.Y, arcs.W[:, :-1])


def single_shooting_motion(shooting: SingleShooting, y: np.ndarray) -> PiecewiseTrajectory:
    """Step by step, without a gap."""
    X = shooting.rollout(y).X
    return _piecewise_constant(
        shooting.horizon(y), X, X[1:], np.repeat(shooting.controls(y), shooting.M, axis=0)
    )


def _piecewise_constant(
    T: float, X: np.ndarray, ends: np.ndarray, U: np.ndarray
) -> PiecewiseTrajectory:
    """With the controls U (k, nu) each held for a piece."""
    return PiecewiseTrajectory(T, X, ends, np.stack([U, U], axis=1))
