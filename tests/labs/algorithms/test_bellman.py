"""Bellman's operators on random MDPs: their definition, contraction, monotonicity."""

import itertools
import re
from fractions import Fraction

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from labs.algorithms import value_iteration
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


def test_what_is_said_of_the_limit_is_true() -> None:
    """X = 1, C = 1: the limit is 1 / (1 - gamma), and whoever iterates to rounding is off by the
    bound itself, which is not rounded down."""
    for gamma in (0.5, 0.9, 0.99, 0.999):
        for tolerance in (1e-1, 1e-4, 1e-9, 1e-13):
            mdp = FiniteMDP(np.ones((1, 1)), gamma, np.zeros(1, bool), P=np.ones((1, 1, 1)))
            *_, last = value_iteration.iterate(mdp, np.zeros(1), tolerance)
            off = abs(Fraction(float(last.V[0])) - 1 / (1 - Fraction(gamma)))
            if last.change:
                said = re.fullmatch(r"No value .* than \S+: the limit is within (\S+)\.", last.done)
                assert said, last.done
                assert Fraction(said[1]) >= off
                if tolerance > 1e-9:
                    assert Fraction(said[1]) <= Fraction(11, 10) * off
    mdp = FiniteMDP(np.ones((1, 1)), 0.9, np.zeros(1, bool), P=np.ones((1, 1, 1)))
    *_, last = value_iteration.iterate(mdp, np.zeros(1), 1e-4)
    assert last.done == "No value changed by more than 0.0001: the limit is within 0.00085."


@given(mdps(highest=0.999), st.sampled_from([0.1, 1e-6, 1e-12]))
@settings(max_examples=60, deadline=None)
def test_what_is_said_of_the_limit_is_true_of_all(mdp: FiniteMDP, tolerance: float) -> None:
    best, _, _ = optimum(mdp, np.zeros(mdp.X, np.int64))
    for sweep in itertools.islice(value_iteration.iterate(mdp, np.zeros(mdp.X), tolerance), 50_000):
        last = sweep
    if "within" in last.done:
        assert float(last.done.split("within ")[1][:-1]) >= largest(last.V - best) - 1e-13 * (
            1.0 + largest(best)
        )


def test_controls_are_compared_at_the_scale_of_the_costs() -> None:
    successor = np.zeros((1, 2), np.int32)
    for scale in (1.0, 1e-15, 1e15):
        C = scale * np.array([[2.0, 1.0]])
        table = FiniteMDP(C, 0.5, np.zeros(1, bool), successor=successor)
        random = FiniteMDP(C, 0.5, np.zeros(1, bool), P=table.probabilities)
        for mdp in (table, random):
            V, policy, _ = optimum(mdp, np.zeros(1, np.int64))
            assert (policy[0], V[0]) == (1, pytest.approx(2.0 * scale))
