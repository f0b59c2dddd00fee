"""One step of sequential quadratic programming (notes, 2.3.1): the quadratic programme's p, and how
far to go along it.

Where no p meets the linearised constraints, or the search along it finds nothing, an elastic mode
(beyond the notes) lets constraints be missed at a penalty gamma, and looks for what lowers

    f + gamma theta,    theta = |c|_1 + |max(g, 0)|_1

gamma grows while a larger one would lower the linearised theta by much more. Where no step lowers
it at all, the programme is infeasible, at least from there.
"""

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np
from scipy.sparse import csc_array, diags_array

from labs.algorithms.sqp_convexity import Convex, convexify
from labs.algorithms.sqp_filter import Trial, search, violation
from labs.algorithms.sqp_iterate import SqpIterate, SqpOptions
from labs.algorithms.sqp_merit import descend
from labs.algorithms.sqp_optimality import worst_violation
from labs.algorithms.sqp_subproblem import (
    TOLERANCE,
    Subproblem,
    SubproblemSolution,
    Unsolved,
    least_violation,
    solve_elastic,
    solve_subproblem,
)
from labs.problems.nonlinear_program import NonlinearProgram, ProgramValues
from labs.resumable import Resumable, timed

SHARES = (1.0, 0.5, 0.0)
"""Of the exact Hessian, that are tried in turn where the QP's solver fails."""
SMALL = 1e-4
"""Curvature of a Hessian that vanishes, in parts of the size of f_y."""
PENALTY_FACTOR, PENALTY_LIMIT, RAISES = 10.0, 1e9, 3
"""By what gamma grows; the most it may be in parts of the size of f_y; how often in a step."""
LARGEST_MULTIPLIER = 1e7
"""In parts of the size of f_y; where larger ones are needed, constraints may not be met at all."""
FEW = 5
"""Changes of the active set from one QP to the next, after which that of the third is guessed."""
LOOSEST = 1e-2
"""Tolerance of a QP."""
SHORT = 0.02
"""After a step of less, constraints seem to stand in the way: the next is an elastic one."""
LARGEST_TIME_CHANGE = 0.3
"""In parts of a free final time, by a step. It multiplies all of the dynamics: a model that is
linear in it would leap to its least value, from where few problems are solved."""
LARGEST_STEP = 1.0
"""In a look at what would lower the violation: of 1 and the size of a variable together."""
FIRST_DAMPING, DAMPING_FACTOR, NEGLIGIBLE = 1e-3, 4.0, 1e-6
"""In parts of gamma; by what it grows and shrinks; it is dropped where it costs less than this part
of gamma theta."""
ENOUGH, NEGLIGIBLE_COST = 0.3, 0.1
"""Part of the largest possible fall of the linearised theta that a step is to bring; unless what
f has to do with the step is less than this part of gamma times the fall."""
STATIONARY = 1e-3
"""No step lowers the violation if the best one lowers it by less than this part."""
PATIENCE, PROGRESS = 15, 0.05
"""Elastic steps in a row that are to lower theta by this part together."""


def moved(
    program: NonlinearProgram, options: SqpOptions, at: SqpIterate, seconds: dict[str, float]
) -> Resumable[SqpIterate]:
    """After one step, or stopped where there is none; adds up its `seconds`."""
    assert at.derivatives
    H, f_yy = yield from timed(_hessians(program, options, at), seconds, "derivatives")
    unit = max(at.largest_gradient, float(np.median(f_yy.diagonal()))) or 1.0
    shares = SHARES if options.hessian == "exact" else SHARES[:1]
    tolerance = _qp_tolerance(options, at)
    for most in shares:
        begun = perf_counter()
        found: Convex | None = Convex(H)
        if options.hessian == "exact":
            least = SMALL * at.largest_gradient
            A, at_bounds = at.derivatives.c_y, at.nu != 0.0
            found = convexify(H, f_yy, A, at_bounds, least, at.delta, most)
        if found is None:
            return replace(at, alpha=0.0, stopped=NOT_CONVEX)
        convex = found
        qp = _subproblem(program, at, convex.P, unit)
        guess = at.active if at.settled else None
        answer = None if at.penalty else solve_subproblem(qp, at.solver, tolerance, guess)
        seconds["QP"] += perf_counter() - begun
        yield
        if not isinstance(answer, Unsolved) or answer.infeasible:
            break
    at = replace(at, delta=convex.delta, theta=convex.theta, loose=False, settled=False)
    most = LARGEST_MULTIPLIER * qp.unit
    if isinstance(answer, SubproblemSolution) and _largest(answer) <= most:
        settled = bool(at.active and answer.active.changes(at.active) <= FEW)
        at = replace(at, loose=answer.loose, active=answer.active, settled=settled)
        again, slope = _corrections(options, at, qp, None), float(qp.q @ answer.p)
        looking = search(program, at.y, at.values, answer.p, slope, at.filter, again)
        end = yield from timed(looking, seconds, "line search")
        if end.trial:
            if end.trial.alpha < SHORT:
                at = replace(at, penalty=PENALTY_FACTOR * max(_largest(at), qp.unit))
            return _landed(at, qp, convex, answer, end.trial)
        at = replace(at, lam=answer.lam, mu=answer.mu)
    return (yield from _elastic(program, options, at, qp, convex, f_yy, seconds))


def _elastic(
    program: NonlinearProgram,
    options: SqpOptions,
    at: SqpIterate,
    qp: Subproblem,
    convex: Convex,
    f_yy: csc_array,
    seconds: dict[str, float],
) -> Resumable[SqpIterate]:
    """After a step in elastic mode."""
    assert at.optimality
    begun, diverged = perf_counter(), False
    theta = violation(at.values)
    least = least_violation(qp, LARGEST_STEP * (1.0 + np.abs(at.y)), at.solver)
    missed = at.optimality.violation > options.tolerance
    at = replace(at, elastic=(*at.elastic, theta)[-PATIENCE - 1 :])
    if missed:
        stuck = len(at.elastic) > PATIENCE and theta > (1.0 - PROGRESS) * at.elastic[0]
        if stuck or (least is not None and theta - least <= STATIONARY * theta):
            message = _infeasible_message(program, at.values, stuck)
            return replace(at, alpha=0.0, infeasible=True, stopped=message)
    seconds["QP"] += perf_counter() - begun
    gamma = at.penalty or PENALTY_FACTOR * max(_largest(at), qp.unit)
    limit = PENALTY_LIMIT * qp.unit
    for model in (convex, Convex(f_yy)):
        damping = at.damping
        if model is not convex:
            # Without second derivatives of the constraints, in steps that stay short.
            damping = max(DAMPING_FACTOR * damping, FIRST_DAMPING)
        begun = perf_counter()
        answer: SubproblemSolution | Unsolved = Unsolved(infeasible=False)
        for _ in range(RAISES + 1):
            answer = solve_elastic(_missing(qp, model, damping * gamma), gamma, at.solver)
            if isinstance(answer, Unsolved) or least is None or gamma >= limit:
                break
            gain, p = theta - answer.excess, answer.p
            paid = abs(float(qp.q @ p)) + 0.5 * float(p @ (f_yy @ p))
            possible = theta - least
            if gain >= ENOUGH * possible:
                break
            if gain > NEGLIGIBLE * possible and paid < NEGLIGIBLE_COST * gamma * gain:
                break
            gamma *= PENALTY_FACTOR
        seconds["QP"] += perf_counter() - begun
        yield
        if isinstance(answer, Unsolved):
            continue
        slope = float(qp.q @ answer.p) + gamma * (answer.excess - theta)
        if slope >= 0.0:
            continue
        again = _corrections(options, at, _missing(qp, model, damping * gamma), gamma)
        looking = descend(program, at.y, at.values, answer.p, slope, gamma, at.filter, again)
        found = yield from timed(looking, seconds, "line search")
        diverged = found.diverged
        if found.trial is None:
            continue
        met = answer.excess <= options.tolerance * max(1.0, theta) and found.trial.alpha >= SHORT
        damping = _damping(damping, answer.p, found.trial.alpha, theta)
        at = _landed(at, qp, model, answer, found.trial)
        elastic = () if met else at.elastic
        return replace(at, damping=damping, penalty=0.0 if met else gamma, elastic=elastic)
    message = _exhausted_message(program, at.values, diverged)
    return replace(at, alpha=0.0, penalty=gamma, stopped=message)


def _missing(qp: Subproblem, model: Convex, damping: float) -> Subproblem:
    """The QP for elastic mode: where constraints may be missed, rho |A p - b|^2 / 2 takes the
    place of rho |A p|^2 / 2."""
    identity = diags_array(np.full(len(qp.q), damping), format="csc")
    P, q = csc_array(model.P + identity), qp.q - model.rho * (qp.A.T @ qp.b)
    return qp._replace(P=P, q=q)


def _damping(damping: float, p: np.ndarray, alpha: float, theta: float) -> float:
    """For the next elastic step, in parts of gamma: more after a shortened one, less after a whole
    one."""
    needed = theta / max(float(p @ p), NEGLIGIBLE)
    if alpha == 1.0:
        less = damping / DAMPING_FACTOR
        return less if less > NEGLIGIBLE * needed else 0.0
    if alpha >= 0.25:
        return damping
    return max(DAMPING_FACTOR * damping, 0.1 * needed)


def _qp_tolerance(options: SqpOptions, at: SqpIterate) -> float:
    """How well the QP is to be solved: wholly; but by Gauss-Newton, whose steps are no better than
    their model, far from a solution better than what a step from there can leave, which is the
    square of what the conditions are missed by. The first QP is solved wholly: if the programme is
    quadratic, it is the last. So is one after a point that looks like a solution."""
    assert at.optimality
    missed = max(at.optimality.residual, at.optimality.violation)
    if options.hessian != "gauss-newton" or at.iteration == 0 or missed <= options.tolerance:
        return TOLERANCE
    return float(np.clip(0.1 * missed**2, TOLERANCE, LOOSEST))


def _largest(of: SubproblemSolution | SqpIterate) -> float:
    """Of its multipliers."""
    return float(max(np.abs(of.lam).max(initial=0.0), of.mu.max(initial=0.0)))


def _hessians(
    program: NonlinearProgram, options: SqpOptions, at: SqpIterate
) -> Resumable[tuple[csc_array, csc_array]]:
    """The one wanted, or Gauss-Newton's where it is not finite; and Gauss-Newton's."""
    if at.learnt:
        H = at.learnt.matrix()
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


def _corrections(
    options: SqpOptions, at: SqpIterate, qp: Subproblem, gamma: float | None
) -> Callable[[np.ndarray, ProgramValues], np.ndarray | None]:
    """What makes of a step p, and the values at its end, the step that the curvature seen there
    asks for: c(y + p) - c_y p stands for c."""

    def corrected(p: np.ndarray, end: ProgramValues) -> np.ndarray | None:
        if not options.correction:
            return None
        bent = qp._replace(b=qp.A @ p - end.c, h=qp.G @ p - end.g)
        answer = (
            solve_subproblem(bent, at.solver, _qp_tolerance(options, at))
            if gamma is None
            else solve_elastic(bent, gamma, at.solver)
        )
        return answer.p if isinstance(answer, SubproblemSolution) else None

    return corrected


def _landed(
    at: SqpIterate, qp: Subproblem, convex: Convex, answer: SubproblemSolution, trial: Trial
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


NOT_CONVEX = (
    "Failed: the Hessian cannot be made convex. Choose Gauss-Newton, or start from another first "
    "guess."
)


def _infeasible_message(program: NonlinearProgram, values: ProgramValues, stuck: bool) -> str:
    why = (
        f"{PATIENCE} steps that aimed at it came hardly closer to meeting the constraints"
        if stuck
        else "no step comes closer to meeting the constraints"
    )
    worst = worst_violation(program, values)
    return (
        f"Infeasible, at least near here: {why}; {worst}. Loosen the limits, or start from another "
        "first guess."
    )


def _exhausted_message(program: NonlinearProgram, values: ProgramValues, diverged: bool) -> str:
    why = "every rollout along it diverges" if diverged else "no step length is good enough"
    return (
        f"Failed: the line search is exhausted: {why}; {worst_violation(program, values)}. "
        "Start from another first guess."
    )
