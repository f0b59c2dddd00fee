"""Learning from experience: each update step by step against plain Python, and trouble."""

from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms.exploration import CONFIDENCE_BOUND, FIXED_POLICY, BehaviourPolicy, choose
from labs.algorithms.td_control import (
    Q_LEARNING,
    SARSA,
    SARSA_LAMBDA,
    SARSA_N,
    Learners,
    init,
    step,
)
from labs.errors import LabError
from labs.problems.episodes import EpisodicTask, UpdateRule, episodic_task
from labs.problems.finite_mdp import FiniteMDP
from labs.tasks.grid_world.map import MAPS, GridWorld
from tests.labs.algorithms.learning_tasks import grid, initial_learners, same

EVERY_METHOD = [Q_LEARNING, SARSA, SARSA_N, SARSA_LAMBDA]
every_method = pytest.mark.parametrize("method", EVERY_METHOD)


# One episode whose controls are known beforehand, against plain Python --------------------------


def scripted_policy() -> tuple[EpisodicTask, BehaviourPolicy, list[tuple[int, int, float]]]:
    """Round a ring of three states, cut after seven steps: pairs come again. What happens is
    known: (x, u, l) of each step."""
    successor = np.array([[1, 2], [2, 0], [0, 3], [3, 3]], np.int32)
    cost = np.array([[1.0, 4.0], [2.0, 5.0], [3.0, 7.0], [0.0, 0.0]])
    mdp = FiniteMDP(cost, 0.9, np.array([0, 0, 0, 1], bool), successor=successor)
    behaviour = BehaviourPolicy(FIXED_POLICY, epsilon=0.0, policy=np.array([0, 0, 0, 0]))
    visited = [(x, 0, cost[x, 0]) for x in (0, 1, 2, 0, 1, 2, 0)]
    return episodic_task(mdp, [0], 7), behaviour, visited


def ending() -> tuple[EpisodicTask, BehaviourPolicy, list[tuple[int, int, float]]]:
    """Two steps to a terminal state."""
    successor = np.array([[1, 2], [1, 2], [3, 3], [3, 3]], np.int32)
    cost = np.array([[1.0, 4.0], [2.0, 5.0], [3.0, 7.0], [0.0, 0.0]])
    mdp = FiniteMDP(cost, 0.9, np.array([0, 0, 0, 1], bool), successor=successor)
    behaviour = BehaviourPolicy(FIXED_POLICY, epsilon=0.0, policy=np.array([1, 0, 1, 0]))
    return episodic_task(mdp, [0], 50), behaviour, [(0, 1, 4.0), (2, 1, 7.0)]


def begun(experience: EpisodicTask) -> Learners:
    """Learners with some opinion already."""
    learners = initial_learners(experience)
    return replace(learners, q=np.random.default_rng(3).uniform(0.0, 5.0, learners.q.shape))


@pytest.mark.parametrize("episode", [scripted_policy, ending])
def test_q_learning_does_what_it_says(episode: object) -> None:
    experience, behaviour, visited = episode()  # type: ignore[operator]
    before = begun(experience)
    q, count = before.q[0].copy(), np.zeros((4, 2))
    for x, u, cost in visited:
        y = experience.successor[x, u]
        ahead = 0.0 if experience.terminal[y] else min(q[y])
        count[x, u] += 1
        q[x, u] += 0.5 / count[x, u] ** 0.7 * (cost + 0.9 * ahead - q[x, u])
    after = step(experience, behaviour, UpdateRule(0.5, 0.7), Q_LEARNING, before, 1)
    np.testing.assert_allclose(after.q[0], q, rtol=1e-14)
    assert np.array_equal(after.visits[0], count)
    assert after.lengths[0, 0] == len(visited)
    assert after.costs[0, 0] == pytest.approx(
        sum(0.9**k * c for k, (_, _, c) in enumerate(visited))
    )


@pytest.mark.parametrize("episode", [scripted_policy, ending])
@pytest.mark.parametrize("n", [1, 2, 3, 20])
def test_sarsa_n_does_what_it_says(episode: object, n: int) -> None:
    """The textbook order: the pair of n steps ago is updated as soon as its costs are there."""
    experience, behaviour, visited = episode()  # type: ignore[operator]
    before = begun(experience)
    q, T = before.q[0].copy(), len(visited)
    x, u, _ = visited[-1]
    last = int(experience.successor[x, u])
    pairs = [(x, u) for x, u, _ in visited] + [(last, int(behaviour.policy[last]))]
    costs = [cost for _, _, cost in visited]
    for t in range(T):
        end = min(t + n, T)
        rest = 0.0 if end == T and experience.terminal[last] else q[pairs[end]]
        target = sum(0.9 ** (k - t) * costs[k] for k in range(t, end)) + 0.9 ** (end - t) * rest
        q[pairs[t]] += 0.5 * (target - q[pairs[t]])
    after = step(experience, behaviour, UpdateRule(0.5, n=n), SARSA_N, before, 1)
    np.testing.assert_allclose(after.q[0], q, rtol=1e-13)
    if n == 1:
        same_by_sarsa = step(experience, behaviour, UpdateRule(0.5), SARSA, before, 1)
        np.testing.assert_allclose(same_by_sarsa.q[0], q, rtol=1e-13)


@pytest.mark.parametrize("episode", [scripted_policy, ending])
@pytest.mark.parametrize("decay", [0.0, 0.4, 1.0])
def test_offline_sarsa_lambda_moves_to_the_lambda_return(episode: object, decay: float) -> None:
    """Backward view against forward view: n-step returns weighed by (1 - lambda) lambda^(n-1),
    the rest of the weight on the last one. Every visit adds its part."""
    experience, behaviour, visited = episode()  # type: ignore[operator]
    before = begun(experience)
    q, T = before.q[0], len(visited)
    x, u, _ = visited[-1]
    last = int(experience.successor[x, u])
    pairs = [(x, u) for x, u, _ in visited] + [(last, int(behaviour.policy[last]))]
    costs = [cost for _, _, cost in visited]

    def n_step(t: int, n: int) -> float:
        rest = 0.0 if t + n == T and experience.terminal[last] else q[pairs[t + n]]
        return float(sum(0.9**k * costs[t + k] for k in range(n)) + 0.9**n * rest)

    moved = q.copy()
    for t in range(T):
        N = T - t
        target = sum((1 - decay) * decay ** (n - 1) * n_step(t, n) for n in range(1, N))
        target += decay ** (N - 1) * n_step(t, N)
        moved[pairs[t]] += 0.3 * (target - q[pairs[t]])
    after = step(
        experience,
        behaviour,
        UpdateRule(0.3, trace_decay=decay, offline=True),
        SARSA_LAMBDA,
        before,
        1,
    )
    np.testing.assert_allclose(after.q[0], moved, rtol=1e-12)


def test_offline_lambda_one_is_every_visit_monte_carlo() -> None:
    """On the windy grid, from an episode that revisits many pairs to its end at the goal: each
    visit moves its pair by alpha (J_t - Q)."""
    world, experience = grid("windy", horizon=100_000)
    before = initial_learners(experience, seed=5)
    behaviour = BehaviourPolicy(epsilon=1.0)
    rule = UpdateRule(0.001, trace_decay=1.0, offline=True)
    after = step(experience, behaviour, rule, SARSA_LAMBDA, before, 1)
    # The same episode once more: who always explores does the same whatever is learned.
    pairs, random = [], before.random[0].copy()
    x = world.start
    u = chosen(behaviour, x, experience, random)
    while not experience.terminal[x]:
        pairs.append((x, u))
        x = int(experience.successor[x, u])
        if not experience.terminal[x]:
            u = chosen(behaviour, x, experience, random)
    assert len(pairs) == after.lengths[0, 0] > 100
    assert len(set(pairs)) < len(pairs)
    expected = np.zeros_like(before.q[0])
    to_go = 0.0
    for pair in reversed(pairs):
        to_go += experience.cost[pair]
        expected[pair] += 0.001 * to_go
    np.testing.assert_allclose(after.q[0], expected, rtol=1e-9)


def chosen(behaviour: BehaviourPolicy, x: int, experience: EpisodicTask, random: np.ndarray) -> int:
    table = np.zeros(experience.cost.shape)
    return int(choose(behaviour, x, table, table.astype(np.int32), random))


@pytest.mark.parametrize(
    "explorer", [BehaviourPolicy(), BehaviourPolicy(CONFIDENCE_BOUND), BehaviourPolicy(decay=1.0)]
)
@pytest.mark.parametrize("omega", [0.0, 0.8])
@pytest.mark.parametrize("slip", [0.0, 0.2])
def test_lambda_zero_and_one_step_are_sarsa_bit_for_bit(
    explorer: BehaviourPolicy, omega: float, slip: float
) -> None:
    _, experience = grid("cliff", slip)
    one = other = third = initial_learners(experience, seeds=3)
    for _ in range(5):
        one = step(experience, explorer, UpdateRule(0.4, omega), SARSA, one, 40)
        other = step(
            experience, explorer, UpdateRule(0.4, omega, trace_decay=0.0), SARSA_LAMBDA, other, 40
        )
        third = step(experience, explorer, UpdateRule(0.4, omega, n=1), SARSA_N, third, 40)
        assert np.array_equal(one.costs, other.costs)
        assert same(one, other)
        assert same(one, third)


# Trouble ---------------------------------------------------------------------------------------


def test_accumulating_traces_may_diverge_and_say_so() -> None:
    _, experience = grid("windy")
    rule = UpdateRule(1.0, trace_decay=1.0, limit=1e6)
    learners = step(
        experience, BehaviourPolicy(), rule, SARSA_LAMBDA, initial_learners(experience), 100
    )
    assert not learners.bounded
    assert np.isfinite(learners.q).all()
    assert np.isfinite(learners.costs).all()
    assert step(experience, BehaviourPolicy(), rule, SARSA_LAMBDA, learners, 10) is learners
    kind = step(
        experience,
        BehaviourPolicy(),
        rule._replace(replacing=True, trace_decay=0.9),
        SARSA_LAMBDA,
        initial_learners(experience),
        100,
    )
    assert kind.bounded


def test_an_episode_that_starts_at_its_end_is_empty() -> None:
    mdp = GridWorld.parse(MAPS["4x4"]).mdp(1.0)
    nowhere = episodic_task(mdp, [0], 10)
    for method in EVERY_METHOD:
        learners = step(
            nowhere, BehaviourPolicy(), UpdateRule(), method, initial_learners(nowhere), 3
        )
        assert learners.lengths.sum() == learners.visits.sum() == 0


def test_what_does_not_fit_is_refused() -> None:
    _, experience = grid("cliff")
    good = initial_learners(experience)
    for changed, behaviour, rule, learners, words in (
        (
            experience,
            BehaviourPolicy(),
            UpdateRule(),
            init((3, 4), 1, np.random.default_rng(0)),
            "must agree",
        ),
        (
            experience._replace(starts=np.array([99])),
            BehaviourPolicy(),
            UpdateRule(),
            good,
            "at least one state",
        ),
        (
            experience,
            BehaviourPolicy(FIXED_POLICY, policy=np.zeros(2, int)),
            UpdateRule(),
            good,
            "policy of 2",
        ),
        (experience, BehaviourPolicy(FIXED_POLICY), UpdateRule(), good, "policy of 0"),
        (experience, BehaviourPolicy(epsilon=1.5), UpdateRule(), good, "epsilon = 1.5"),
        (experience, BehaviourPolicy(), UpdateRule(alpha=-0.1), good, "alpha = -0.1"),
        (experience, BehaviourPolicy(), UpdateRule(n=0), good, "n = 0"),
    ):
        with pytest.raises(LabError, match=words):
            step(changed, behaviour, rule, Q_LEARNING, learners, 1)
