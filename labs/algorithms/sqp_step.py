"""One step of sequential quadratic programming (notes, 2.3.1): the quadratic programme's p, and how
far to go along it.

Where no p meets the linearised constraints, or the search along it finds nothing, the step is one
in elastic mode (`sqp_elastic`).
"""

from dataclasses import replace
from time import perf_counter

import numpy as np
from scipy.sparse import csc_array

from labs.algorithms.sqp_convexity import ConvexModel, convexify
from labs.algorithms.sqp_elastic import elastic_step
from labs.algorithms.sqp_filter import filter_line_search
from labs.algorithms.sqp_iterate import SqpIterate, SqpOptions
from labs.algorithms.sqp_subproblem import (
    QpFailure,
    Subproblem,
    SubproblemSolution,
    solve_subproblem,
)
from labs.algorithms.sqp_trial_step import (
    PENALTY_FACTOR,
    SHORT_STEP,
    accept_step,
    largest_multiplier,
    qp_tolerance,
    second_order_correction,
)
from labs.problems.nonlinear_program import NonlinearProgram
from labs.resumable import Resumable, timed

EXACT_HESSIAN_SHARES = (1.0, 0.5, 0.0)
"""Of the exact Hessian, that are tried in turn where the QP's solver fails."""
MIN_CURVATURE = 1e-4
"""Curvature of a Hessian that vanishes, in parts of the size of f_y."""
LARGEST_MULTIPLIER = 1e7
"""In parts of the size of f_y; where larger ones are needed, constraints may not be met at all."""
SETTLED_CHANGES = 5
"""Changes of the active set from one QP to the next, after which that of the third is guessed."""
LARGEST_TIME_CHANGE = 0.3
"""In parts of a free final time, by a step. It multiplies all of the dynamics: a model that is
linear in it would leap to its least value, from where few problems are solved."""


def take_step(
    program: NonlinearProgram, options: SqpOptions, at: SqpIterate, seconds: dict[str, float]
) -> Resumable[SqpIterate]:
    """After one step, or stopped where there is none; adds up its `seconds`."""
    assert at.derivatives
    H, f_yy = yield from timed(_hessians(program, options, at), seconds, "derivatives")
    unit = max(at.largest_gradient, float(np.median(f_yy.diagonal()))) or 1.0
    shares = EXACT_HESSIAN_SHARES if options.hessian == "exact" else EXACT_HESSIAN_SHARES[:1]
    tolerance = qp_tolerance(options, at)
    for most in shares:
        begun = perf_counter()
        found: ConvexModel | None = ConvexModel(H)
        if options.hessian == "exact":
            least = MIN_CURVATURE * at.largest_gradient
            A, at_bounds = at.derivatives.c_y, at.nu != 0.0
            found = convexify(H, f_yy, A, at_bounds, least, at.delta, most)
        if found is None:
            return replace(at, alpha=0.0, stopped=NOT_CONVEX_MESSAGE)
        convex = found
        qp = _subproblem(program, at, convex.P, unit)
        guess = at.active if at.active_set_settled else None
        answer = None if at.penalty else solve_subproblem(qp, at.solver, tolerance, guess)
        seconds["QP"] += perf_counter() - begun
        yield
        if not isinstance(answer, QpFailure) or answer.infeasible:
            break
    at = replace(
        at, delta=convex.delta, theta=convex.theta, qp_inexact=False, active_set_settled=False
    )
    most = LARGEST_MULTIPLIER * qp.unit
    if isinstance(answer, SubproblemSolution) and largest_multiplier(answer) <= most:
        settled = bool(at.active and answer.active.changes(at.active) <= SETTLED_CHANGES)
        at = replace(
            at, qp_inexact=answer.inexact, active=answer.active, active_set_settled=settled
        )
        again, slope = second_order_correction(options, at, qp, None), float(qp.q @ answer.p)
        looking = filter_line_search(program, at.y, at.values, answer.p, slope, at.filter, again)
        end = yield from timed(looking, seconds, "line search")
        if end.trial:
            if end.trial.alpha < SHORT_STEP:
                at = replace(at, penalty=PENALTY_FACTOR * max(largest_multiplier(at), qp.unit))
            return accept_step(at, qp, convex, answer, end.trial)
        at = replace(at, lam=answer.lam, mu=answer.mu)
    return (yield from elastic_step(program, options, at, qp, convex, f_yy, seconds))


def _hessians(
    program: NonlinearProgram, options: SqpOptions, at: SqpIterate
) -> Resumable[tuple[csc_array, csc_array]]:
    """The one wanted, or Gauss-Newton's where it is not finite; and Gauss-Newton's."""
    if at.bfgs:
        H = at.bfgs.matrix()
        return H, H
    f_yy = yield from program.hessian(at.y, at.lam, at.mu, exact=False)
    if options.hessian != "exact":
        return f_yy, f_yy
    exact = yield from program.hessian(at.y, at.lam, at.mu, exact=True)
    return (exact if np.isfinite(exact.data).all() else f_yy), f_yy


def _subproblem(program: NonlinearProgram, at: SqpIterate, P: csc_array, unit: float) -> Subproblem:
    assert at.derivatives
    f_y, c_y, g_y = at.derivatives
    lower, upper = program.lower - at.y, program.upper - at.y
    if program.free_time:
        lower[-1] = max(lower[-1], -LARGEST_TIME_CHANGE * at.y[-1])
        upper[-1] = min(upper[-1], LARGEST_TIME_CHANGE * at.y[-1])
    return Subproblem(P, f_y, c_y, -at.values.c, g_y, -at.values.g, lower, upper, unit)


NOT_CONVEX_MESSAGE = (
    "Failed: the Hessian cannot be made convex. Choose Gauss-Newton, or start from another first "
    "guess."
)
