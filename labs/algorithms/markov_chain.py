"""Markov chains and Markov reward processes on finitely many states (notes, 3.3.1 and 3.3.2).

P (X, X) holds in row x the probabilities of going from x to each state; every row sums to 1.
A distribution over the states is a row that moves with P, costs-to-go are a column that P
averages:

    mu_(k+1) = mu_k P                   where the state is after k + 1 steps, (X,)
    pi = pi P,  sum of pi = 1           a stationary distribution
    V = C + gamma P V                   so that V = (I - gamma P)^-1 C, costs C (X,)
    V_(k+1) = C + gamma P V_k           the same by iteration, max|V_k - V| <= gamma^k max|V_0 - V|

States that lead to one another form a communicating class. A class nobody leaves is closed; each
closed class has one stationary distribution, and P has the eigenvalue 1 once for each. If the
returns to a class take multiples of d > 1 steps only, it has the period d, and P has all d-th
roots of 1 as eigenvalues; otherwise all the rest lies inside the unit circle (Perron-Frobenius).

With gamma = 1, I - P is singular: 1 is an eigenvalue of P. V exists all the same where the chain
is sure to end in states that cost nothing (V = 0 there; without them the system is regular).
Anywhere else costs are added for ever. Where a chain can end is a matter of its graph, of which
entries of P are 0, and not of computed probabilities.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

TOLERANCE = 1e-9
"""Error of V, relative to its largest entry, that ends the iteration: nine digits."""


@dataclass(frozen=True, eq=False)
class CommunicatingClass:
    """States that lead to one another."""

    states: np.ndarray
    """Their indices, ascending."""
    closed: bool
    """Whether nothing leads out of it."""
    period: int
    """Greatest common divisor of the lengths of all ways back; 0 where there is no way back."""


@dataclass(frozen=True, eq=False)
class CostToGo:
    """What starting in each state costs in all."""

    V: np.ndarray
    """(X,); 0 where the costs have no finite sum."""
    finite: np.ndarray
    """(X,) bool: where they have one. All of them for gamma < 1."""

    @property
    def values_or_nan(self) -> np.ndarray:
        """(X,) V, and NaN where it has no value."""
        return np.where(self.finite, self.V, np.nan)


def communicating_classes(P: np.ndarray) -> list[CommunicatingClass]:
    """The classes of P, by their first states."""
    _, label = connected_components(P > 0.0, connection="strong")
    groups = [np.flatnonzero(label == k) for k in range(label.max() + 1)]
    return [
        CommunicatingClass(
            states, not np.delete(P[states], states, axis=1).any(), _period(P, states)
        )
        for states in sorted(groups, key=lambda states: int(states[0]))
    ]


def _period(P: np.ndarray, states: np.ndarray) -> int:
    """Levels l by breadth first: every transition x -> x' within the class closes ways whose
    lengths differ by l(x) + 1 - l(x')."""
    inside = P[np.ix_(states, states)] > 0.0
    level = np.full(len(states), -1)
    level[0], front = 0, [0]
    while front:
        x = front.pop(0)
        fresh = np.flatnonzero(inside[x] & (level < 0))
        level[fresh] = level[x] + 1
        front.extend(map(int, fresh))
    start, end = np.nonzero(inside)
    return int(np.gcd.reduce(level[start] + 1 - level[end])) if len(start) else 0


def is_irreducible(classes: list[CommunicatingClass]) -> bool:
    """Whether every state leads to every other."""
    return len(classes) == 1


def stationary_distribution(P: np.ndarray, closed: CommunicatingClass) -> np.ndarray:
    """pi (X,), the only stationary distribution that lives on a closed class: elimination
    without any subtraction (Grassmann, Taksar and Heyman 1985), exact to rounding in each entry."""
    A = P[np.ix_(closed.states, closed.states)].copy()
    n = len(A)
    for k in range(n - 1, 0, -1):
        A[:k, k] /= A[k, :k].sum()
        A[:k, :k] += np.outer(A[:k, k], A[k, :k])
    weights = np.ones(n)
    for k in range(1, n):
        weights[k] = weights[:k] @ A[:k, k]
    pi = np.zeros(len(P))
    pi[closed.states] = weights / weights.sum()
    return pi


def can_reach(P: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """(X,) bool: from where the chain may come into `goal` (X,) bool, those in it included."""
    found = goal
    while True:
        more = found | (P[:, found] > 0.0).any(axis=1)
        if (more == found).all():
            return found
        found = more


def _transient_sums(P: np.ndarray, gamma: float, inside: np.ndarray, B: np.ndarray) -> np.ndarray:
    """(n, k): (I - gamma P_TT)^-1 B, what B (n, k) adds up to before the n states T of `inside`
    (X,) bool are left for good. Elimination without any subtraction: what leaves a state for the
    others is added up and not taken as 1 - P[x, x], as in `stationary`. So a 0 stays 0, and for
    B >= 0 every entry is exact to rounding, however rarely T is left."""
    A, B = gamma * P[np.ix_(inside, inside)], B.copy()
    leaving = 1.0 - gamma + gamma * P[np.ix_(inside, ~inside)].sum(axis=1)
    onward = np.empty(len(A))
    for k in range(len(A) - 1, -1, -1):
        onward[k] = leaving[k] + A[k, :k].sum()
        visits = A[:k, k] / onward[k]
        A[:k, :k] += np.outer(visits, A[k, :k])
        leaving[:k] += visits * leaving[k]
        B[:k] += np.outer(visits, B[k])
    for k in range(len(A)):
        B[k] = (B[k] + A[k, :k] @ B[:k]) / onward[k]
    return B


def absorption(P: np.ndarray, classes: list[CommunicatingClass]) -> np.ndarray:
    """(X, K) probabilities of ending in each of the K closed classes, by the state of the start:
    B = (I - P_TT)^-1 P_TR for the transient states T, those of classes that are not closed. 0 is
    what no way leads to."""
    closed = [c for c in classes if c.closed]
    ends = np.zeros((len(P), len(closed)))
    for k, c in enumerate(closed):
        ends[c.states, k] = 1.0
    transient: np.ndarray = ends.sum(axis=1) == 0.0
    ends[transient] = _transient_sums(P, 1.0, transient, P[transient] @ ends)
    return ends


def long_run_distribution(P: np.ndarray, classes: list[CommunicatingClass]) -> np.ndarray:
    """(X, X), in row x the share of time spent in each state in the long run by one who starts
    in x: the limit of (I + P + ... + P^(n-1)) / n, which exists for every P."""
    shares = np.stack([stationary_distribution(P, c) for c in classes if c.closed])
    mixed: np.ndarray = absorption(P, classes) @ shares
    return mixed


def eigenvalues(P: np.ndarray) -> np.ndarray:
    """(X,) complex, the largest magnitude first, and of one magnitude the largest real part."""
    found = np.linalg.eigvals(P).astype(complex)
    order = np.lexsort((found.imag, -found.real.round(9), -np.abs(found).round(9)))
    ordered: np.ndarray = found[order]
    return ordered


def cost_to_go(
    P: np.ndarray, C: np.ndarray, gamma: float, classes: list[CommunicatingClass]
) -> CostToGo:
    """V (X,) = (I - gamma P)^-1 C, gamma in [0, 1]; see the top for gamma = 1. Where C >= 0,
    every entry is exact to rounding."""
    finite, left = np.ones(len(P), bool), np.ones(len(P), bool)
    if gamma == 1.0:
        costly = np.zeros(len(P), bool)
        for c in classes:
            if c.closed:
                left[c.states] = False
                costly[c.states] = C[c.states].any()
        finite = ~can_reach(P, costly)
        left &= finite
    V = np.zeros(len(P))
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        V[left] = _transient_sums(P, gamma, left, C[left, None])[:, 0]
    finite = finite & np.isfinite(V)  # there is no number for what lies beyond the largest float
    return CostToGo(np.where(finite, V, 0.0), finite)


def normalized_discounted_costs(
    P: np.ndarray, C: np.ndarray, gammas: np.ndarray, classes: list[CommunicatingClass]
) -> np.ndarray:
    """(len(gammas), X): (1 - gamma) V, the costs ahead averaged with weights (1 - gamma) gamma^k
    that sum to 1. C itself at gamma = 0; at gamma = 1, by Abel's theorem, the mean cost of a step
    in the long run."""
    near = gammas < 1.0
    means = np.empty((len(gammas), len(P)))
    means[~near] = long_run_distribution(P, classes) @ C
    systems = np.eye(len(P)) - gammas[near, None, None] * P
    weighed = (1.0 - gammas[near])[:, None, None] * C[:, None]
    means[near] = np.linalg.solve(systems, weighed)[:, :, 0]
    return means


@dataclass(frozen=True, eq=False)
class ValueIterate:
    """V_k (X,), and the errors up to it."""

    V: np.ndarray
    errors: np.ndarray
    """(k + 1,) max|V_j - V| for j = 0..k; empty where V is not finite everywhere."""
    bounds: np.ndarray
    """(k + 1,) gamma^j max|V_0 - V|; empty as well."""
    done: str
    """Why the iteration stopped, in a sentence; empty while it goes on."""
    progress: float
    """In [0, 1]: of the decades of error or of the sweeps, whichever is ahead."""


def iterate_values(
    P: np.ndarray, C: np.ndarray, gamma: float, V: np.ndarray, exact: CostToGo, most: int
) -> Iterator[ValueIterate]:
    """V_1, V_2, ... from V_0 = `V` (X,) by V_(k+1) = C + gamma P V_k, until V is exact to
    TOLERANCE of its largest entry (of that of V_0, where V = 0) or `most` sweeps are done."""
    sums = bool(exact.finite.all())
    gap = float(np.abs(V - exact.V).max())
    goal = TOLERANCE * (float(np.abs(exact.V).max()) or gap)
    errors = [gap] if sums else []
    for k in range(1, most + 1):
        V, done, progress = C + gamma * (P @ V), "", k / most
        if sums:
            errors.append(float(np.abs(V - exact.V).max()))
        if sums and errors[-1] <= goal:
            done, progress = f"V is exact to nine digits of its largest entry, k = {k}.", 1.0
        elif k == most:
            left = (
                f"an error of {errors[-1]:.2g} is left" if sums else _no_limit_message(exact.finite)
            )
            done = f"Stopped at k = {k}: {left}."
        elif sums and gap > goal:
            progress = max(progress, float(np.log(gap / errors[-1]) / np.log(gap / goal)))
        yield ValueIterate(
            V, np.array(errors), gap * gamma ** np.arange(len(errors)), done, progress
        )
        if done:
            return


def _no_limit_message(finite: np.ndarray) -> str:
    some = f" in {int((~finite).sum())} of {len(finite)} states" if finite.any() else ""
    return f"V has no limit{some}"
