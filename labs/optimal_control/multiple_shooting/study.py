"""The same problem from the same guess with other numbers of segments, from one to one a piece."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from labs.algorithms import sqp
from labs.optimal_control.multiple_shooting.params import MultipleShootingParams
from labs.resumable import run_to_completion
from labs.tasks.direct.guesses import first_guess

MAX_ITERATIONS = 40
"""For each of them."""
SEGMENT_COUNTS = (1, 2, 4, 5, 10, 20, 40)
"""Numbers of segments that are tried, as far as there are pieces; and N."""


@dataclass(frozen=True, eq=False)
class SegmentSweep:
    """Of each number of segments tried. Arrays are never written into again."""

    segments: np.ndarray
    """(k,)"""
    iterations: np.ndarray
    """(k,)"""
    cost: np.ndarray
    """(k,)"""
    converged: np.ndarray
    """(k,) bool"""
    nonzeros: np.ndarray
    """(k,) of L_zz and c_z"""
    variables: np.ndarray
    """(k,)"""


def no_study() -> SegmentSweep:
    """Of none."""
    none = np.zeros(0)
    return SegmentSweep(none, none, none, np.zeros(0, bool), none, none)


def study_segments(params: MultipleShootingParams) -> Iterator[SegmentSweep | None]:
    """From the first guess, each until it stops or has had its iterations, the most segments first;
    what is known after each of them, and None in between."""
    rows: list[tuple[float, ...]] = []
    guess = first_guess(params, params.N)
    options = sqp.SqpOptions(hessian=params.hessian, iterations=MAX_ITERATIONS)
    for m in sorted({m for m in SEGMENT_COUNTS if m < params.N} | {params.N}, reverse=True):
        shooting = params.shooting(m)
        at = sqp.init(shooting, shooting.variables(guess.X, guess.U, guess.T), options)
        while not at.stopped:
            at = sqp.step(shooting, options, at)
            yield None
        if not np.isfinite(at.values.f):
            continue
        hessian = shooting.hessian(at.y, at.lam, at.mu, exact=False)
        entries = run_to_completion(hessian).nnz + shooting.derivatives(at.y).c_y.nnz
        rows.insert(0, (m, at.iteration, at.values.f, at.converged, entries, shooting.n))
        columns = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
        segments, iterations, cost, converged, *sizes = columns
        yield SegmentSweep(segments, iterations, cost, converged.astype(bool), *sizes)
