"""Policy iteration and modified policy iteration (notes, 3.4.3) on a finite MDP.

    improve     pi_k(x) in argmin over u of C(x, u) + gamma sum over y of P^u(x, y) V_k(y)
    evaluate    V_(k+1) = (T^(pi_k))^m V_k

The sweep that improves a policy finds T V_k = T^(pi_k) V_k, the first of its m evaluations. So
m = 1 is value iteration, sweep for sweep; m = infinity (until a sweep changes no value by more
than the tolerance) is policy iteration, which begins with evaluating a given policy. X U backups
for a sweep that improves, X for one that evaluates.

`optimum` is policy iteration with exact evaluation: finitely many steps, no tolerance (Howard
1960). With gamma = 1 it begins with a policy that is sure to end wherever one can be, and changes
a control only for a cheaper one: so it never comes to one that runs for ever at no cost where
ending pays (Bertsekas and Tsitsiklis 1991).
"""

from collections.abc import Iterator

import numpy as np

from labs.algorithms.bellman import (
    Sweep,
    convergence_message,
    optimal_backup,
    policy_backup,
    until_done,
)
from labs.algorithms.policy_evaluation import exact_values
from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP

MAX_IMPROVEMENTS = 10_000
"""Improvements at most in `optimum`."""


def init(V: np.ndarray, policy: np.ndarray | None = None) -> Sweep:
    """Before the first sweep: V (X,). A policy, (X,) or (X, U), is evaluated first; without one
    the first sweep makes one."""
    if policy is None:
        return Sweep(V, np.zeros(len(V), np.int64))
    return Sweep(V, policy, evaluations=1)


def step(mdp: FiniteMDP, at: Sweep, m: float, tolerance: float) -> Sweep:
    """One sweep, which improves the policy or evaluates it. m >= 1, `math.inf` for policy
    iteration."""
    if at.evaluations == 0:
        V, policy, change = optimal_backup(mdp, at.V, at.policy)
        evaluations = 1 if m > 1 else 0
        backups, done = mdp.X * mdp.U, convergence_message(mdp, V, change, tolerance)
    else:
        V, change, backups = policy_backup(mdp, at.V, at.policy)
        policy, done = at.policy, ""
        over = at.evaluations + 1 >= m or change <= tolerance
        evaluations = 0 if over else at.evaluations + 1
    return Sweep(V, policy, at.count + 1, at.backups + backups, change, evaluations, done)


def iterate(
    mdp: FiniteMDP,
    V: np.ndarray,
    policy: np.ndarray | None,
    m: float,
    tolerance: float,
) -> Iterator[Sweep]:
    """Sweep by sweep until one that improves changes no value by more than `tolerance`."""
    return until_done(lambda at: step(mdp, at, m, tolerance), init(V, policy))


def optimum(mdp: FiniteMDP, policy: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """V* (X,) and an optimal policy (X,) to rounding, and the improvements it took to get there
    from `policy`, (X,) or (X, U). With gamma = 1 a random one gives way to one that is sure to
    end, and V* is infinite from where none is, or where costs have no least sum."""
    if policy.ndim == 2 and mdp.gamma == 1.0:
        policy = _proper_policy(mdp)
    V = exact_values(mdp, policy)
    for count in range(MAX_IMPROVEMENTS):
        with np.errstate(invalid="ignore"):  # infinite values that stay so do not change
            _, better, _ = optimal_backup(mdp, V, policy)
        if policy.ndim == 1 and (better == policy).all():
            return V, policy, count
        before, policy, V = V, better, exact_values(mdp, better)
        if (np.isfinite(before) & ~np.isfinite(V)).any():  # cheaper and cheaper, round and round
            return V, policy, count + 1
    raise LabError(
        f"policy iteration still changes the policy after {MAX_IMPROVEMENTS} improvements"
    )


def _proper_policy(mdp: FiniteMDP) -> np.ndarray:
    """(X,): a policy that ends with probability 1 from wherever one can: by controls that lead
    nowhere else, the shortest way."""
    policy, sure = np.zeros(mdp.X, np.int64), np.ones(mdp.X, bool)
    while True:
        stays = mdp.expected_value((~sure).astype(float)) == 0.0
        found, fresh = mdp.terminal, mdp.terminal
        while fresh.any():
            leads = stays & (mdp.expected_value(found.astype(float)) > 0.0)
            fresh = leads.any(axis=1) & ~found
            policy[fresh] = leads[fresh].argmax(axis=1)
            found = found | fresh
        if (found == sure).all():
            return policy
        sure = found
