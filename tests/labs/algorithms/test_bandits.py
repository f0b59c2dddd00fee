"""Bandits: each turn against plain Python, the ten-armed testbed as published, trouble."""

from functools import cache

import numpy as np
import pytest

from labs.algorithms.bandits import SAMPLE_MEAN, Bandits, Players, gaussian_testbed, init, step
from labs.algorithms.exploration import (
    BOLTZMANN,
    CONFIDENCE_BOUND,
    FIXED_POLICY,
    THOMPSON,
    BehaviourPolicy,
)
from labs.errors import LabError
from labs.problems.episodes import UpdateRule

GREEDY = BehaviourPolicy(epsilon=0.0)
TASKS = 2000


def ten_arms() -> Bandits:
    return gaussian_testbed(TASKS, 10, np.random.default_rng(1))


@cache
def played(
    strategy: str, turns: int = 1000, q0: float = 0.0, alpha: float = 0.0
) -> tuple[Players, Bandits]:
    """2000 tasks by one strategy; estimates are means if alpha = 0."""
    behaviour = {
        "greedy": GREEDY,
        "epsilon 0.1": BehaviourPolicy(epsilon=0.1),
        "epsilon 0.01": BehaviourPolicy(epsilon=0.01),
        "falling": BehaviourPolicy(epsilon=1.0, decay=0.7),
        "Boltzmann": BehaviourPolicy(BOLTZMANN, beta=4.0),
        "bound 2": BehaviourPolicy(CONFIDENCE_BOUND, bound=np.sqrt(2.0)),  # c = 2 of the book
        "Thompson": BehaviourPolicy(THOMPSON, bound=1.0),
    }[strategy]
    bandits = ten_arms()
    start = init(bandits, np.random.default_rng(2), q0)
    rule = UpdateRule(alpha) if alpha else SAMPLE_MEAN
    return step(bandits, behaviour, rule, start, turns), bandits


def test_estimates_are_means_and_regret_adds_up() -> None:
    """Without chance in the costs everything can be checked from the counts."""
    means = np.array([[3.0, 1.0, 2.0], [0.0, -4.0, 5.0]])
    bandits = Bandits(means, np.zeros_like(means))
    after = step(
        bandits,
        BehaviourPolicy(epsilon=0.5),
        SAMPLE_MEAN,
        init(bandits, np.random.default_rng(0)),
        200,
    )
    assert (after.visits.sum(axis=1) == 200).all()
    np.testing.assert_allclose(after.q, means, rtol=1e-12)
    regret = (after.visits * (means - means.min(axis=1, keepdims=True))).sum(axis=1)
    np.testing.assert_allclose(after.regret, regret, rtol=1e-12)
    assert after.regrets[-1] == pytest.approx(regret.mean())
    assert after.costs.sum() == pytest.approx((after.visits * means).sum(axis=1).mean())
    assert after.best.mean() == pytest.approx((after.visits[0, 1] + after.visits[1, 1]) / 400)
    assert after.largest.tolist() == [3.0, 5.0]


def test_the_bound_may_be_measured() -> None:
    """A lone player, no chance in costs: u = argmin Q - L sqrt(2 log t / n), L = max |l| so far."""
    means = np.array([[-1.0, -1.5, -3.0]])
    bandits = Bandits(means, np.zeros((1, 3)))
    players = init(bandits, np.random.default_rng(4))
    lowest = BehaviourPolicy(CONFIDENCE_BOUND, bound=123.0)
    largest, n = 0.0, np.zeros(3)
    for t in range(1, 60):
        after = step(bandits, lowest, SAMPLE_MEAN, players, 1, measured_bound=True)
        (u,) = np.flatnonzero((after.visits - players.visits)[0])
        if t <= 3:
            assert n[u] == 0, "untried ones come first"
        else:
            assert u == np.argmin(means[0] - largest * np.sqrt(2 * np.log(t) / n))
        n[u] += 1
        largest = max(largest, -means[0, u])
        players = after


def test_playing_can_be_interrupted_and_strategies_meet_the_same_luck() -> None:
    rng = np.random.default_rng(0)
    bandits = Bandits(rng.normal(size=(50, 4)), rng.uniform(0.5, 2.0, (50, 4)), drift=0.1)
    start = init(bandits, rng)
    for behaviour in (BehaviourPolicy(epsilon=0.2), BehaviourPolicy(THOMPSON)):
        whole = step(bandits, behaviour, UpdateRule(0.2), start, 90)
        parts = step(bandits, behaviour, UpdateRule(0.2), start, 40)
        rest = step(bandits, behaviour, UpdateRule(0.2), parts, 50)
        for name in ("q", "visits", "means", "regret", "random", "task_random"):
            assert np.array_equal(getattr(rest, name), getattr(whole, name)), name
        assert np.array_equal(np.hstack([parts.costs, rest.costs]), whole.costs)
    other = step(bandits, GREEDY, SAMPLE_MEAN, start, 90)
    assert not np.array_equal(other.visits, whole.visits)
    assert np.array_equal(other.means, whole.means)
    assert not start.visits.any()


def test_the_ten_armed_testbed_of_the_book() -> None:
    """Sutton and Barto, 2.3 and figures 2.2 and 2.4 (2000 tasks, 1000 turns), with costs for
    rewards: the best possible is 1.54 a turn; the greedy one gets about 1 and finds the best arm in
    a third of the tasks; epsilon = 0.1 chooses the best in about 80 % of the last turns, 0.01 in
    about 60 %, at a better slope; the confidence bound c = 2 gets near 1.5."""
    greedy, bandits = played("greedy")
    assert -bandits.means.min(axis=1).mean() == pytest.approx(1.5388, abs=0.045)  # 3.5 deviations
    assert -greedy.costs[-200:].mean() == pytest.approx(1.0, abs=0.06)
    assert greedy.best[-200:].mean() == pytest.approx(1 / 3, abs=0.04)
    tenth, hundredth = played("epsilon 0.1")[0], played("epsilon 0.01")[0]
    assert tenth.best[-100:].mean() == pytest.approx(0.80, abs=0.03)
    assert hundredth.best[-100:].mean() == pytest.approx(0.60, abs=0.04)
    assert -tenth.costs[-100:].mean() == pytest.approx(1.37, abs=0.05)
    bound = played("bound 2")[0]
    assert -bound.costs[-100:].mean() == pytest.approx(1.49, abs=0.05)
    # In the long run 0.1 chooses the best in 91 % of the turns and no more; 0.01 passes it.
    long_tenth, long_hundredth = (played(f"epsilon {e}", 10_000)[0] for e in ("0.1", "0.01"))
    assert long_tenth.best[-500:].mean() < 0.91 + 0.01
    assert long_hundredth.costs[-500:].mean() < long_tenth.costs[-500:].mean()


def test_optimism_explores_without_chance() -> None:
    """Figure 2.3: alpha = 0.1, a greedy player who expects rewards of 5 passes an
    epsilon-greedy one who expects 0."""
    optimist = played("greedy", q0=-5.0, alpha=0.1)[0].best
    realist = played("epsilon 0.1", alpha=0.1)[0].best
    assert optimist[:50].mean() < realist[:50].mean()
    assert optimist[-200:].mean() == pytest.approx(0.84, abs=0.04)
    assert realist[-200:].mean() < optimist[-200:].mean() - 0.04


def test_who_weighs_what_is_unknown_regrets_least() -> None:
    regret = {
        name: played(name)[0].regrets
        for name in ("greedy", "epsilon 0.1", "falling", "Boltzmann", "bound 2", "Thompson")
    }
    final = {name: curve[-1] for name, curve in regret.items()}
    assert min(final, key=final.__getitem__) == "Thompson"
    assert max(final, key=final.__getitem__) == "greedy"
    growth = {name: curve[-1] - curve[-200] for name, curve in regret.items()}
    # A constant share of errors costs a constant regret a turn; the others' grows ever slower.
    assert growth["falling"] < 0.7 * growth["epsilon 0.1"]
    assert growth["Thompson"] < 0.3 * growth["epsilon 0.1"]


def test_thompson_regrets_near_the_lower_bound_of_lai_and_robbins() -> None:
    """Two arms, gap 1, deviation 1: no good strategy regrets less than 2 log t in the long run."""
    bandits = Bandits(np.tile([0.0, 1.0], (4000, 1)), np.ones((4000, 2)))
    start = init(bandits, np.random.default_rng(0))
    curve = step(bandits, BehaviourPolicy(THOMPSON), SAMPLE_MEAN, start, 3000).regrets
    slope = (curve[2999] - curve[299]) / np.log(10.0)
    assert 1.0 < slope < 3.0


def test_constant_steps_follow_means_that_drift() -> None:
    """Exercise 2.5 of Sutton and Barto: all means 0 at first, steps of 0.01, 10 000 turns."""
    bandits = Bandits(np.zeros((300, 10)), np.ones((300, 10)), drift=0.01)
    start, behaviour = init(bandits, np.random.default_rng(0)), BehaviourPolicy(epsilon=0.1)
    mean = step(bandits, behaviour, SAMPLE_MEAN, start, 10_000)
    constant = step(bandits, behaviour, UpdateRule(0.1), start, 10_000)
    assert constant.best[-1000:].mean() > mean.best[-1000:].mean() + 0.2


def test_what_does_not_fit_is_refused() -> None:
    bandits = ten_arms()
    players = init(bandits, np.random.default_rng(0))
    with pytest.raises(LabError, match="no other controller"):
        step(bandits, BehaviourPolicy(FIXED_POLICY), SAMPLE_MEAN, players, 1)
    with pytest.raises(LabError, match="must agree"):
        step(Bandits(np.zeros((2, 3)), np.ones((2, 3))), GREEDY, SAMPLE_MEAN, players, 1)
    with pytest.raises(LabError, match=r"both \(M, K\)"):
        init(Bandits(np.zeros((2, 3)), np.ones((2, 2))), np.random.default_rng(0))
    with pytest.raises(LabError, match="at least 0"):
        init(Bandits(np.zeros((2, 3)), -np.ones((2, 3))), np.random.default_rng(0))
