"""Sequential quadratic programming, Newton's method for a nonlinear programme (notes, 2.3.1),

    minimise f(y)   subject to   c(y) = 0,   g(y) <= 0,   lower <= y <= upper

One iteration expands f, c and g about y and solves the quadratic programme

    minimise  f_y' p + p' P p / 2   subject to   c + c_y p = 0,   g + g_y p <= 0,   y + p in bounds

whose multipliers lam, mu, nu are those of the next iterate, and searches along p (`sqp_step`). What
is active settles after some iterations: from there on linear systems solve it (`sqp_active_set`). P
is the Hessian of the Lagrangian L = f + lam' c + mu' g + nu' y, made convex (`sqp_convexity`);
Gauss-Newton's, which knows f alone; or learnt (`sqp_bfgs`). It has converged where

    |f_y + c_y' lam + g_y' mu + nu| and mu' g vanish,   c = 0,   g <= 0

within a tolerance, in parts of what these sums are made of (`sqp_optimality`). It is infeasible
where c = 0, g <= 0 are not met and no step comes closer to meeting them, linearised.
"""

from dataclasses import replace

import numpy as np

from labs.algorithms import sqp_active_set, sqp_bfgs
from labs.algorithms.sqp_filter import MAX_VIOLATION_GROWTH, Filter, violation
from labs.algorithms.sqp_iterate import PrimalDualPoint as PrimalDualPoint
from labs.algorithms.sqp_iterate import SqpIterate as SqpIterate
from labs.algorithms.sqp_iterate import SqpOptions as SqpOptions
from labs.algorithms.sqp_optimality import optimality, worst_violation
from labs.algorithms.sqp_step import take_step
from labs.errors import LabError
from labs.problems.nonlinear_program import NonlinearProgram
from labs.resumable import Resumable, run_to_completion, timed

STALL_TOLERANCE = 1e-13
"""A whole step that changes y by less than this, in its units or parts of it, is none."""


def init(program: NonlinearProgram, y: np.ndarray, options: SqpOptions) -> SqpIterate:
    """The first guess y (n,), cut to the bounds. Raises LabError if it does not fit."""
    n = len(program.lower)
    if y.shape != (n,):
        raise LabError(f"the first guess has shape {y.shape}; the programme takes ({n},)")
    empty = np.flatnonzero(program.lower > program.upper)
    y = np.minimum(np.maximum(np.array(y, dtype=float), program.lower), program.upper)
    values = program.values(y)
    stopped = ""
    if empty.size:
        name = program.variable_name(int(empty[0]))
        stopped = f"Infeasible: the lower bound of {name} is above its upper one."
    elif not np.isfinite(values.f):
        stopped = "Failed: the first guess diverges. Start from another."
    largest = MAX_VIOLATION_GROWTH * max(1.0, violation(values))
    multipliers = (np.zeros(len(values.c)), np.zeros(len(values.g)), np.zeros(n))
    infeasible = bool(empty.size)
    return SqpIterate(
        y, values, *multipliers, Filter(largest), stopped=stopped, infeasible=infeasible
    )


def step(program: NonlinearProgram, options: SqpOptions, at: SqpIterate) -> SqpIterate:
    """One iteration. What has stopped stays as it is."""
    return run_to_completion(resumable_step(program, options, at))


def resumable_step(
    program: NonlinearProgram, options: SqpOptions, at: SqpIterate
) -> Resumable[SqpIterate]:
    """The same, pausing between pieces of some milliseconds."""
    if at.stopped:
        return at
    seconds = {"derivatives": 0.0, "QP": 0.0, "line search": 0.0}
    if at.derivatives is None:
        at = yield from timed(_evaluate_derivatives(program, options, at), seconds, "derivatives")
        if at.stopped:
            return replace(at, seconds=seconds)
    before = at
    at = yield from take_step(program, options, at, seconds)
    at = replace(at, iteration=at.iteration + 1)
    if not at.stopped:
        at = yield from timed(_evaluate_derivatives(program, options, at), seconds, "derivatives")
    if at.bfgs and at.derivatives and before.derivatives:
        change = at.gradient(at.derivatives) - at.gradient(before.derivatives)
        at = replace(at, bfgs=at.bfgs.update(at.y - before.y, change))
    if not at.stopped:
        at = _check_termination(program, options, before, at)
    return replace(at, seconds=seconds)


def solve(
    program: NonlinearProgram, y: np.ndarray, options: SqpOptions | None = None
) -> SqpIterate:
    """Iterates from the first guess y (n,) until it stops."""
    options = options or SqpOptions()
    at = init(program, y, options)
    while not at.stopped:
        at = step(program, options, at)
    return at


def warm_start(
    program: NonlinearProgram, last: PrimalDualPoint | SqpIterate, options: SqpOptions
) -> SqpIterate:
    """From where another programme's iterate ended, with its multipliers where they fit: for a
    problem that is a little different."""
    new = init(program, last.y, options)
    if len(new.lam) != len(last.lam) or len(new.mu) != len(last.mu):
        return new
    return replace(new, lam=last.lam, mu=last.mu, nu=last.nu)


def prepare() -> None:
    """Compiles what is asked for."""
    sqp_active_set.prepare()


def _evaluate_derivatives(
    program: NonlinearProgram, options: SqpOptions, at: SqpIterate
) -> Resumable[SqpIterate]:
    """With derivatives at y, the first Hessian that BFGS learns from, and whether it has
    converged there."""
    d = program.derivatives(at.y)
    yield
    if not all(np.isfinite(part).all() for part in (d.f_y, d.c_y.data, d.g_y.data)):
        return replace(at, stopped="Failed: the derivatives are not finite. Start from elsewhere.")
    largest = max(at.largest_gradient, float(np.abs(d.f_y).max(initial=0.0)))
    found = optimality(program, at.y, at.values, d, at.lam, at.mu, largest)
    at = replace(at, derivatives=d, optimality=found, nu=found.nu, largest_gradient=largest)
    if max(found.residual, found.violation) <= options.tolerance and not at.qp_inexact:
        return replace(at, converged=True, stopped=_convergence_message(at))
    if options.hessian == "bfgs" and at.bfgs is None:
        f_yy = yield from program.hessian(at.y, at.lam, at.mu, exact=False)
        at = replace(at, bfgs=sqp_bfgs.initial_hessian(f_yy))
    return at


def _check_termination(
    program: NonlinearProgram, options: SqpOptions, before: SqpIterate, at: SqpIterate
) -> SqpIterate:
    """Stopped here without convergence, if there is a reason."""
    assert at.optimality
    change = float((np.abs(at.y - before.y) / (1.0 + np.abs(at.y))).max(initial=0.0))
    stalled = at.alpha == 1.0 and change < STALL_TOLERANCE and not at.penalty
    if not stalled and at.iteration < options.iterations:
        return at
    where = f"KKT residual {at.optimality.residual:.1e}; {worst_violation(program, at.values)}"
    if stalled:
        stopped = f"Stopped short: steps have become too small to be told from rounding, {where}."
        return replace(at, stopped=stopped)
    stopped = (
        f"Stopped short after {at.iteration} iterations: {where}. Solve again from here to go on."
    )
    return replace(at, stopped=stopped, out_of_iterations=True)


def _convergence_message(at: SqpIterate) -> str:
    assert at.optimality
    return (
        f"Converged after {at.iteration} iteration{'s'[: at.iteration != 1]}: KKT residual "
        f"{at.optimality.residual:.1e}, constraints met to {at.violation:.1e}."
    )
