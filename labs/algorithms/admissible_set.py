"""The maximal output admissible set (notes, 2.5.2; Gilbert and Tan, 1991): all states from which
x+ = A x meets its limits for ever.

    O_inf = {x : H C A^t x <= h,  t = 0, 1, ...},   O_t: the same up to t

It is O_t* with the first t at which no limit can be broken one step later by a state of O_t:

    J_i* = max over x in O_t of  H_i C A^(t+1) x - h_i  <= 0  for every i.

There is such a t if A is asymptotically stable, (C, A) observable, and the limits bounded with the
origin inside. Here the limits are those on x, {x : H C x <= h}; under u = K x, A is A + B K and
they are X and K x in U (`closed_loop_limits`).
"""

from dataclasses import dataclass

import numpy as np

from labs.algorithms.polytopes import support, support_by_linear_programs
from labs.errors import LabError
from labs.problems.polyhedron import Polyhedron
from labs.resumable import Resumable

TOLERANCE = 1e-9
"""J_i* up to this share of h_i counts as zero."""
MAX_STEPS = 300
"""Steps, before it is said that there is no end in sight."""


@dataclass(frozen=True, eq=False)
class AdmissibleSet:
    """O_t on the way to O_inf."""

    t: int
    set: Polyhedron
    """O_t, without the rows that J_i* <= 0 showed to be implied."""
    J: np.ndarray
    """J_i* of each limit as the last step found them: over O_(t-1), or over O_t where it is done;
    NaN before the first."""
    found: bool = False
    """Whether this is O_inf; t is t* then."""
    done: str = ""
    """Why it stopped, in a sentence; empty while there is more to do."""


def closed_loop_limits(K: np.ndarray, state_set: Polyhedron, control_set: Polyhedron) -> Polyhedron:
    """{x in X : K x in U}, of K (m, n)."""
    return state_set.intersection(control_set.preimage(K))


def init(limits: Polyhedron) -> AdmissibleSet:
    """O_0. Raises LabError where the origin is not within the limits."""
    if (limits.h < 0.0).any():
        raise LabError("the origin breaks a limit: the admissible set is one around the origin")
    return AdmissibleSet(0, limits, np.full(len(limits.h), np.nan))


def step(A: np.ndarray, limits: Polyhedron, at: AdmissibleSet) -> AdmissibleSet:
    """From O_t to O_(t+1), or to the end: by vertices where that is quicker."""
    later = limits.preimage(np.linalg.matrix_power(A, at.t + 1))
    return _next_iterate(A, limits, at, later, support(at.set, later.H) - later.h)


def resumable_step(
    A: np.ndarray, limits: Polyhedron, at: AdmissibleSet
) -> Resumable[AdmissibleSet]:
    """The same as the notes have it: by one linear programme for each J_i*, with pauses."""
    later = limits.preimage(np.linalg.matrix_power(A, at.t + 1))
    J = np.zeros(len(later.h))
    for i in range(len(J)):
        J[i] = support_by_linear_programs(at.set, later.H[i : i + 1])[0] - later.h[i]
        yield
    return _next_iterate(A, limits, at, later, J)


def _next_iterate(
    A: np.ndarray, limits: Polyhedron, at: AdmissibleSet, later: Polyhedron, J: np.ndarray
) -> AdmissibleSet:
    cuts = J / np.maximum(1.0, limits.h) > TOLERANCE
    if not cuts.any():
        done = f"t* = {at.t}: a state that meets all limits up to t* meets them for ever"
        return AdmissibleSet(at.t, at.set, J, True, done)
    if at.t >= MAX_STEPS:
        radius = float(np.abs(np.linalg.eigvals(A)).max())
        why = f"the spectral radius is {radius:.4g}"
        why += ": make it less than 1" if radius >= 1.0 else ", near 1: it takes longer than this"
        return AdmissibleSet(at.t, at.set, J, False, f"no t* up to {MAX_STEPS}: {why}")
    cut = Polyhedron(later.H[cuts], later.h[cuts])
    return AdmissibleSet(at.t + 1, at.set.intersection(cut), J)


def maximal_output_admissible_set(A: np.ndarray, limits: Polyhedron) -> AdmissibleSet:
    """O_inf of x+ = A x, A (n, n)."""
    at = init(limits)
    while not at.done:
        at = step(A, limits, at)
    return at
