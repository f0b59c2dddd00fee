"""Value iteration (notes, 3.4.3): the optimal cost-to-go V* of a finite MDP.

    V_(k+1) = T V_k,    |V_k - V*| <= gamma^k |V_0 - V*|  (max norm),
    pi*(x) in argmin over u of C(x, u) + gamma sum over y of P^u(x, y) V*(y)

No policy is needed on the way; each sweep notes the one that is greedy with respect to the values
it started from. X U backups a sweep.
"""

from collections.abc import Iterator

import numpy as np

from labs.algorithms.bellman import Sweep, convergence_message, optimal_backup, until_done
from labs.problems.finite_mdp import FiniteMDP


def init(V: np.ndarray) -> Sweep:
    """Before the first sweep, from any V (X,)."""
    return Sweep(V, np.zeros(len(V), np.int64))


def step(mdp: FiniteMDP, at: Sweep, tolerance: float) -> Sweep:
    """One sweep of T over all states."""
    V, policy, change = optimal_backup(mdp, at.V, at.policy)
    done = convergence_message(mdp, V, change, tolerance)
    return Sweep(V, policy, at.count + 1, at.backups + mdp.X * mdp.U, change, 0, done)


def iterate(mdp: FiniteMDP, V: np.ndarray, tolerance: float) -> Iterator[Sweep]:
    """Sweep by sweep until none changes a value by more than `tolerance`."""
    return until_done(lambda at: step(mdp, at, tolerance), init(V))
