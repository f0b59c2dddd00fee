"""The quadratic programme of an SQP iteration (notes, 2.3.1: Newton's method), by piqp:

    minimise p' P p / 2 + q' p   subject to   A p = b,   G p <= h,   lower <= p <= upper

and its elastic mode (beyond the notes), for constraints that no p meets: with slacks that each
cost the penalty gamma,

    minimise p' P p / 2 + q' p + gamma (1'r + 1's + 1't)
    subject to A p - r + s = b,  G p - t <= h,  lower <= p <= upper,  r, s, t >= 0
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, hstack

from labs.algorithms.sqp_active_set import ActiveSet, identify_active_set, solve_active
from labs.algorithms.sqp_qp_solver import QpSolver, QuadraticProgram

TOLERANCE = 1e-11
"""Of the QP's own residuals, absolute and relative, where it is solved wholly."""
AT_BOUND = 1e-9
"""A step that ends so near a bound, in its units or parts of it, and pushes against it, ends
there."""
NEGLIGIBLE_CURVATURE = 1e-8
"""Curvature that stands for none."""


class Subproblem(NamedTuple):
    """What is to be solved; infinite bounds are none."""

    P: csc_array
    q: np.ndarray
    A: csc_array
    b: np.ndarray
    G: csc_array
    h: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    unit: float = 1.0
    """Of the cost: what the solver's tolerances are in parts of."""


class QpFailure(NamedTuple):
    """That the solver found nothing, or nothing finite."""

    infeasible: bool
    """Whether it is sure that there is nothing."""


class SubproblemSolution(NamedTuple):
    """Multipliers as in `labs.problems.nonlinear_program`."""

    p: np.ndarray
    lam: np.ndarray
    mu: np.ndarray
    nu: np.ndarray
    active: ActiveSet
    inexact: bool = False
    """Whether it is not as good as it could be."""
    excess: float = 0.0
    """Sum of the slacks: by how much p misses the constraints."""


def solve_subproblem(
    qp: Subproblem, solver: QpSolver, tolerance: float = TOLERANCE, guess: ActiveSet | None = None
) -> SubproblemSolution | QpFailure:
    """To this tolerance of its residuals, absolute and relative; or wholly, where a guess of what
    is active is nearly right."""
    return _solve(qp, solver, tolerance, guess)


def solve_elastic(qp: Subproblem, gamma: float, solver: QpSolver) -> SubproblemSolution | QpFailure:
    """The same in elastic mode."""
    n, m, k = len(qp.q), len(qp.b), len(qp.h)
    slacks = 2 * m + k
    eye_m, eye_k = eye_array(m, format="csc"), eye_array(k, format="csc")
    wide = qp._replace(
        P=csc_array(
            (qp.P.data, qp.P.indices, np.r_[qp.P.indptr, np.full(slacks, qp.P.indptr[-1])]),
            shape=(n + slacks, n + slacks),
        ),
        q=np.concatenate([qp.q, np.full(slacks, gamma)]),
        A=hstack([qp.A, -eye_m, eye_m, csc_array((m, k))], format="csc"),
        G=hstack([qp.G, csc_array((k, 2 * m)), -eye_k], format="csc"),
        lower=np.concatenate([qp.lower, np.zeros(slacks)]),
        upper=np.concatenate([qp.upper, np.full(slacks, np.inf)]),
    )
    found = _solve(wide, solver, TOLERANCE, None, stages=False)
    if isinstance(found, QpFailure):
        return found
    excess = float(np.maximum(found.p[n:], 0.0).sum())
    return found._replace(p=found.p[:n], nu=found.nu[:n], excess=excess)


def least_violation(qp: Subproblem, largest: np.ndarray, solver: QpSolver) -> float | None:
    """The least sum of slacks that any p has with |p| <= largest (n,)."""
    small = NEGLIGIBLE_CURVATURE * diags_array(np.ones(len(qp.q)), format="csc")
    lower, upper = np.maximum(qp.lower, -largest), np.minimum(qp.upper, largest)
    free = np.zeros(len(qp.q))
    linear = qp._replace(P=csc_array(small), q=free, lower=lower, upper=upper, unit=1.0)
    found = solve_elastic(linear, 1.0, solver)
    return None if isinstance(found, QpFailure) else found.excess


def _solve(
    qp: Subproblem,
    solver: QpSolver,
    tolerance: float,
    guess: ActiveSet | None,
    stages: bool = True,
) -> SubproblemSolution | QpFailure:
    P = csc_array((qp.P.data / qp.unit, qp.P.indices, qp.P.indptr), shape=qp.P.shape)
    scaled = QuadraticProgram(P, qp.q / qp.unit, qp.A, qp.b, qp.G, qp.h, qp.lower, qp.upper)
    found = solve_active(scaled, guess, TOLERANCE) if guess else None
    loose = not found and tolerance > TOLERANCE
    found = found or solver.solve(scaled, tolerance, stages)
    if found.x is None:
        return QpFailure(found.infeasible)
    nu = qp.unit * found.z_bounds
    p = _snap_to_bounds(qp, found.x, nu)
    lam = qp.unit * found.y
    mu = qp.unit * np.maximum(found.z, 0.0)
    if not all(np.isfinite(part).all() for part in (p, lam, mu, nu)):
        return QpFailure(infeasible=False)
    return SubproblemSolution(p, lam, mu, nu, identify_active_set(scaled, found), loose)


def _snap_to_bounds(qp: Subproblem, p: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """p, exactly at the bounds that it pushes against; an interior point is only near them."""
    p = np.clip(p, qp.lower, qp.upper)
    bound = np.where(nu > 0.0, qp.upper, qp.lower)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(p - bound) < AT_BOUND * (1.0 + np.abs(p)), bound, p)
