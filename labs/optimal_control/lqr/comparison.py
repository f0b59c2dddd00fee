"""Riccati against least squares over growing horizons: the same controls, O(N) and O(N^3)."""

from collections.abc import Mapping
from dataclasses import dataclass
from time import thread_time

import numpy as np

from labs.algorithms.least_squares_lqr import solve_least_squares
from labs.algorithms.riccati import solve
from labs.problems.linear_quadratic import LqrProblem

_SHORT_HORIZONS, _LONG_HORIZONS = (4, 6, 9, 14, 22, 34, 50), (10, 20, 40, 80, 130, 190, 260)
COMPARED_HORIZONS: Mapping[str, tuple[int, ...]] = {
    "cart-pole": _LONG_HORIZONS,
    "pendulum": _LONG_HORIZONS,
    "mass": _LONG_HORIZONS,
    "ur5": _SHORT_HORIZONS,
    "own": _SHORT_HORIZONS,
}
"""N of each system, as far as least squares takes a few hundredths of a second."""
HORIZON_COUNT = 7
"""How many of each system."""
DEVIATION = 0.1
"""[m, rad, m/s, rad/s] every component of the dx_0 they start from."""


@dataclass(frozen=True)
class Comparison:
    """Both solutions of one problem."""

    difference: float
    """Largest difference between their controls, as a share of the largest control."""
    riccati: float
    """Processor time [s], from the given matrices to all controls from x_0."""
    least_squares: float
    """The same [s]."""


def compare(problem: LqrProblem) -> Comparison:
    """Solves the problem both ways."""
    x0 = np.full(problem.n, DEVIATION)
    begin = thread_time()
    _, riccati = problem.rollout(solve(problem), x0)
    middle = thread_time()
    least_squares = solve_least_squares(problem, x0)
    end = thread_time()
    largest = float(np.abs(least_squares).max()) or 1.0
    difference = float(np.abs(riccati - least_squares).max()) / largest
    return Comparison(difference, middle - begin, end - middle)
