"""The elastic mode of sequential quadratic programming (notes, 2.3.1; beyond them): where no p
meets the linearised constraints, or the search along it finds nothing, constraints may be missed at
a penalty gamma, and a step is to lower

    f + gamma theta,    theta = |c|_1 + |max(g, 0)|_1

gamma grows while a larger one would lower the linearised theta by much more. Where no step lowers
it at all, the programme is infeasible, at least from there.
"""

from dataclasses import replace
from time import perf_counter

import numpy as np
from scipy.sparse import csc_array, diags_array

from labs.algorithms.sqp_convexity import ConvexModel
from labs.algorithms.sqp_filter import violation
from labs.algorithms.sqp_iterate import SqpIterate, SqpOptions
from labs.algorithms.sqp_merit import merit_line_search
from labs.algorithms.sqp_optimality import worst_violation
from labs.algorithms.sqp_subproblem import (
    QpFailure,
    Subproblem,
    SubproblemSolution,
    least_violation,
    solve_elastic,
)
from labs.algorithms.sqp_trial_step import (
    PENALTY_FACTOR,
    SHORT_STEP,
    accept_step,
    largest_multiplier,
    second_order_correction,
)
from labs.problems.nonlinear_program import NonlinearProgram, ProgramValues
from labs.resumable import Resumable, timed

PENALTY_LIMIT, MAX_PENALTY_INCREASES = 1e9, 3
"""The most gamma may be in parts of the size of f_y; how often it grows in a step."""
LARGEST_STEP = 1.0
"""In a look at what would lower the violation: of 1 and the size of a variable together."""
FIRST_DAMPING, DAMPING_FACTOR, NEGLIGIBLE = 1e-3, 4.0, 1e-6
"""In parts of gamma; by what it grows and shrinks; it is dropped where it costs less than this part
of gamma theta."""
SUFFICIENT_DECREASE, NEGLIGIBLE_COST = 0.3, 0.1
"""Part of the largest possible fall of the linearised theta that a step is to bring; unless what
f has to do with the step is less than this part of gamma times the fall."""
STATIONARITY_TOLERANCE = 1e-3
"""No step lowers the violation if the best one lowers it by less than this part."""
MAX_ELASTIC_STEPS, MIN_PROGRESS = 15, 0.05
"""Elastic steps in a row that are to lower theta by this part together."""


def elastic_step(
    program: NonlinearProgram,
    options: SqpOptions,
    at: SqpIterate,
    qp: Subproblem,
    convex: ConvexModel,
    f_yy: csc_array,
    seconds: dict[str, float],
) -> Resumable[SqpIterate]:
    """After a step in elastic mode."""
    assert at.optimality
    begun, diverged = perf_counter(), False
    theta = violation(at.values)
    least = least_violation(qp, LARGEST_STEP * (1.0 + np.abs(at.y)), at.solver)
    missed = at.optimality.violation > options.tolerance
    at = replace(at, elastic=(*at.elastic, theta)[-MAX_ELASTIC_STEPS - 1 :])
    if missed:
        stuck = len(at.elastic) > MAX_ELASTIC_STEPS and theta > (1.0 - MIN_PROGRESS) * at.elastic[0]
        if stuck or (least is not None and theta - least <= STATIONARITY_TOLERANCE * theta):
            message = _infeasible_message(program, at.values, stuck)
            return replace(at, alpha=0.0, infeasible=True, stopped=message)
    seconds["QP"] += perf_counter() - begun
    gamma = at.penalty or PENALTY_FACTOR * max(largest_multiplier(at), qp.unit)
    limit = PENALTY_LIMIT * qp.unit
    for model in (convex, ConvexModel(f_yy)):
        damping = at.damping
        if model is not convex:
            # Without second derivatives of the constraints, in steps that stay short.
            damping = max(DAMPING_FACTOR * damping, FIRST_DAMPING)
        begun = perf_counter()
        answer: SubproblemSolution | QpFailure = QpFailure(infeasible=False)
        for _ in range(MAX_PENALTY_INCREASES + 1):
            answer = solve_elastic(
                _relaxed_subproblem(qp, model, damping * gamma), gamma, at.solver
            )
            if isinstance(answer, QpFailure) or least is None or gamma >= limit:
                break
            gain, p = theta - answer.excess, answer.p
            paid = abs(float(qp.q @ p)) + 0.5 * float(p @ (f_yy @ p))
            possible = theta - least
            if gain >= SUFFICIENT_DECREASE * possible:
                break
            if gain > NEGLIGIBLE * possible and paid < NEGLIGIBLE_COST * gamma * gain:
                break
            gamma *= PENALTY_FACTOR
        seconds["QP"] += perf_counter() - begun
        yield
        if isinstance(answer, QpFailure):
            continue
        slope = float(qp.q @ answer.p) + gamma * (answer.excess - theta)
        if slope >= 0.0:
            continue
        again = second_order_correction(
            options, at, _relaxed_subproblem(qp, model, damping * gamma), gamma
        )
        looking = merit_line_search(
            program, at.y, at.values, answer.p, slope, gamma, at.filter, again
        )
        found = yield from timed(looking, seconds, "line search")
        diverged = found.diverged
        if found.trial is None:
            continue
        met = (
            answer.excess <= options.tolerance * max(1.0, theta) and found.trial.alpha >= SHORT_STEP
        )
        damping = _next_damping(damping, answer.p, found.trial.alpha, theta)
        at = accept_step(at, qp, model, answer, found.trial)
        elastic = () if met else at.elastic
        return replace(at, damping=damping, penalty=0.0 if met else gamma, elastic=elastic)
    message = _exhausted_message(program, at.values, diverged)
    return replace(at, alpha=0.0, penalty=gamma, stopped=message)


def _relaxed_subproblem(qp: Subproblem, model: ConvexModel, damping: float) -> Subproblem:
    """The QP for elastic mode: where constraints may be missed, rho |A p - b|^2 / 2 takes the
    place of rho |A p|^2 / 2."""
    identity = diags_array(np.full(len(qp.q), damping), format="csc")
    P, q = csc_array(model.P + identity), qp.q - model.rho * (qp.A.T @ qp.b)
    return qp._replace(P=P, q=q)


def _next_damping(damping: float, p: np.ndarray, alpha: float, theta: float) -> float:
    """For the next elastic step, in parts of gamma: more after a shortened one, less after a whole
    one."""
    needed = theta / max(float(p @ p), NEGLIGIBLE)
    if alpha == 1.0:
        less = damping / DAMPING_FACTOR
        return less if less > NEGLIGIBLE * needed else 0.0
    if alpha >= 0.25:
        return damping
    return max(DAMPING_FACTOR * damping, 0.1 * needed)


def _infeasible_message(program: NonlinearProgram, values: ProgramValues, stuck: bool) -> str:
    why = (
        f"{MAX_ELASTIC_STEPS} steps that aimed at it came hardly closer to meeting the constraints"
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
