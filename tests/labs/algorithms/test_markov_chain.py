"""Markov chains against closed forms, brute force and other algorithms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labs.algorithms.markov_chain import (
    TOLERANCE,
    absorption,
    communicating_classes,
    cost_to_go,
    eigenvalues,
    is_irreducible,
    iterate_values,
    long_run_distribution,
    normalized_discounted_costs,
    stationary_distribution,
)


def ring(n: int) -> np.ndarray:
    """Around a circle of n states, without chance."""
    return np.roll(np.eye(n), 1, axis=1)


def ruin(n: int, p: float) -> np.ndarray:
    """0..n coins; a coin won with probability p, lost otherwise, until none or all are."""
    P = np.zeros((n + 1, n + 1))
    P[0, 0] = P[n, n] = 1.0
    for k in range(1, n):
        P[k, k + 1], P[k, k - 1] = p, 1.0 - p
    return P


@st.composite
def chains(draw: st.DrawFn) -> np.ndarray:
    """Random chains, many of them reducible or periodic."""
    n = draw(st.integers(1, 7))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    P = rng.uniform(0.05, 1.0, (n, n)) * (rng.random((n, n)) < draw(st.sampled_from([0.2, 0.4, 1])))
    for x in range(n):
        if not P[x].any():
            P[x, rng.integers(n)] = 1.0
    return np.asarray(P / P.sum(axis=1, keepdims=True))


def reaches(P: np.ndarray) -> np.ndarray:
    """(X, X) bool: whether x leads to y in any number of steps, 0 included, by brute force."""
    n = len(P)
    return np.linalg.matrix_power((np.eye(n) + P > 0.0).astype(float), n) > 0.0


@given(chains())
@settings(deadline=None)
def test_classes_by_brute_force(P: np.ndarray) -> None:
    leads = reaches(P)
    classes = communicating_classes(P)
    assert sorted(x for c in classes for x in c.states) == list(range(len(P)))
    for c in classes:
        np.testing.assert_array_equal(
            np.flatnonzero(leads[c.states[0]] & leads[:, c.states[0]]), c.states
        )
        assert c.closed == (leads[c.states].sum() == len(c.states) ** 2)
    assert is_irreducible(classes) == leads.all()


@given(chains())
@settings(deadline=None)
def test_periods_by_brute_force(P: np.ndarray) -> None:
    """The gcd of the numbers of steps, up to well beyond X squared, in which one can be back."""
    hop, power = P > 0.0, np.eye(len(P), dtype=bool)
    back = np.zeros(len(P), int)
    for k in range(1, 3 * len(P) ** 2 + 10):
        power = (power.astype(float) @ hop) > 0.0
        back = np.where(power.diagonal(), np.gcd(back, k), back)
    for c in communicating_classes(P):
        assert {c.period} == set(back[c.states])


@given(chains())
@settings(deadline=None)
def test_the_circle_holds_the_roots_of_the_closed_classes(P: np.ndarray) -> None:
    """Perron and Frobenius: as many eigenvalues on the unit circle as the periods of the closed
    classes add up to, each a root of 1, and none outside."""
    roots = [
        np.exp(2j * np.pi * np.arange(c.period) / c.period)
        for c in communicating_classes(P)
        if c.closed
    ]
    expected = np.concatenate(roots)
    found = eigenvalues(P)
    assert np.abs(found).max() <= 1.0 + 1e-9
    assert (np.diff(np.abs(found)) <= 1e-8).all()
    for root in expected:
        assert np.abs(found - root).min() < 1e-7
    # A transient class may come close to 1 as well: what leaves it is at least 5 % of a row here.
    assert (np.abs(found) > 1.0 - 1e-9).sum() == len(expected)


@given(chains())
@settings(deadline=None)
def test_stationary_distributions_are_stationary_and_stay_in_their_class(P: np.ndarray) -> None:
    for c in communicating_classes(P):
        if c.closed:
            pi = stationary_distribution(P, c)
            np.testing.assert_allclose(pi @ P, pi, atol=1e-14)
            assert pi.sum() == pytest.approx(1.0, abs=1e-14)
            assert (pi[c.states] > 0.0).all()
            assert np.delete(pi, c.states).sum() == 0.0


def test_the_stationary_distribution_of_two_states() -> None:
    a, b = 0.3, 1e-9
    P = np.array([[1 - a, a], [b, 1 - b]])
    (c,) = communicating_classes(P)
    # To all digits although the classes almost fall apart.
    np.testing.assert_allclose(
        stationary_distribution(P, c), [b / (a + b), a / (a + b)], rtol=1e-15
    )
    np.testing.assert_allclose(eigenvalues(P), [1.0, 1.0 - a - b], rtol=1e-15)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
def test_a_ring_has_all_roots_of_one(n: int) -> None:
    (c,) = communicating_classes(ring(n))
    assert (c.period, c.closed) == (n, True)
    np.testing.assert_allclose(eigenvalues(ring(n)) ** n, np.ones(n), atol=1e-12)
    np.testing.assert_allclose(stationary_distribution(ring(n), c), np.full(n, 1 / n), atol=1e-15)


def test_a_state_nothing_leads_back_to_has_no_period() -> None:
    first, second = communicating_classes(np.array([[0.0, 1.0], [0.0, 1.0]]))
    assert (first.closed, first.period) == (False, 0)
    assert (second.closed, second.period) == (True, 1)


@pytest.mark.parametrize("p", [0.5, 0.4, 0.7])
def test_the_gamblers_ruin(p: float) -> None:
    """Probability of ending rich and expected length of the game (Feller, volume 1, XIV)."""
    n, k = 6, np.arange(7)
    P, C = ruin(n, p), np.array([0.0, 1, 1, 1, 1, 1, 0])
    classes = communicating_classes(P)
    r = (1 - p) / p
    rich = k / n if p == 0.5 else (1 - r**k) / (1 - r**n)
    rounds = k * (n - k) if p == 0.5 else (k - n * rich) / (1 - 2 * p)
    np.testing.assert_allclose(absorption(P, classes)[:, 1], rich, atol=1e-14)
    found = cost_to_go(P, C, 1.0, classes)
    assert found.finite.all()
    np.testing.assert_allclose(found.V, rounds, atol=1e-12)


@given(chains())
@settings(deadline=None, max_examples=40)
def test_the_long_run_is_the_mean_of_the_powers(P: np.ndarray) -> None:
    exact = long_run_distribution(P, communicating_classes(P))
    # 420 is a multiple of every period up to 7: the mean over so many steps, much later.
    blocks, step = np.zeros_like(P), np.eye(len(P))
    for _ in range(420):
        blocks, step = blocks + step / 420, step @ P
    settled = np.linalg.matrix_power(step, 1000) @ blocks
    np.testing.assert_allclose(exact, settled, atol=1e-9)


@given(chains(), st.floats(0.0, 0.99))
@settings(deadline=None)
def test_bellmans_equation_and_the_bound_of_its_iteration(P: np.ndarray, gamma: float) -> None:
    C = np.random.default_rng(len(P)).normal(size=len(P))
    exact = cost_to_go(P, C, gamma, communicating_classes(P))
    assert exact.finite.all()
    np.testing.assert_allclose(C + gamma * P @ exact.V, exact.V, atol=1e-10)
    V0 = np.random.default_rng(1).normal(size=len(P))
    sweeps = list(iterate_values(P, C, gamma, V0, exact, 3000))
    assert sweeps[-1].done.startswith("V is exact")
    assert [bool(s.done) for s in sweeps[:-1]] == [False] * (len(sweeps) - 1)
    last = sweeps[-1]
    # Each sweep rounds the few terms of a sum as large as V; gamma forgets what was rounded before.
    rounding = (len(P) + 2) * np.finfo(float).eps * np.abs(exact.V).max() / (1.0 - gamma)
    assert (last.errors <= last.bounds + rounding).all()
    assert last.errors[-1] <= TOLERANCE * np.abs(exact.V).max()
    assert np.abs(last.V - exact.V).max() == last.errors[-1]
    assert len(last.errors) == len(sweeps) + 1
    progress = [s.progress for s in sweeps]
    assert progress == sorted(progress)
    assert progress[-1] == 1.0


def test_the_bound_is_sharp() -> None:
    """With equal errors everywhere, the iteration does no better than gamma^k."""
    P, C = ring(3), np.ones(3)
    exact = cost_to_go(P, C, 0.8, communicating_classes(P))
    np.testing.assert_allclose(exact.V, 5.0)
    last = list(iterate_values(P, C, 0.8, np.zeros(3), exact, 50))[-1]
    np.testing.assert_allclose(last.errors, 5.0 * 0.8 ** np.arange(51), rtol=1e-9)
    assert last.done == "Stopped at k = 50: an error of 7.1e-05 is left."


def test_without_discount_only_what_ends_for_nothing_has_a_value() -> None:
    # 0 ends in 1 or 2, for nothing; 3 may end in 1 or stay with 4, which costs 1 for ever.
    P = np.array(
        [
            [0.5, 0.25, 0.25, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, 0.9, 0.0, 0.0, 0.1],
            [0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )
    C = np.array([3.0, 0.0, 0.0, 1.0, 1.0])
    classes = communicating_classes(P)
    found = cost_to_go(P, C, 1.0, classes)
    np.testing.assert_array_equal(found.finite, [True, True, True, False, False])
    np.testing.assert_allclose(found.V, [6.0, 0.0, 0.0, 0.0, 0.0])
    sweeps = list(iterate_values(P, C, 1.0, np.zeros(5), found, 30))
    assert sweeps[-1].done == "Stopped at k = 30: V has no limit in 2 of 5 states."
    assert len(sweeps[-1].errors) == len(sweeps[-1].bounds) == 0
    # It grows by the mean cost of a step in the long run.
    growth = normalized_discounted_costs(P, C, np.array([1.0]), classes)[0]
    np.testing.assert_allclose(growth, [0.0, 0.0, 0.0, 0.1, 1.0])
    np.testing.assert_allclose(sweeps[29].V[3:] - sweeps[28].V[3:], growth[3:])


@given(chains())
@settings(deadline=None)
def test_mean_costs_go_from_the_own_cost_to_that_of_the_long_run(P: np.ndarray) -> None:
    C = np.random.default_rng(len(P)).normal(size=len(P))
    classes = communicating_classes(P)
    gammas = np.array([0.0, 0.5, 1.0 - 1e-7, 1.0])
    means = normalized_discounted_costs(P, C, gammas, classes)
    np.testing.assert_allclose(means[0], C, atol=1e-14)
    np.testing.assert_allclose(means[1], 0.5 * cost_to_go(P, C, 0.5, classes).V, atol=1e-13)
    # Abel: the limit is the mean of the long run.
    np.testing.assert_allclose(means[2], means[3], atol=1e-4)
    assert math.isclose(means[3].max(), (long_run_distribution(P, classes) @ C).max())
