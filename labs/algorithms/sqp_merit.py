"""How long a step of the elastic mode may be (beyond the notes): the first of alpha = 1, 1/2, ...
that lowers phi = f + gamma theta by a part of what the step's model promises."""

from collections.abc import Callable

import numpy as np

from labs.algorithms.sqp_filter import (
    ARMIJO,
    MAX_HALVINGS,
    ROUNDING,
    AcceptedPoint,
    Filter,
    LineSearchResult,
    violation,
)
from labs.problems.nonlinear_program import NonlinearProgram, ProgramValues
from labs.resumable import Resumable


def merit_line_search(
    program: NonlinearProgram,
    y: np.ndarray,
    values: ProgramValues,
    p: np.ndarray,
    slope: float,
    gamma: float,
    filter_: Filter,
    corrected: Callable[[np.ndarray, ProgramValues], np.ndarray | None],
) -> Resumable[LineSearchResult]:
    """Along p from y, phi falling by `slope`; the filter is forgotten, but for its largest theta.
    `corrected` as in `sqp_filter.search`."""
    phi = values.f + gamma * violation(values)
    rounding = ROUNDING * abs(phi)
    fresh, valued = Filter(filter_.largest), False
    for k in range(MAX_HALVINGS + 1):
        alpha = 0.5**k
        ends = [y + alpha * p]
        new = program.values(ends[0])
        yield
        if not np.isfinite(new.f):
            continue
        valued = True
        if new.f + gamma * violation(new) - phi <= ARMIJO * alpha * slope + rounding:
            return LineSearchResult(AcceptedPoint(ends[0], new, alpha, fresh))
        better = corrected(p, new) if k == 0 else None
        if better is not None:
            new = program.values(y + better)
            yield
            if new.f + gamma * violation(new) - phi <= ARMIJO * slope + rounding:
                return LineSearchResult(AcceptedPoint(y + better, new, 1.0, fresh, True))
    return LineSearchResult(None, not valued)
