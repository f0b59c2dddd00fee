"""Walks go by the probabilities they are given, and repeat."""

import numpy as np
import pytest

from labs.algorithms.markov_chain import communicating_classes, stationary_distribution
from labs.reinforcement_learning.markov.random_walk import (
    RandomWalk,
    advance_random_walk,
    start_random_walk,
)

P = np.array([[0.5, 0.3, 0.2], [0.1, 0.9, 0.0], [0.0, 0.4, 0.6]])


def walked(steps: int, key: int = 5, part: float = 1.0) -> RandomWalk:
    walk = start_random_walk(P, 0, key)
    for _ in range(round(steps / part)):
        walk = advance_random_walk(P, walk, part)
    return walk


def test_a_walk_is_the_same_however_it_is_cut() -> None:
    whole, parts, at_once = (
        walked(40),
        walked(40, part=0.25),
        advance_random_walk(P, start_random_walk(P, 0, 5), 40.0),
    )
    for other in (parts, at_once):
        assert (other.at, other.to, other.steps) == (whole.at, whole.to, whole.steps)
        np.testing.assert_array_equal(other.visits, whole.visits)
        np.testing.assert_array_equal(other.mu, whole.mu)
    assert walked(40, key=6).visits.tolist() != whole.visits.tolist()


def test_the_distribution_moves_with_p() -> None:
    walk = walked(7)
    np.testing.assert_allclose(walk.mu, np.linalg.matrix_power(P, 7)[0], atol=1e-15)
    np.testing.assert_allclose(walk.next_mu, np.linalg.matrix_power(P, 8)[0], atol=1e-15)
    assert walk.visits.sum() == 8.0
    half = advance_random_walk(P, walk, 0.5)
    assert (half.phase, half.steps, half.at) == (0.5, 7, walk.at)


def test_transitions_come_as_often_as_p_says() -> None:
    """10 000 steps: every count within five standard deviations."""
    walk, counts = start_random_walk(P, 0, 1), np.zeros((3, 3))
    for _ in range(10_000):
        old, walk = walk, advance_random_walk(P, walk, 1.0)
        counts[old.at, walk.at] += 1.0
        assert walk.at == old.to
    n = counts.sum(axis=1, keepdims=True)
    spread = np.sqrt(n * P * (1.0 - P))
    assert (np.abs(counts - n * P) <= 5.0 * spread).all()
    assert counts[P == 0.0].sum() == 0.0


def test_visits_tend_to_the_stationary_distribution() -> None:
    (everything,) = communicating_classes(P)
    walk = walked(20_000)
    np.testing.assert_allclose(
        walk.visits / walk.visits.sum(), stationary_distribution(P, everything), atol=0.02
    )


@pytest.mark.parametrize("row", [[0.0, 1.0, 0.0], [0.3, 0.7, 0.0], [0.1] * 3])
def test_no_impossible_state_is_drawn(row: list[float]) -> None:
    """Not even where a row falls short of 1."""
    Q = np.tile(row, (3, 1))
    for key in range(200):
        assert row[start_random_walk(Q, 0, key).to] > 0.0


def test_an_old_walk_is_left_alone() -> None:
    walk = start_random_walk(P, 0, 2)
    before = walk.visits.copy(), walk.mu.copy()
    advance_random_walk(P, walk, 3.5)
    np.testing.assert_array_equal(walk.visits, before[0])
    np.testing.assert_array_equal(walk.mu, before[1])
