"""How far a point is from meeting the conditions of optimality of a nonlinear programme (notes,
2.3.1; Karush, Kuhn and Tucker), each in parts of what it is made of, so that units do not matter:

    f_y + c_y' lam + g_y' mu + nu = 0,   mu >= 0,  mu' g = 0,   nu only at bounds,   c = 0,  g <= 0
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_array

from labs.problems.nonlinear_program import NonlinearProgram, ProgramDerivatives, ProgramValues

NEGLIGIBLE_VIOLATION = 1e-9
"""A constraint missed by less, in its unit, is not worth a word."""


class Optimality(NamedTuple):
    """At a point and its multipliers."""

    residual: float
    """Of stationarity and complementarity, the KKT residual."""
    violation: float
    """Of c = 0 and g <= 0."""
    nu: np.ndarray
    """(n,) the bounds' multipliers that make stationarity hold where a bound is."""


def optimality(
    program: NonlinearProgram,
    y: np.ndarray,
    values: ProgramValues,
    derivatives: ProgramDerivatives,
    lam: np.ndarray,
    mu: np.ndarray,
    largest_gradient: float,
) -> Optimality:
    """At y. `largest_gradient` is the largest |f_y| met so far, a scale where f_y vanishes."""
    f_y, c_y, g_y = derivatives
    by_c, by_g = _absolute(c_y), _absolute(g_y)
    r = f_y + c_y.T @ lam + g_y.T @ mu
    terms = np.abs(f_y) + by_c.T @ np.abs(lam) + by_g.T @ mu
    scale = max(float(terms.max(initial=0.0)), largest_gradient, 1e-300)
    size = np.maximum(np.abs(y), 1.0)
    gap = np.where(r > 0.0, y - program.lower, program.upper - y) / size
    nu = np.where(gap < np.abs(r) / scale, -r, 0.0)
    stationarity = float((np.abs(r) / scale * np.minimum(gap, 1.0)).max(initial=0.0))
    off = np.abs(values.c) / np.maximum(by_c @ size, 1e-300)
    g_scale = np.maximum(by_g @ size, 1e-300)
    over, slack = np.maximum(values.g, 0.0) / g_scale, np.maximum(-values.g, 0.0) / g_scale
    push = mu * (by_g @ np.ones(len(y))) / scale
    complementarity = float((push * np.minimum(slack, 1.0)).max(initial=0.0))
    return Optimality(
        max(stationarity, complementarity),
        max(float(off.max(initial=0.0)), float(over.max(initial=0.0))),
        nu,
    )


def worst_violation(program: NonlinearProgram, values: ProgramValues) -> str:
    """The constraint that is missed by most, as a part of a sentence."""
    c, g = np.abs(values.c), values.g
    by_c, by_g = float(c.max(initial=0.0)), float(g.max(initial=0.0))
    if max(by_c, by_g) < NEGLIGIBLE_VIOLATION:
        return "the constraints are met"
    if by_c >= by_g:
        return f"{program.equality_name(int(np.argmax(c)))} is off by {by_c:.2g}"
    return f"{program.inequality_name(int(np.argmax(g)))} is off by {by_g:.2g}"


def _absolute(of: csc_array) -> csc_array:
    return csc_array((np.abs(of.data), of.indices, of.indptr), shape=of.shape)
