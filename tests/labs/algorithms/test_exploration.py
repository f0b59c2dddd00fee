"""Behaviour policies: how often they choose what."""

import numpy as np
import pytest
from scipy.special import erf

from labs.algorithms.exploration import (
    BOLTZMANN,
    CONFIDENCE_BOUND,
    FIXED_POLICY,
    THOMPSON,
    BehaviourPolicy,
    choose,
    greedy,
)
from labs.random_numbers import random_states

DRAWS = 20_000
COSTS = np.array([3.0, 1.0, 2.0, 1.5])
NEVER = np.zeros(4, np.int32)


def frequencies(
    behaviour: BehaviourPolicy, costs: np.ndarray, visits: np.ndarray = NEVER
) -> np.ndarray:
    state = random_states(np.random.default_rng(0), 1)[0]
    drawn = [choose(behaviour, 0, costs[None], visits[None], state) for _ in range(DRAWS)]
    return np.bincount(drawn, minlength=len(costs)) / DRAWS


def test_greedy_breaks_ties_at_random() -> None:
    state = random_states(np.random.default_rng(0), 1)[0]
    costs = np.array([[2.0, 1.0, 1.0, 3.0, 1.0]])
    counts = np.bincount([greedy(costs, 0, state) for _ in range(DRAWS)], minlength=5)
    np.testing.assert_allclose(counts / DRAWS, [0, 1 / 3, 1 / 3, 0, 1 / 3], atol=0.012)


@pytest.mark.parametrize("epsilon", [0.0, 0.2, 1.0])
def test_epsilon_greedy_shares_epsilon_among_all(epsilon: float) -> None:
    expected = np.full(4, epsilon / 4)
    expected[1] += 1 - epsilon
    np.testing.assert_allclose(
        frequencies(BehaviourPolicy(epsilon=epsilon), COSTS), expected, atol=0.012
    )


def test_boltzmann_is_a_softmax_of_minus_costs() -> None:
    weights = np.exp(-1.7 * COSTS)
    found = frequencies(BehaviourPolicy(BOLTZMANN, beta=1.7), COSTS)
    np.testing.assert_allclose(found, weights / weights.sum(), atol=0.012)
    shifted = frequencies(BehaviourPolicy(BOLTZMANN, beta=1.7), COSTS + 1e4)
    np.testing.assert_allclose(shifted, weights / weights.sum(), atol=0.012)
    np.testing.assert_allclose(
        frequencies(BehaviourPolicy(BOLTZMANN, beta=0.0), COSTS), 0.25, atol=0.012
    )
    assert frequencies(BehaviourPolicy(BOLTZMANN, beta=1e3), COSTS)[1] == 1.0


def test_confidence_takes_the_lowest_bound() -> None:
    state = random_states(np.random.default_rng(0), 1)[0]
    visits = np.array([40, 300, 7, 90], np.int32)
    for bound in (0.0, 0.3, 1.0, 3.0, 30.0):
        lowest = COSTS - bound * np.sqrt(2 * np.log(1 + visits.sum()) / visits)
        behaviour = BehaviourPolicy(CONFIDENCE_BOUND, bound=bound)
        assert choose(behaviour, 0, COSTS[None], visits[None], state) == np.argmin(lowest)
    chosen = {
        choose(BehaviourPolicy(CONFIDENCE_BOUND, bound=b), 0, COSTS[None], visits[None], state)
        for b in (0.0, 0.5, 30.0)
    }
    assert chosen == {1, 2}, "the bound changes what is chosen"


def test_confidence_tries_the_untried_first() -> None:
    visits = np.array([5, 0, 5, 0], np.int32)
    found = frequencies(
        BehaviourPolicy(CONFIDENCE_BOUND, bound=0.0), np.array([0.0, 9.0, 0.0, 9.0]), visits
    )
    np.testing.assert_allclose(found, [0, 0.5, 0, 0.5], atol=0.012)


@pytest.mark.parametrize("decay", [0.5, 1.0])
def test_exploration_fades_with_the_visits_of_a_state(decay: float) -> None:
    """The 25th visit: eps / 25^d."""
    visits = np.array([10, 4, 10, 0], np.int32)
    astray = 1.0 - frequencies(BehaviourPolicy(epsilon=0.8, decay=decay), COSTS, visits)[1]
    assert astray == pytest.approx(0.75 * 0.8 / 25**decay, abs=0.008)
    weights = np.exp(-0.3 * (1 + np.log(25)) * COSTS)
    found = frequencies(BehaviourPolicy(BOLTZMANN, beta=0.3, decay=decay), COSTS, visits)
    np.testing.assert_allclose(found, weights / weights.sum(), atol=0.012)


def test_following_another_controller() -> None:
    behaviour = BehaviourPolicy(FIXED_POLICY, epsilon=0.4, policy=np.array([3]))
    np.testing.assert_allclose(frequencies(behaviour, COSTS), [0.1, 0.1, 0.1, 0.7], atol=0.012)


def test_thompson_chooses_as_often_as_it_believes() -> None:
    """Two controls: the first is the better one with probability Phi((Q_1 - Q_0) / s), with
    s^2 = L^2 (1/n_0 + 1/n_1). Untried ones come first."""
    costs, visits = np.array([1.0, 1.4]), np.array([4, 12], np.int32)
    found = frequencies(BehaviourPolicy(THOMPSON, bound=1.5), costs, visits)
    sure = 0.4 / (1.5 * np.sqrt(1 / 4 + 1 / 12))
    assert found[0] == pytest.approx(0.5 * (1.0 + erf(sure / np.sqrt(2.0))), abs=0.012)
    untried = frequencies(BehaviourPolicy(THOMPSON), costs, np.array([4, 0], np.int32))
    assert untried.tolist() == [0.0, 1.0]
