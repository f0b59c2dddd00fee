"""The quadratic programme of an SQP iteration (notes, 2.3.1: Newton's method), by qpsolvers:

    minimise p' P p / 2 + q' p   subject to   A p = b,   G p <= h,   lower <= p <= upper

and its elastic mode (beyond the notes), for constraints that no p meets: with slacks that each
cost the penalty gamma,

    minimise p' P p / 2 + q' p + gamma (1'r + 1's + 1't)
    subject to A p - r + s = b,  G p - t <= h,  lower <= p <= upper,  r, s, t >= 0
"""

from typing import NamedTuple

import numpy as np
import piqp
from qpsolvers import Problem, solve_problem
from qpsolvers.exceptions import QPError
from scipy.sparse import csc_array, csc_matrix, diags_array, eye_array, hstack

TOLERANCE = 1e-10
"""Of the QP's own residuals, absolute and relative."""
MOST_ITERATIONS = 100
"""Of the solver, which otherwise needs 10 to 30: what takes more has gone astray."""
AT_BOUND = 1e-9
"""A step that ends so near a bound, in its units or parts of it, and pushes against it, ends
there."""
NARROW = 4
"""A matrix with a band of less than one in so many variables goes stage by stage."""
LINEAR = 1e-8
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
    staged: bool = False
    """Whether the variables are in an order in which only near ones meet."""
    unit: float = 1.0
    """Of the cost: what the solver's tolerances are in parts of."""


class Unsolved(NamedTuple):
    """That the solver found nothing, or nothing finite."""

    infeasible: bool
    """Whether it is sure that there is nothing."""


class Answer(NamedTuple):
    """Multipliers as in `labs.problems.nonlinear_program`."""

    p: np.ndarray
    lam: np.ndarray
    mu: np.ndarray
    nu: np.ndarray
    excess: float = 0.0
    """Sum of the slacks: by how much p misses the constraints."""


def solve_subproblem(qp: Subproblem) -> Answer | Unsolved:
    """By the solver that fits the order of the variables; if that fails, by the general one."""
    answer = _solve(qp, piqp.sparse_multistage if qp.staged else piqp.sparse_ldlt)
    if isinstance(answer, Answer) or answer.infeasible or not qp.staged:
        return answer
    return _solve(qp, piqp.sparse_ldlt)


def solve_elastic(qp: Subproblem, gamma: float) -> Answer | Unsolved:
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
        staged=False,
    )
    found = _solve(wide, piqp.sparse_ldlt)
    if isinstance(found, Unsolved):
        return found
    excess = float(np.maximum(found.p[n:], 0.0).sum())
    return found._replace(p=found.p[:n], nu=found.nu[:n], excess=excess)


def least_violation(qp: Subproblem, largest: np.ndarray) -> float | None:
    """The least sum of slacks that any p has with |p| <= largest (n,)."""
    small = LINEAR * diags_array(np.ones(len(qp.q)), format="csc")
    lower, upper = np.maximum(qp.lower, -largest), np.minimum(qp.upper, largest)
    free = np.zeros(len(qp.q))
    linear = qp._replace(P=csc_array(small), q=free, lower=lower, upper=upper, unit=1.0)
    found = solve_elastic(linear, 1.0)
    return None if isinstance(found, Unsolved) else found.excess


def is_staged(P: csc_array) -> bool:
    """Whether the variables are ordered so that only near ones meet, but for the last."""
    n = P.shape[0]
    filled = np.flatnonzero(np.diff(P.indptr[:-1]))
    last = P.indptr[filled + 1] - 1
    last = np.where((P.indices[last] == n - 1) & (last > P.indptr[filled]), last - 1, last)
    width = int((P.indices[last] - filled)[P.indices[last] < n - 1].max(initial=0))
    return bool(n > NARROW * width)


def _solve(qp: Subproblem, kkt_solver: piqp.KKTSolver) -> Answer | Unsolved:
    bounded = bool(np.isfinite(qp.lower).any() or np.isfinite(qp.upper).any())
    problem = Problem(
        _matrix(qp.P, 1.0 / qp.unit),
        qp.q / qp.unit,
        _matrix(qp.G) if len(qp.h) else None,
        qp.h if len(qp.h) else None,
        _matrix(qp.A) if len(qp.b) else None,
        qp.b if len(qp.b) else None,
        qp.lower if bounded else None,
        qp.upper if bounded else None,
    )
    try:
        found = solve_problem(
            problem,
            "piqp",
            backend="sparse",
            kkt_solver=kkt_solver,
            eps_abs=TOLERANCE,
            eps_rel=TOLERANCE,
            check_duality_gap=True,
            eps_duality_gap_abs=TOLERANCE,
            eps_duality_gap_rel=TOLERANCE,
            preconditioner_scale_cost=True,
            max_iter=MOST_ITERATIONS,
        )
    except (QPError, RuntimeError, ValueError):
        return Unsolved(infeasible=False)
    if not found.found:
        return Unsolved(found.extras["info"].status == piqp.PIQP_PRIMAL_INFEASIBLE)
    p, lam, mu = np.asarray(found.x), np.asarray(found.y), np.asarray(found.z)
    nu = qp.unit * np.asarray(found.z_box) if bounded else np.zeros(len(qp.q))
    answer = Answer(_snapped(qp, p, nu), qp.unit * lam, qp.unit * np.maximum(mu, 0.0), nu)
    if not all(np.isfinite(part).all() for part in answer[:4]):
        return Unsolved(infeasible=False)
    return answer


def _snapped(qp: Subproblem, p: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """p, exactly at the bounds that it pushes against; an interior point is only near them."""
    p = np.clip(p, qp.lower, qp.upper)
    bound = np.where(nu > 0.0, qp.upper, qp.lower)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(p - bound) < AT_BOUND * (1.0 + np.abs(p)), bound, p)


def _matrix(of: csc_array, factor: float = 1.0) -> csc_matrix:
    """As qpsolvers takes it, times a factor; stored zeros would cost the solver time."""
    found = csc_matrix((of.data * factor, of.indices, of.indptr), shape=of.shape)
    if (found.data == 0.0).any():
        found = csc_matrix(found, copy=True)
        found.eliminate_zeros()
    return found
