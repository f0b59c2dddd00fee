"""The compiled random numbers: their published sequence, their evenness, their state."""

import numpy as np
import pytest
from scipy.special import erf

from labs.random_numbers import normal, random_bits, random_integer, random_states, uniform


def test_it_is_xoshiro256_plus_plus() -> None:
    """The test vector of the reference implementation."""
    state = np.array([1, 2, 3, 4], np.uint64)
    assert [int(random_bits(state)) for _ in range(6)] == [
        41943041,
        58720359,
        3588806011781223,
        3591011842654386,
        9228616714210784205,
        9973669472204895162,
    ]


def test_uniform_is_even() -> None:
    state = random_states(np.random.default_rng(0), 1)[0]
    drawn = np.array([uniform(state) for _ in range(100_000)])
    assert drawn.min() >= 0.0
    assert drawn.max() < 1.0
    counts, _ = np.histogram(drawn, 50, (0.0, 1.0))
    # Chi-square with 49 degrees of freedom: beyond 85 once in a thousand seeds.
    assert ((counts - 2000) ** 2 / 2000).sum() < 85
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.01


def test_below_is_even_and_below() -> None:
    state = random_states(np.random.default_rng(1), 1)[0]
    counts = np.bincount([random_integer(state, 7) for _ in range(70_000)])
    assert len(counts) == 7
    # Six degrees of freedom.
    assert ((counts - 10_000) ** 2 / 10_000).sum() < 22.5


def test_a_copied_state_goes_on_alike_and_seeds_differ() -> None:
    states = random_states(np.random.default_rng(2), 3)
    assert len({tuple(state) for state in states}) == 3
    states[1] = states[0]
    first = [uniform(states[0]) for _ in range(10)]
    assert first == [uniform(states[1]) for _ in range(10)]


def test_normal_is_normal() -> None:
    """Against the distribution function, its tail beyond the last layer included."""
    state = random_states(np.random.default_rng(3), 1)[0]
    drawn = np.sort([normal(state) for _ in range(200_000)])
    expected = 0.5 * (1.0 + erf(drawn / np.sqrt(2.0)))
    # Kolmogorov and Smirnov: beyond 1.95 once in a thousand seeds.
    distance = np.abs(expected - (np.arange(len(drawn)) + 0.5) / len(drawn)).max()
    assert distance * np.sqrt(len(drawn)) < 1.95
    beyond = (np.abs(drawn) > 3.6541528853610088).sum()  # 51.6 of them on average
    assert 25 < beyond < 85
    assert abs((drawn > 0.0).mean() - 0.5) < 0.004
    assert (drawn**4).mean() == pytest.approx(3.0, abs=0.09)
