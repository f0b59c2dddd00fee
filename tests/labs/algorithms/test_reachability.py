"""What a chain can come to, decided on its graph: against exact rational arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from labs.algorithms import policy_evaluation
from labs.algorithms.markov_chain import (
    absorption,
    communicating_classes,
    cost_to_go,
    iterate_values,
    long_run_distribution,
)
from labs.problems.finite_mdp import FiniteMDP

Weights = list[list[int]]


def random_weights(seed: int) -> Weights:
    """Of 1 to 7 states; most transitions are missing, the others of any size. Every second chain
    has a state that is never left."""
    rng = np.random.default_rng(seed)
    n, share = int(rng.integers(1, 8)), rng.uniform(0.1, 0.5)
    weights = np.rint(10.0 ** rng.uniform(0.0, 12.0, (n, n))) * (rng.random((n, n)) < share)
    for x in range(n):
        if not weights[x].any():
            weights[x, rng.integers(n)] = 1.0
    if seed % 2:
        weights[0] = np.eye(n)[0]
    return [[int(w) for w in row] for row in weights]


def probabilities(weights: Weights) -> np.ndarray:
    """(X, X), each entry rounded once."""
    return np.array([[float(Fraction(w, sum(row))) for w in row] for row in weights])


def costs(weights: Weights, seed: int) -> np.ndarray:
    """(X,) some of them 0."""
    rng = np.random.default_rng((seed, 1))
    return np.asarray(rng.integers(0, 4, len(weights)) * rng.integers(0, 2, len(weights)), float)


def closed_classes(P: np.ndarray) -> list[np.ndarray]:
    """By SciPy's strong components, which take what is below 1e-8 in a dense array for no edge."""
    count, label = connected_components(P > 0.0, connection="strong")
    members = [np.flatnonzero(label == k) for k in range(count)]
    return [x for x in members if not np.delete(P[x], x, axis=1).any()]


def solve(A: list[list[Fraction]], b: list[Fraction]) -> list[Fraction]:
    """Gauss and Jordan, exactly."""
    n = len(A)
    rows = [[*row, right] for row, right in zip(A, b, strict=True)]
    for k in range(n):
        pivot = next(i for i in range(k, n) if rows[i][k] != 0)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [entry / rows[k][k] for entry in rows[k]]
        for i in range(n):
            if i != k and rows[i][k] != 0:
                rows[i] = [a - rows[i][k] * p for a, p in zip(rows[i], rows[k], strict=True)]
    return [row[n] for row in rows]


def solve_exactly(weights: Weights, states: list[int], b: list[Fraction]) -> list[Fraction]:
    """(I - P_TT)^-1 b for the states T."""
    P = [[Fraction(w, sum(row)) for w in row] for row in weights]
    return solve([[Fraction(x == y) - P[x][y] for y in states] for x in states], b)


@pytest.mark.parametrize("seed", range(60))
def test_probabilities_of_absorption_are_exact_and_0_where_no_way_leads(seed: int) -> None:
    weights = random_weights(seed)
    P = probabilities(weights)
    classes = communicating_classes(P)
    closed = [c.states for c in classes if c.closed]
    found = absorption(P, classes)
    states = [x for x in range(len(P)) if not any(x in c for c in closed)]
    for k, c in enumerate(closed):
        into = [
            sum((Fraction(weights[x][y], sum(weights[x])) for y in c), Fraction(0)) for x in states
        ]
        wanted = solve_exactly(weights, states, into)
        for x, p in zip(states, wanted, strict=True):
            assert (found[x, k] == 0.0) == (p == 0)
            assert found[x, k] == pytest.approx(float(p), rel=1e-13, abs=0.0)
    shares = long_run_distribution(P, classes)
    assert ((shares[:, states] == 0.0).all()) or not states


@pytest.mark.parametrize("seed", range(60))
def test_costs_without_discount_are_finite_where_they_are_and_exact(seed: int) -> None:
    weights = random_weights(seed)
    P, C = probabilities(weights), costs(weights, seed)
    closed = closed_classes(P)
    costly = [x for c in closed if C[c].any() for x in c]
    hops = np.linalg.matrix_power(np.eye(len(P), dtype=bool) | (P > 0.0), len(P))
    finite: np.ndarray = hops[:, costly].sum(axis=1) == 0
    found = cost_to_go(P, C, 1.0, communicating_classes(P))
    np.testing.assert_array_equal(found.finite, finite)
    np.testing.assert_array_equal(np.isfinite(found.values_or_nan), finite)
    ended = {int(x) for c in closed for x in c}
    states = [x for x in range(len(P)) if finite[x] and x not in ended]
    wanted = solve_exactly(weights, states, [Fraction(float(C[x])) for x in states])
    V = np.zeros(len(P))
    V[states] = [float(v) for v in wanted]
    np.testing.assert_allclose(found.V, V, rtol=1e-13, atol=0.0)
    # The same chain as what a policy leaves of an MDP: nothing there is called terminal.
    mdp = FiniteMDP(C[:, None], 1.0, np.zeros(len(P), bool), P=P[None])
    policy = np.zeros(len(P), np.int64)
    np.testing.assert_allclose(
        policy_evaluation.exact_values(mdp, policy), np.where(finite, V, np.inf), rtol=1e-13
    )


@pytest.mark.parametrize("gamma", [0.0, 0.5, 0.99, 1.0 - 1e-9])
@pytest.mark.parametrize("seed", range(10))
def test_discounted_costs_are_exact_in_every_entry(seed: int, gamma: float) -> None:
    weights = random_weights(seed)
    P, C, g = probabilities(weights), costs(weights, seed), Fraction(gamma)
    n = range(len(P))
    A = [[Fraction(x == y) - g * Fraction(weights[x][y], sum(weights[x])) for y in n] for x in n]
    wanted = [float(v) for v in solve(A, [Fraction(float(c)) for c in C])]
    found = cost_to_go(P, C, gamma, communicating_classes(P))
    assert found.finite.all()
    np.testing.assert_allclose(found.V, wanted, rtol=1e-13, atol=0.0)


def test_a_state_that_is_sure_to_end_has_a_value_whatever_rounding_says() -> None:
    P = np.array([[1.0, 0, 0, 0], [0.2, 0.8, 0, 0], [0.1, 0.4, 0.3, 0.2], [0, 0, 0, 1.0]])
    found = cost_to_go(P, np.array([0.0, 1.0, 1.0, 5.0]), 1.0, communicating_classes(P))
    np.testing.assert_array_equal(found.finite, [True, True, False, False])
    np.testing.assert_allclose(found.values_or_nan, [0.0, 5.0, np.nan, np.nan], rtol=1e-15)


@pytest.mark.parametrize("leak", [1e-3, 1e-15, 1e-17, 1e-200])
def test_a_pair_of_states_left_once_in_an_age(leak: float) -> None:
    """V of 0 is 2 / leak - 1: two steps a round, of which the last is cut short. With a leak of
    1e-17 the rows of the two sum to 1 without it, and I - P_TT is singular in floats."""
    P = np.array([[0.0, 1.0 - leak, leak], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    classes = communicating_classes(P)
    found = cost_to_go(P, np.array([1.0, 1.0, 0.0]), 1.0, classes)
    assert found.finite.all()
    np.testing.assert_allclose(found.V[:2], [2 / leak - 1, 2 / leak], rtol=1e-14)
    np.testing.assert_allclose(absorption(P, classes), 1.0)


def test_nine_digits_are_relative_to_the_values() -> None:
    P, C = np.array([[0.9, 0.1], [0.0, 1.0]]), np.array([1e-6, 0.0])
    exact = cost_to_go(P, C, 1.0, communicating_classes(P))
    np.testing.assert_allclose(exact.V, [1e-5, 0.0], rtol=1e-15)
    for scale in (1.0, 1e-9, 1e9):
        wanted = cost_to_go(P, scale * C, 1.0, communicating_classes(P))
        last = list(iterate_values(P, scale * C, 1.0, np.zeros(2), wanted, 1000))[-1]
        assert last.done == "V is exact to nine digits of its largest entry, k = 197."
        np.testing.assert_allclose(last.V, [scale * 1e-5, 0.0], rtol=1e-9)


def test_what_costs_nothing_is_exact_after_a_sweep() -> None:
    exact = cost_to_go(np.eye(2), np.zeros(2), 0.5, communicating_classes(np.eye(2)))
    (only,) = iterate_values(np.eye(2), np.zeros(2), 0.5, np.zeros(2), exact, 9)
    assert only.done.startswith("V is exact")
    *_, last = iterate_values(np.eye(2), np.zeros(2), 0.5, np.ones(2), exact, 99)
    assert last.done.startswith("V is exact")
    assert last.V.max() <= 1e-9


def test_costs_that_cancel_under_a_policy_are_no_costs() -> None:
    """0.3 * 7 - 0.7 * 3 is 0 for whoever wrote it, and 4e-16 in floats."""
    P = np.ones((2, 1, 1))
    mdp = FiniteMDP(np.array([[7.0, -3.0]]), 1.0, np.zeros(1, bool), P=P)
    policy = np.array([[0.3, 0.7]])
    assert (policy * mdp.C).sum() != 0.0
    np.testing.assert_array_equal(policy_evaluation.exact_values(mdp, policy), [0.0])


def test_a_cycle_whose_costs_cancel_without_resting_has_no_value() -> None:
    successor = np.array([[1], [0]], np.int32)
    mdp = FiniteMDP(np.array([[1.0], [-1.0]]), 1.0, np.zeros(2, bool), successor=successor)
    assert not np.isfinite(policy_evaluation.exact_values(mdp, np.zeros(2, np.int64))).any()
    assert not np.isnan(policy_evaluation.exact_values(mdp, np.zeros(2, np.int64))).any()
