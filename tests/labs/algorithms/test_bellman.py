"""Bellman's operators on random MDPs: their definition, contraction, monotonicity."""

import hypothesis.strategies as st
import numpy as np
from hypothesis import given, settings

from labs.algorithms.bellman import error_bound, optimal_backup, policy_backup, q_values
from labs.algorithms.policy_iteration import optimum
from labs.problems.finite_mdp import FiniteMDP, random_policy
from tests.labs.algorithms.random_mdps import mdps

seeds = st.integers(0, 2**32 - 1)


def values(mdp: FiniteMDP, seed: int, count: int = 2) -> np.ndarray:
    """(count, X)."""
    return np.random.default_rng(seed).normal(scale=10.0, size=(count, mdp.X))


def largest(difference: np.ndarray) -> float:
    """The max norm."""
    return float(np.abs(difference).max())


@given(mdps(), seeds)
@settings(max_examples=60, deadline=None)
def test_the_operators_are_their_definitions(mdp: FiniteMDP, seed: int) -> None:
    """Written out in loops, for tables and for probabilities alike."""
    (V,) = values(mdp, seed, 1)
    P, C = mdp.probabilities, mdp.C
    Q = np.array(
        [
            [
                C[x, u] + mdp.gamma * sum(P[u, x, y] * V[y] for y in range(mdp.X))
                for u in range(mdp.U)
            ]
            for x in range(mdp.X)
        ]
    )
    np.testing.assert_allclose(q_values(mdp, V), Q, atol=1e-12)
    old = np.random.default_rng(seed).integers(mdp.U, size=mdp.X)
    for before in (old, random_policy(mdp)):
        ahead, greedy, change = optimal_backup(mdp, V, before)
        np.testing.assert_allclose(ahead, Q.min(axis=1), atol=1e-12)
        np.testing.assert_allclose(Q[np.arange(mdp.X), greedy], Q.min(axis=1), atol=1e-9)
        assert change == largest(ahead - V)
    ahead, change, backups = policy_backup(mdp, V, old)
    np.testing.assert_allclose(ahead, Q[np.arange(mdp.X), old], atol=1e-12)
    assert (change, backups) == (largest(ahead - V), mdp.X)
    ahead, _, backups = policy_backup(mdp, V, random_policy(mdp))
    np.testing.assert_allclose(ahead, Q.mean(axis=1), atol=1e-12)
    assert backups == mdp.X * mdp.U


@given(mdps(highest=1.0), seeds)
@settings(max_examples=100, deadline=None)
def test_both_operators_contract_by_gamma(mdp: FiniteMDP, seed: int) -> None:
    V, W = values(mdp, seed)
    policy = np.random.default_rng(seed).integers(mdp.U, size=mdp.X)
    allowed = mdp.gamma * largest(V - W) + 1e-12
    assert largest(optimal_backup(mdp, V, policy)[0] - optimal_backup(mdp, W, policy)[0]) <= allowed
    for given_one in (policy, random_policy(mdp)):
        found = policy_backup(mdp, V, given_one)[0] - policy_backup(mdp, W, given_one)[0]
        assert largest(found) <= allowed


@given(mdps(), seeds)
@settings(max_examples=60, deadline=None)
def test_both_operators_are_monotone(mdp: FiniteMDP, seed: int) -> None:
    V, more = values(mdp, seed)
    policy = np.random.default_rng(seed).integers(mdp.U, size=mdp.X)
    W = V + np.abs(more)
    assert (optimal_backup(mdp, V, policy)[0] <= optimal_backup(mdp, W, policy)[0] + 1e-12).all()
    assert (policy_backup(mdp, V, policy)[0] <= policy_backup(mdp, W, policy)[0] + 1e-12).all()


@given(mdps(), seeds)
@settings(max_examples=60, deadline=None)
def test_the_last_change_bounds_the_distance_to_the_limit(mdp: FiniteMDP, seed: int) -> None:
    (V,) = values(mdp, seed, 1)
    best, _, _ = optimum(mdp, np.zeros(mdp.X, np.int64))
    ahead, _, change = optimal_backup(mdp, V, np.zeros(mdp.X, np.int64))
    assert largest(ahead - best) <= error_bound(mdp.gamma, change) + 1e-9


def test_a_control_as_good_is_kept() -> None:
    successor = np.zeros((2, 3), np.int32)
    C = np.array([[1.0, 1.0, 2.0], [3.0, 2.0, 2.0]])
    mdp = FiniteMDP(C, 0.5, np.zeros(2, bool), successor=successor)
    random = FiniteMDP(C, 0.5, np.zeros(2, bool), P=mdp.probabilities)
    for kind in (mdp, random):
        for old, new in (([0, 0], [0, 1]), ([1, 2], [1, 2]), ([2, 1], [0, 1])):
            _, greedy, _ = optimal_backup(kind, np.zeros(2), np.array(old))
            np.testing.assert_array_equal(greedy, new)
