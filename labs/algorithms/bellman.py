"""Bellman's operators on a finite MDP (notes, 3.4.1), costs minimised.

    (T^pi V)(x) = sum over u of pi(u|x) [ C(x, u) + gamma sum over y of P^u(x, y) V(y) ]
    (T V)(x)    = min over u of         [ C(x, u) + gamma sum over y of P^u(x, y) V(y) ]

Both contract distances in the max norm by gamma: |T V - T W| <= gamma |V - W|, since the rows of
P sum to 1. So |V - TV| <= e puts the fixed point within gamma e / (1 - gamma) of TV; for gamma = 1
it says nothing of that distance.

A backup is one bracket: T takes X U of them, T^pi as many as there are controls it may use. Where
the dynamics are a table the loops are compiled, otherwise they are products of arrays.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from labs.compiled import compiled
from labs.problems.finite_mdp import FiniteMDP
from labs.rounding import round_up

TIE_TOLERANCE = 1e-12
"""Relative to max|C| + max|V|: controls this close are equally good, and the present one is
kept."""
NO_ERROR_BOUND = "with gamma = 1 that bounds no distance to the limit"
"""How the sentence ends of an iteration that stopped without knowing how near it is."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """Where an iteration stands after a sweep over all states. Steps make new ones: any of them
    can be kept, looked at and gone on from."""

    V: np.ndarray
    """(X,) cost-to-go."""
    policy: np.ndarray
    """(X,) controls, or (X, U) probabilities where a random policy is (still) followed."""
    count: int = 0
    """Sweeps so far."""
    backups: int = 0
    """Backups so far."""
    change: float = np.inf
    """Largest change of a value in the last sweep."""
    evaluations: int = 0
    """Sweeps since the policy was last improved; 0: it is improved next."""
    done: str = ""
    """Why it ended, in a sentence; empty while it goes on."""


def until_done(step: Callable[[Sweep], Sweep], at: Sweep) -> Iterator[Sweep]:
    """The sweeps after `at`, the last with `done` set."""
    while not at.done:
        at = step(at)
        yield at


def convergence_message(mdp: FiniteMDP, V: np.ndarray, change: float, tolerance: float) -> str:
    """A sentence once the last sweep, which led to V (X,), changed no value by more than
    `tolerance`, else empty."""
    if not change <= tolerance:
        return ""
    if change == 0.0:
        return "The last sweep changed no value."
    if mdp.gamma == 1.0:
        return f"The last sweep changed no value by more than {float(tolerance)}; {NO_ERROR_BOUND}."
    # A backup adds up this many terms at most, each of them and each sum rounded.
    terms = mdp.U + (1 if mdp.deterministic else mdp.X)
    size = _value_scale(mdp, V) + change
    far = error_bound(mdp.gamma, change, terms * np.finfo(float).eps * size)
    return f"No value changed by more than {float(tolerance)}: the limit is within {round_up(far)}."


def unbounded_message(V: np.ndarray, why: str = "") -> str:
    """A sentence, but for its capital, on states whose cost-to-go V (X,) is not finite; empty if
    there are none."""
    many = int((~np.isfinite(V)).sum())
    if not many:
        return ""
    where = f" {why}" if why else ""
    return (
        f"with gamma = 1 the cost-to-go of {many} of {len(V)} states grows without bound{where}. "
        "Take a smaller gamma, or open a way to the goal."
    )


def error_bound(gamma: float, change: float, rounding: float = 0.0) -> float:
    """How far the values can be from the fixed point after a sweep that changed them by
    `change` and was exact to `rounding`, in the max norm; infinite for gamma = 1."""
    return (gamma * change + rounding) / (1.0 - gamma) if gamma < 1.0 else float("inf")


def q_values(mdp: FiniteMDP, V: np.ndarray) -> np.ndarray:
    """Q (X, U): the brackets. V (X,) may be infinite where nothing ends."""
    if mdp.successor is not None:
        table: np.ndarray = mdp.C + mdp.gamma * V[mdp.successor]
        return table
    endless = ~np.isfinite(V)
    Q: np.ndarray = mdp.C + mdp.gamma * mdp.expected_value(_finite(V))
    if endless.any():
        Q[mdp.expected_value(endless.astype(float)) > 0.0] = np.inf
    return Q


def _finite(V: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(V), V, 0.0)


def _value_scale(mdp: FiniteMDP, V: np.ndarray) -> float:
    return mdp.largest_cost + float(np.abs(_finite(V)).max())


def optimal_backup(
    mdp: FiniteMDP, V: np.ndarray, policy: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """T V (X,), a policy greedy with respect to V, which keeps the controls of `policy` (X,)
    where they are as good as any, and the largest change max |T V - V|."""
    if mdp.successor is not None:
        ahead, better = np.empty(mdp.X), np.empty(mdp.X, np.int64)
        old = policy if policy.ndim == 1 else np.full(mdp.X, -1)
        tie = TIE_TOLERANCE * _value_scale(mdp, V)
        change = _optimal_sweep(V, mdp.C, mdp.successor, mdp.gamma, old, tie, ahead, better)
        return ahead, better, change
    Q = q_values(mdp, V)
    ahead, better = Q.min(axis=1), Q.argmin(axis=1)
    if policy.ndim == 1:
        kept = Q[np.arange(mdp.X), policy] <= ahead + TIE_TOLERANCE * _value_scale(mdp, V)
        better = np.where(kept, policy, better)
    return ahead, better, float(np.abs(ahead - V).max())


def policy_backup(
    mdp: FiniteMDP, V: np.ndarray, policy: np.ndarray
) -> tuple[np.ndarray, float, int]:
    """T^pi V (X,), the largest change max |T^pi V - V|, and the backups it took."""
    if policy.ndim == 1 and mdp.successor is not None:
        ahead = np.empty(mdp.X)
        return ahead, _policy_sweep(V, mdp.C, mdp.successor, mdp.gamma, policy, ahead), mdp.X
    if policy.ndim == 1 and mdp.outcomes is not None:
        ahead, backups = q_values(mdp, V)[np.arange(mdp.X), policy], mdp.X
    elif policy.ndim == 1:
        rows = mdp.probabilities[policy, np.arange(mdp.X)]
        ahead, backups = mdp.policy_cost(policy) + mdp.gamma * (rows @ V), mdp.X
    else:
        ahead, backups = (policy * q_values(mdp, V)).sum(axis=1), mdp.X * mdp.U
    return ahead, float(np.abs(ahead - V).max()), backups


@compiled
def _optimal_sweep(
    V: np.ndarray,
    C: np.ndarray,
    successor: np.ndarray,
    gamma: float,
    old: np.ndarray,
    tie: float,
    ahead: np.ndarray,
    policy: np.ndarray,
) -> float:
    """Writes T V into `ahead` and its controls into `policy`; returns the largest change."""
    X, U = C.shape
    change = 0.0
    for x in range(X):
        best, control = C[x, 0] + gamma * V[successor[x, 0]], 0
        for u in range(1, U):
            cost = C[x, u] + gamma * V[successor[x, u]]
            if cost < best:
                best, control = cost, u
        ahead[x] = best
        policy[x] = control
        kept = old[x]
        if kept >= 0:
            cost = C[x, kept] + gamma * V[successor[x, kept]]
            if cost <= best + tie:
                policy[x] = kept
        change = max(change, abs(best - V[x]))
    return change


@compiled
def _policy_sweep(
    V: np.ndarray,
    C: np.ndarray,
    successor: np.ndarray,
    gamma: float,
    policy: np.ndarray,
    ahead: np.ndarray,
) -> float:
    """Writes T^pi V into `ahead`; returns the largest change."""
    change = 0.0
    for x in range(len(V)):
        u = policy[x]
        ahead[x] = C[x, u] + gamma * V[successor[x, u]]
        change = max(change, abs(ahead[x] - V[x]))
    return change
