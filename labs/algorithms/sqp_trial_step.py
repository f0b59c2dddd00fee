"""What the two kinds of step of sequential quadratic programming (notes, 2.3.1) have in common: how
well a QP is solved, the second-order correction of its p, and the point that a search accepted."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from labs.algorithms.sqp_convexity import ConvexModel
from labs.algorithms.sqp_filter import AcceptedPoint
from labs.algorithms.sqp_iterate import SqpIterate, SqpOptions
from labs.algorithms.sqp_subproblem import (
    TOLERANCE,
    Subproblem,
    SubproblemSolution,
    solve_elastic,
    solve_subproblem,
)
from labs.problems.nonlinear_program import ProgramValues

MAX_QP_TOLERANCE = 1e-2
"""Tolerance of a QP."""
SHORT_STEP = 0.02
"""After a step of less, constraints seem to stand in the way: the next is an elastic one."""
PENALTY_FACTOR = 10.0
"""By what gamma grows."""


def qp_tolerance(options: SqpOptions, at: SqpIterate) -> float:
    """How well the QP is to be solved: wholly; but by Gauss-Newton, whose steps are no better than
    their model, far from a solution better than what a step from there can leave, which is the
    square of what the conditions are missed by. The first QP is solved wholly: if the programme is
    quadratic, it is the last. So is one after a point that looks like a solution."""
    assert at.optimality
    missed = max(at.optimality.residual, at.optimality.violation)
    if options.hessian != "gauss-newton" or at.iteration == 0 or missed <= options.tolerance:
        return TOLERANCE
    return float(np.clip(0.1 * missed**2, TOLERANCE, MAX_QP_TOLERANCE))


def largest_multiplier(of: SubproblemSolution | SqpIterate) -> float:
    """The largest of |lambda| and mu."""
    return float(max(np.abs(of.lam).max(initial=0.0), of.mu.max(initial=0.0)))


def second_order_correction(
    options: SqpOptions, at: SqpIterate, qp: Subproblem, gamma: float | None
) -> Callable[[np.ndarray, ProgramValues], np.ndarray | None]:
    """What makes of a step p, and the values at its end, the step that the curvature seen there
    asks for: c(y + p) - c_y p stands for c."""

    def corrected(p: np.ndarray, end: ProgramValues) -> np.ndarray | None:
        if not options.correction:
            return None
        bent = qp._replace(b=qp.A @ p - end.c, h=qp.G @ p - end.g)
        answer = (
            solve_subproblem(bent, at.solver, qp_tolerance(options, at))
            if gamma is None
            else solve_elastic(bent, gamma, at.solver)
        )
        return answer.p if isinstance(answer, SubproblemSolution) else None

    return corrected


def accept_step(
    at: SqpIterate,
    qp: Subproblem,
    convex: ConvexModel,
    answer: SubproblemSolution,
    trial: AcceptedPoint,
) -> SqpIterate:
    """At the point that a search accepted, with the QP's multipliers."""
    met = qp.A @ answer.p - (qp.b if at.elastic else 0.0)
    return replace(
        at,
        y=trial.y,
        values=trial.values,
        lam=answer.lam + convex.rho * met,
        mu=answer.mu,
        filter=trial.filter,
        alpha=trial.alpha,
        corrected=trial.corrected,
        derivatives=None,
    )
