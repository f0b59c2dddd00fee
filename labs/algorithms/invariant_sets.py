"""Invariant sets and those from which they are reached, of a linear system with limits (notes,
2.5.2; Borrelli, Bemporad and Morari, "Predictive Control", 10).

    x+ = A x + B u + c,   x in X,   u in U

A set S is control invariant if from each x in S some u in U leads to S; under u = K x, A + B K
for A, it is positively invariant if x+ is in S. From which states S is reached in a step:

    Pre(S) = {x in X : A x + B u + c in S for some u in U}

In the plane Pre(S) = {x in X : A x in S + (-B U - c)}, a sum of polygons; elsewhere, or where S or
U are unbounded, the shadow of a polyhedron of (x, u).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labs.algorithms.polygons import (
    UnboundedError,
    minkowski_sum,
    normalize_rows,
    polyhedron_from_vertices,
    vertices,
)
from labs.algorithms.polytopes import is_empty, project, support
from labs.problems.linear_mpc import LinearMpcProblem, check_holds
from labs.problems.polyhedron import Polyhedron

TOLERANCE = 1e-9
MAX_ITERATIONS = 500


def backward_reachable(
    A: np.ndarray,
    B: np.ndarray,
    state_set: Polyhedron,
    control_set: Polyhedron,
    target: Polyhedron,
    c: np.ndarray | None = None,
) -> Polyhedron:
    """Pre(target), of A (n, n), B (n, m), c (n,): the states of X from which some u of U leads to
    the target in one step."""
    drift = np.zeros(len(A)) if c is None else c
    if len(A) == 2 and B.shape[1] <= 2:
        try:
            return _backward_reachable_by_minkowski_sum(
                A, B, state_set, control_set, vertices(target), drift
            )
        except UnboundedError:
            pass
    n, m = B.shape
    both = target.preimage(np.hstack([A, B]))
    both = Polyhedron(both.H, target.h - target.H @ drift)
    in_X = state_set.preimage(np.eye(n, n + m))
    in_U = control_set.preimage(np.eye(m, n + m, k=n))
    return project(both.intersection(in_X).intersection(in_U), n)


def _backward_reachable_by_minkowski_sum(
    A: np.ndarray,
    B: np.ndarray,
    state_set: Polyhedron,
    control_set: Polyhedron,
    target: np.ndarray,
    c: np.ndarray,
) -> Polyhedron:
    controls = _control_interval(control_set) if B.shape[1] == 1 else vertices(control_set)
    before = polyhedron_from_vertices(minkowski_sum(target, -controls @ B.T - c))
    return polyhedron_from_vertices(vertices(before.preimage(A).intersection(state_set)))


def _control_interval(control_set: Polyhedron) -> np.ndarray:
    """The ends (2, 1) of a set of the line; none (0, 1) where it is empty."""
    H, h = control_set.H[:, 0], control_set.h
    high = (h[H > 0.0] / H[H > 0.0]).min(initial=np.inf)
    low = (h[H < 0.0] / H[H < 0.0]).max(initial=-np.inf)
    if low > high or (h[H == 0.0] < 0.0).any():
        return np.zeros((0, 1))
    if np.isinf([low, high]).any():
        raise UnboundedError("the set reaches to infinity: add the limits that bound it")
    return np.array([[low], [high]])


def feasible_sets(
    problem: LinearMpcProblem, holds: Sequence[int] | None = None
) -> list[Polyhedron]:
    """X_0 ... X_N: from X_i the terminal set X_N = X_f is reached in N - i steps within X and U;
    X_0 is where the problem is feasible. Without X_f, X_N is all of R^n. With `holds`, which add up
    to N, by controls held over holds[0], holds[1], ... steps. Raises LabError if they do not."""
    n, m, k = problem.n, problem.m, problem.N
    holds = [1] * k if holds is None else holds
    check_holds(holds, k)
    x_of, u_of = np.eye(n, n + m), np.eye(m, n + m, k=n)
    ahead = np.vstack([np.hstack([problem.A, problem.B]), u_of])
    drift = np.zeros(n + m) if problem.c is None else np.append(problem.c, np.zeros(m))
    nowhere = Polyhedron(np.zeros((0, n)), np.zeros(0))
    sets = [nowhere if problem.terminal_set is None else problem.terminal_set]
    for hold in reversed(holds):
        both = sets[0].preimage(x_of)
        for _ in range(hold):
            k -= 1
            X = _tighten_set(problem.state_set, problem.state_margins, k)
            U = _tighten_set(problem.control_set, problem.control_margins, k)
            if hold == 1:
                before = backward_reachable(problem.A, problem.B, X, U, sets[0], problem.c)
            else:
                both = Polyhedron(both.H, both.h - both.H @ drift).preimage(ahead)
                both = both.intersection(X.preimage(x_of)).intersection(U.preimage(u_of))
                before = project(both, n)
            sets.insert(0, before)
    return sets


def _tighten_set(given: Polyhedron, margins: np.ndarray | None, k: int) -> Polyhedron:
    return given if margins is None else Polyhedron(given.H, given.h - margins[k])


def inclusion_violation(inner: Polyhedron, outer: Polyhedron) -> float:
    """How far `inner` reaches out of `outer`: the largest distance by which it exceeds a row; below
    zero where it stays away from all of them, -inf where it is empty."""
    unit = normalize_rows(outer)
    return float((support(inner, unit.H) - unit.h).max(initial=-np.inf))


def positive_invariance_violation(A: np.ndarray, given: Polyhedron) -> float:
    """How far one step x+ = A x leads out of the set; at most 0 if it is positively invariant."""
    unit = normalize_rows(given)
    return float((support(given, unit.H @ A) - unit.h).max(initial=-np.inf))


def control_invariance_violation(
    A: np.ndarray,
    B: np.ndarray,
    control_set: Polyhedron,
    given: Polyhedron,
    c: np.ndarray | None = None,
) -> float:
    """How far the set reaches out of Pre(set); at most 0 if it is control invariant."""
    anywhere = Polyhedron(np.zeros((0, len(A))), np.zeros(0))
    return inclusion_violation(given, backward_reachable(A, B, anywhere, control_set, given, c))


@dataclass(frozen=True, eq=False)
class InvariantSet:
    """On the way to the maximal control invariant set, which lies within."""

    count: int
    """Steps so far."""
    set: Polyhedron
    residual: float = np.inf
    """How far the set before reaches out of this one."""
    found: bool = False
    """Whether one more step takes nothing away."""
    done: str = ""
    """Why it stopped, in a sentence; empty while there is more to do."""


def init(state_set: Polyhedron) -> InvariantSet:
    """All of X."""
    return InvariantSet(0, state_set)


def step(
    A: np.ndarray,
    B: np.ndarray,
    control_set: Polyhedron,
    at: InvariantSet,
    c: np.ndarray | None = None,
) -> InvariantSet:
    """S becomes Pre(S) within S: what can stay in S for a step longer."""
    left = backward_reachable(A, B, at.set, control_set, at.set, c)
    residual = inclusion_violation(at.set, left)
    if is_empty(left):
        done = f"nothing is left after {at.count + 1} steps: from no state can it stay in X"
        return InvariantSet(at.count + 1, left, residual, False, done)
    if residual <= TOLERANCE:
        return InvariantSet(at.count, at.set, residual, True, f"invariant after {at.count} steps")
    if at.count >= MAX_ITERATIONS:
        done = f"stopped after {MAX_ITERATIONS} steps, the last of which took {residual:.2g} away"
        return InvariantSet(at.count, at.set, residual, False, done)
    return InvariantSet(at.count + 1, left, residual)


def maximal_control_invariant_set(
    A: np.ndarray,
    B: np.ndarray,
    state_set: Polyhedron,
    control_set: Polyhedron,
    c: np.ndarray | None = None,
) -> InvariantSet:
    """From X inwards until a step takes away less than TOLERANCE of length: from outside, to within
    that, where it takes infinitely many."""
    at = init(state_set)
    while not at.done:
        at = step(A, B, control_set, at, c)
    return at
