"""Backward recursion (notes, 2.2.2): dynamic programming over a finite horizon of N steps.

    V_N(x) = l_f(x)
    V_i(x) = min over u of C(x, u) + gamma sum over y of P^u(x, y) V_(i+1)(y),    i = N - 1, ..., 0

Values and policies depend on the time i, that is on the time to go N - i. X U backups a step. Over
a stationary MDP, V_i is the (N - i)-th iterate of value iteration from V_0 = l_f.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from labs.algorithms.bellman import optimal_backup
from labs.problems.finite_mdp import FiniteMDP


@dataclass(frozen=True, eq=False)
class Stage:
    """The optimum from one time on."""

    to_go: int
    """N - i, steps left."""
    V: np.ndarray
    """(X,) cost-to-go."""
    policy: np.ndarray
    """(X,) first controls; those of the last stage, where nothing is left to do, mean nothing."""


def init(final: np.ndarray) -> Stage:
    """The last stage, with the final costs l_f (X,)."""
    return Stage(0, final, np.zeros(len(final), np.int64))


def step(mdp: FiniteMDP, later: Stage) -> Stage:
    """One step back in time."""
    V, policy, _ = optimal_backup(mdp, later.V, later.policy)
    return Stage(later.to_go + 1, V, policy)


def iterate(mdp: FiniteMDP, final: np.ndarray, horizon: int) -> Iterator[Stage]:
    """The stages from i = N - 1 down to 0, N = `horizon`."""
    stage = init(final)
    for _ in range(horizon):
        stage = step(mdp, stage)
        yield stage


def value_and_policy_tables(
    mdp: FiniteMDP, final: np.ndarray, horizon: int
) -> tuple[np.ndarray, np.ndarray]:
    """V (N + 1, X) and policies (N, X), both by the steps left: row k of V belongs to k steps to
    go, and policy[k - 1] is what to do then."""
    stages = list(iterate(mdp, final, horizon))
    V = np.stack([final, *(stage.V for stage in stages)])
    policy = np.array([stage.policy for stage in stages], np.int64).reshape(horizon, mdp.X)
    return V, policy
