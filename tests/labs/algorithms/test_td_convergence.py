"""Where learning from experience leads, and that it can be interrupted."""

import numpy as np
import pytest

from labs.algorithms.exploration import FIXED_POLICY, BehaviourPolicy
from labs.algorithms.td_control import (
    Q_LEARNING,
    SARSA,
    SARSA_LAMBDA,
    SARSA_N,
    greedy_costs,
    step,
)
from labs.problems.episodes import UpdateRule, episodic_task
from labs.tasks.grid_world.map import MAPS, GridWorld
from tests.labs.algorithms.learning_tasks import grid, initial_learners, optimum, random_mdp, same

EVERY_METHOD = [Q_LEARNING, SARSA, SARSA_N, SARSA_LAMBDA]
every_method = pytest.mark.parametrize("method", EVERY_METHOD)


@every_method
def test_learning_can_be_interrupted_anywhere(method: int) -> None:
    _, experience = grid("windy", slip=0.1)
    rule, behaviour = (
        UpdateRule(0.3, 0.6, n=3, trace_decay=0.6),
        BehaviourPolicy(epsilon=0.3, decay=0.5),
    )
    start = initial_learners(experience, seeds=2)
    before = start.q.copy()
    whole = step(experience, behaviour, rule, method, start, 30)
    half = step(experience, behaviour, rule, method, start, 17)
    rest = step(experience, behaviour, rule, method, half, 13)
    assert same(whole, rest)
    assert np.array_equal(np.concatenate([half.costs, rest.costs], axis=1), whole.costs)
    assert np.array_equal(start.q, before), "the old learners are left alone"


def test_with_step_one_q_learning_finds_the_exact_optimum_of_a_deterministic_world() -> None:
    world = GridWorld.parse(MAPS["windy"])
    mdp = world.mdp(1.0)
    q_star = optimum(mdp)
    assert q_star[world.start].min() == 15.0
    everywhere = episodic_task(mdp, list(np.flatnonzero(~mdp.terminal)), 200)
    learners = step(
        everywhere,
        BehaviourPolicy(epsilon=0.5),
        UpdateRule(1.0),
        Q_LEARNING,
        initial_learners(everywhere, 3),
        5000,
    )
    assert learners.visits[:, ~mdp.terminal].min() > 0
    for q in learners.q:
        np.testing.assert_array_equal(q, q_star)


def test_q_learning_converges_in_a_random_world() -> None:
    """Robbins-Monro steps and any exploration: within 1 % of the span of Q* after 3 million
    transitions."""
    mdp = random_mdp(8, 3, 0.8, seed=0)
    q_star = optimum(mdp)
    everywhere = episodic_task(mdp, range(8), 100)
    learners = step(
        everywhere,
        BehaviourPolicy(epsilon=0.5),
        UpdateRule(1.0, 0.7),
        Q_LEARNING,
        initial_learners(everywhere, 4),
        30_000,
    )
    assert np.abs(learners.q - q_star).max() < 0.01 * np.ptp(q_star)


@pytest.mark.parametrize(("method", "decay"), [(SARSA, 0.0), (SARSA_LAMBDA, 0.5)])
def test_sarsa_converges_if_it_explores_less_and_less(method: int, decay: float) -> None:
    """GLIE and Robbins-Monro: within 3 % of the span. With constant exploration it does not: it
    learns what its own exploring costs."""
    mdp = random_mdp(6, 2, 0.7, seed=1)
    q_star = optimum(mdp)
    everywhere = episodic_task(mdp, range(6), 100)
    rule, untrained = UpdateRule(1.0, 0.8, trace_decay=decay), initial_learners(everywhere, 4)
    glie = step(
        everywhere, BehaviourPolicy(epsilon=1.0, decay=0.5), rule, method, untrained, 30_000
    )
    constant = step(everywhere, BehaviourPolicy(epsilon=0.5), rule, method, untrained, 30_000)
    span = np.ptp(q_star)
    assert np.abs(glie.q - q_star).max() < 0.03 * span
    assert (constant.q - q_star).min() > 0.05 * span


def test_sarsa_that_follows_a_controller_learns_its_value() -> None:
    """On-policy evaluation: Q of the epsilon-noisy controller, by a linear system."""
    mdp = random_mdp(6, 2, 0.7, seed=2)
    mu, epsilon = np.array([0, 1, 1, 0, 1, 0]), 0.4
    weights = np.full((6, 2), epsilon / 2)
    weights[np.arange(6), mu] += 1 - epsilon
    V = np.linalg.solve(np.eye(6) - 0.7 * mdp.transition_matrix(weights), mdp.policy_cost(weights))
    q_mu = mdp.C + 0.7 * np.einsum("uxy,y->xu", mdp.probabilities, V)
    everywhere = episodic_task(mdp, range(6), 100)
    behaviour = BehaviourPolicy(FIXED_POLICY, epsilon=epsilon, policy=mu)
    untrained, rule = initial_learners(everywhere, 4), UpdateRule(1.0, 0.7)
    by_sarsa = step(everywhere, behaviour, rule, SARSA, untrained, 30_000).q
    by_q_learning = step(everywhere, behaviour, rule, Q_LEARNING, untrained, 30_000).q
    np.testing.assert_allclose(by_sarsa, np.broadcast_to(q_mu, by_sarsa.shape), atol=0.02)
    q_star = optimum(mdp)
    assert np.abs(q_mu - q_star).max() > 0.2, "the controller is far from the best"
    np.testing.assert_allclose(by_q_learning, np.broadcast_to(q_star, by_sarsa.shape), atol=0.02)


def test_the_cliff_parts_on_policy_from_off_policy() -> None:
    """Forty learners of each kind, epsilon = 0.1 for good: Q-learning's greedy walk is the optimal
    one of 13 along the edge; SARSA keeps off it. While learning, SARSA pays less."""
    _, experience = grid("cliff")
    behaviour, untrained = BehaviourPolicy(epsilon=0.1), initial_learners(experience, 40)
    off = step(experience, behaviour, UpdateRule(0.5), Q_LEARNING, untrained, 1000)
    on = step(experience, behaviour, UpdateRule(0.5), SARSA, untrained, 1000)
    assert (greedy_costs(experience, off) == 13.0).all()
    # A walk with the greedy policy may run in circles where SARSA's estimates wobble.
    safe = greedy_costs(experience, on)
    arrived = safe[safe < experience.horizon]
    assert len(arrived) >= 25
    assert (arrived >= 15.0).all(), "one row of safety costs two steps more"
    assert np.median(arrived) == 17.0
    paid_off, paid_on = off.costs[:, 500:].mean(axis=1), on.costs[:, 500:].mean(axis=1)
    assert (paid_on < paid_off).all()
    assert paid_off.mean() == pytest.approx(49, abs=4)
    assert paid_on.mean() == pytest.approx(26, abs=3)


def test_the_windy_grid_takes_fifteen_steps() -> None:
    _, experience = grid("windy")
    for method in (Q_LEARNING, SARSA):
        learners = step(
            experience,
            BehaviourPolicy(epsilon=0.1, decay=0.5),
            UpdateRule(0.5),
            method,
            initial_learners(experience, 10),
            3000,
        )
        assert (greedy_costs(experience, learners) == 15.0).sum() >= (10 if method == 0 else 8)
