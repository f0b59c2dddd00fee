"""How long a step may be: a filter's line search (beyond the notes; Wachter and Biegler, "Line
search filter methods for nonlinear programming", 2005).

Two things are to fall, the objective f and the violation theta = |c|_1 + |max(g, 0)|_1. Along a
step p the lengths alpha = 1, 1/2, 1/4, ... are tried until one

    lowers f by a part of what its slope m = f_y' p promises       where theta is small, m < 0
    lowers theta or f enough compared with where the step begins   elsewhere

and no pair (theta, f) that the filter remembers is as good in both. Where the whole step raises
theta, second-order corrections of it are tried first: the constraints are curved, and without
these a step may be refused near a solution that is nearly right.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from labs.problems.nonlinear_program import NonlinearProgram, ProgramValues
from labs.resumable import Resumable

MAX_HALVINGS = 20
"""Of alpha, at most."""
MAX_CORRECTIONS = 3
"""Second-order ones of a step, at most."""
ARMIJO = 1e-4
MAX_VIOLATION_GROWTH = 1e4
"""Of theta beyond what it is at first, or 1."""
MARGIN = 1e-5
"""What theta must fall by, in parts of theta, or f."""
ROUNDING = 1e-14
"""Changes of f below this part of its size cannot be told from rounding."""


def violation(values: ProgramValues) -> float:
    """theta, in the units of c and g."""
    return float(np.abs(values.c).sum() + np.maximum(values.g, 0.0).sum())


@dataclass(frozen=True)
class Filter:
    """Pairs (theta, f), each of which forbids what is not better than it in one of them."""

    largest: float
    """Most that theta may be at all."""
    pairs: tuple[tuple[float, float], ...] = ()

    def accepts(self, theta: float, f: float, rounding: float) -> bool:
        """Whether a point is better than every pair in one of both."""
        return theta <= self.largest and all(
            theta <= (1.0 - MARGIN) * t or f <= v - MARGIN * t + rounding for t, v in self.pairs
        )

    def with_pair(self, theta: float, f: float) -> "Filter":
        """With one pair more, and without those it makes needless."""
        kept = tuple((t, v) for t, v in self.pairs if t < theta or v < f)
        return Filter(self.largest, (*kept, (theta, f)))


class AcceptedPoint(NamedTuple):
    """The point that a search accepted."""

    y: np.ndarray
    values: ProgramValues
    alpha: float
    filter: Filter
    corrected: bool = False
    """Whether by a second-order correction."""


class LineSearchResult(NamedTuple):
    """Its end: a point, or the reason why there is none."""

    trial: AcceptedPoint | None
    diverged: bool = False
    """Whether the programme had no value at any length."""


def filter_line_search(
    program: NonlinearProgram,
    y: np.ndarray,
    values: ProgramValues,
    p: np.ndarray,
    slope: float,
    filter_: Filter,
    corrected: Callable[[np.ndarray, ProgramValues], np.ndarray | None],
) -> Resumable[LineSearchResult]:
    """Along p from y, f falling by `slope`. `corrected` makes of a step and of the values at its
    end the corrected step, or None."""
    theta, f = violation(values), values.f
    rounding = ROUNDING * (abs(f) + abs(slope))
    small = 1e-4 * max(1.0, filter_.largest / MAX_VIOLATION_GROWTH)
    valued = False

    def accept_trial(
        y_new: np.ndarray, new: ProgramValues, alpha: float, again: bool
    ) -> AcceptedPoint | None:
        theta_new = violation(new)
        if not filter_.accepts(theta_new, new.f, rounding):
            return None
        steep = slope < 0.0 and alpha * (-slope) ** 2.3 > theta**1.1
        if steep and theta <= small:
            if new.f - f <= ARMIJO * alpha * slope + rounding:
                return AcceptedPoint(y_new, new, alpha, filter_, again)
            return None
        if theta_new <= (1.0 - MARGIN) * theta or new.f - f <= -MARGIN * theta + rounding:
            return AcceptedPoint(y_new, new, alpha, filter_.with_pair(theta, f), again)
        return None

    for k in range(MAX_HALVINGS + 1):
        alpha = 0.5**k
        y_new = y + alpha * p
        new = program.values(y_new)
        yield
        if not np.isfinite(new.f):
            continue
        valued = True
        trial = accept_trial(y_new, new, alpha, False)
        if trial:
            return LineSearchResult(trial)
        if k == 0 and violation(new) >= theta:
            step, at, least = p, new, violation(new)
            for _ in range(MAX_CORRECTIONS):
                better = corrected(step, at)
                if better is None:
                    break
                step, y_new = better, y + better
                at = program.values(y_new)
                yield
                if not np.isfinite(at.f):
                    break
                trial = accept_trial(y_new, at, 1.0, True)
                if trial:
                    return LineSearchResult(trial)
                if violation(at) > 0.99 * least:
                    break
                least = violation(at)
    return LineSearchResult(None, not valued)
