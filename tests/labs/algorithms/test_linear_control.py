"""Control with linear features: tables bit for bit, chattering and divergence, fixed batches."""

from functools import partial

import numpy as np
import pytest

from labs.algorithms import td_control
from labs.algorithms.approximation import expected_td_update, td_fixed_point, weighted_least_squares
from labs.algorithms.batch_approximation import (
    REPLAY_MC,
    REPLAY_TD,
    TransitionBatch,
    collect_transitions,
    fitted_q_iteration,
    least_squares_fit,
    lstd,
    replay,
    replay_q_learning,
)
from labs.algorithms.exploration import FIXED_POLICY, BehaviourPolicy
from labs.algorithms.features import (
    Features,
    features_from_matrix,
    state_aggregation,
    tabular_features,
    zero_features_at,
)
from labs.algorithms.linear_control import (
    MC_CONTROL,
    Q_LEARNING,
    SARSA,
    init,
    q_table,
    step,
)
from labs.errors import LabError
from labs.problems.episodes import UpdateRule, episodic_task
from labs.problems.finite_mdp import FiniteMDP, random_policy
from labs.random_numbers import random_states
from labs.reinforcement_learning.function_approximation.counterexamples import baird
from labs.resumable import run_to_completion
from labs.tasks.random_walk.walks import (
    NINETEEN_STATE_WALK,
    on_policy_distribution,
    walk_mdp,
    walk_task,
)
from tests.labs.algorithms.learning_tasks import grid, initial_learners, optimum, random_mdp


@pytest.mark.parametrize(
    ("linear", "tabular"), [(Q_LEARNING, td_control.Q_LEARNING), (SARSA, td_control.SARSA)]
)
def test_with_one_feature_a_state_it_is_the_table(linear: int, tabular: int) -> None:
    """Bit for bit, as alpha is a power of two."""
    _, task = grid("cliff", slip=0.1)
    features = zero_features_at(tabular_features(len(task.cost)), task.terminal)
    behaviour, rule = BehaviourPolicy(epsilon=0.3, decay=0.5), UpdateRule(0.5)
    by_table = td_control.step(task, behaviour, rule, tabular, initial_learners(task, 3), 100)
    start = init(task, features, 3, np.random.default_rng(0))
    by_weights = step(task, features, behaviour, rule, linear, start, 100)
    for s in range(3):
        np.testing.assert_array_equal(q_table(features, by_weights.w[s]), by_table.q[s])
    for name in ("visits", "random", "costs", "lengths"):
        assert np.array_equal(getattr(by_weights, name), getattr(by_table, name)), name
    half = step(task, features, behaviour, rule, linear, start, 40)
    rest = step(task, features, behaviour, rule, linear, half, 60)
    assert np.array_equal(rest.w, by_weights.w)


def test_monte_carlo_control_by_table_finds_the_optimum() -> None:
    """Greedy in the limit, falling steps: the 4x4 world from anywhere, exactly in its choices."""
    mdp = grid("4x4")[0].mdp(1.0)
    task = episodic_task(mdp, list(np.flatnonzero(~mdp.terminal)), 1000)
    features = zero_features_at(tabular_features(mdp.X), mdp.terminal)
    start = init(task, features, 4, np.random.default_rng(0))
    behaviour = BehaviourPolicy(epsilon=1.0, decay=0.5)
    after = step(task, features, behaviour, UpdateRule(1.0, 0.7), MC_CONTROL, start, 20_000)
    q_star = optimum(mdp)
    for w in after.w:
        greedy = q_table(features, w).argmin(axis=1)
        chosen = q_star[np.arange(mdp.X), greedy]
        np.testing.assert_array_equal(chosen[~mdp.terminal], q_star.min(axis=1)[~mdp.terminal])


def test_q_learning_diverges_on_baird_s_star_while_sarsa_does_not() -> None:
    """Two controls, each with the star's features. `solid` seems to be the cheaper one everywhere,
    ever more so, and is seldom applied."""
    star = baird()
    task = episodic_task(star.mdp, range(7), 1000)
    uneven = BehaviourPolicy(FIXED_POLICY, epsilon=2.0 / 7.0, policy=np.zeros(7, np.int64))
    start = init(task, star.features, 5, np.random.default_rng(0))
    w = start.w.copy()
    w[:, 1] = -star.w
    start = type(start)(**{**vars(start), "w": w})
    rule = UpdateRule(0.01, limit=1e9)
    off = step(task, star.features, uneven, rule, Q_LEARNING, start, 200)
    on = step(task, star.features, uneven, rule, SARSA, start, 200)
    assert on.bounded.all()
    assert np.abs(on.w).max() <= np.abs(w).max()
    assert not off.bounded.any()
    assert np.isfinite(off.w).all()
    again = step(task, star.features, uneven, rule, Q_LEARNING, off, 1)
    assert np.array_equal(again.w, off.w)


def batch_of_walks(episodes: int = 200) -> TransitionBatch:
    random = random_states(np.random.default_rng(0), 1)[0]
    return collect_transitions(walk_task(NINETEEN_STATE_WALK), random, episodes)


def walk_groups() -> Features:
    """Five of four states, but for the ends."""
    return zero_features_at(
        state_aggregation(np.arange(21) * 5 // 21), walk_task(NINETEEN_STATE_WALK).task.terminal
    )


def test_a_batch_has_two_answers_and_replay_comes_to_both() -> None:
    batch, features = batch_of_walks(), walk_groups()
    phi = features.dense
    direct = np.linalg.lstsq(phi[batch.x], batch.returns, rcond=None)[0]
    fit, fixed = least_squares_fit(features, batch), lstd(features, batch, 1.0)
    np.testing.assert_allclose(fit, direct, atol=1e-9)
    here, ahead = phi[batch.x], phi[batch.y]
    residual = here.T @ (batch.cost + ahead @ fixed - here @ fixed)
    np.testing.assert_allclose(residual / len(batch.x), 0.0, atol=1e-12)
    assert np.abs(phi @ (fit - fixed)).max() > 0.3
    rule = UpdateRule(0.5, 0.5)

    def replayed(
        method: int, w: np.ndarray, random: np.ndarray, draws: int, drawn: int = 0
    ) -> np.ndarray:
        work = replay(features, batch, 1.0, rule, method, w, random, draws, drawn)
        return run_to_completion(work)

    for method, answer in ((REPLAY_MC, fit), (REPLAY_TD, fixed)):
        random = random_states(np.random.default_rng(1), 1)[0]
        w = run_to_completion(
            replay(features, batch, 1.0, rule, method, np.zeros(5), random, 6_000_000)
        )
        np.testing.assert_allclose(phi @ w, phi @ answer, atol=0.05)
        again = random_states(np.random.default_rng(1), 1)[0]
        half = replayed(method, np.zeros(5), again, 70)
        half = run_to_completion(
            replay(features, batch, 1.0, rule, method, half, again, 30, drawn=70)
        )
        once = random_states(np.random.default_rng(1), 1)[0]
        whole = run_to_completion(
            replay(features, batch, 1.0, rule, method, np.zeros(5), once, 100)
        )
        assert np.array_equal(half, whole)


def test_large_batches_lead_to_the_fixed_points_of_the_chain() -> None:
    task = walk_task(NINETEEN_STATE_WALK)
    features = walk_groups()
    mdp = walk_mdp(NINETEEN_STATE_WALK)
    batch = batch_of_walks(20_000)
    mu = on_policy_distribution(NINETEEN_STATE_WALK)
    phi = features.dense
    P, C = mdp.transition_matrix(random_policy(mdp)), mdp.policy_cost(random_policy(mdp))
    fixed = td_fixed_point(*expected_td_update(P, C, 1.0, phi, mu))
    np.testing.assert_allclose(phi @ lstd(features, batch, 1.0), phi @ fixed, atol=0.02)
    best = weighted_least_squares(task.truth, phi, mu)
    np.testing.assert_allclose(phi @ least_squares_fit(features, batch), phi @ best, atol=0.02)


def exploring_batch(mdp: FiniteMDP, draws: int) -> TransitionBatch:
    """Any state, any control."""
    rng = np.random.default_rng(3)
    x, u = rng.integers(mdp.X, size=draws), rng.integers(mdp.U, size=draws)
    y = np.array([rng.choice(mdp.X, p=mdp.probabilities[b, a]) for a, b in zip(x, u, strict=True)])
    return TransitionBatch(x, u, mdp.C[x, u], y, np.zeros(draws))


def test_a_fixed_batch_teaches_the_optimum_by_a_table() -> None:
    """Fitted Q-iteration and replayed Q-learning: both to the optimum of the batch's own model."""
    mdp = random_mdp(5, 2, 0.7, seed=4)
    batch, features = exploring_batch(mdp, 4000), tabular_features(5)
    counts = np.zeros((2, 5, 5))
    np.add.at(counts, (batch.u, batch.x, batch.y), 1.0)
    seen = FiniteMDP(mdp.C, 0.7, mdp.terminal, P=counts / counts.sum(axis=2, keepdims=True))
    w = np.zeros((2, 5))
    for _ in range(80):
        w = run_to_completion(fitted_q_iteration(features, batch, 0.7, w))
    np.testing.assert_allclose(q_table(features, w), optimum(seen), atol=1e-9)
    random = random_states(np.random.default_rng(5), 1)[0]
    rule = UpdateRule(1.0, 0.6)
    learned = run_to_completion(
        replay_q_learning(features, batch, 0.7, rule, np.zeros((2, 5)), random, 1_000_000)
    )
    np.testing.assert_allclose(q_table(features, learned), optimum(seen), atol=0.02)
    np.testing.assert_allclose(q_table(features, learned), optimum(mdp), atol=0.1)


def test_what_does_not_fit_is_refused() -> None:
    _, task = grid("cliff")
    good = zero_features_at(tabular_features(len(task.cost)), task.terminal)
    start = init(task, good, 1, np.random.default_rng(0))
    for features, words in (
        (tabular_features(3), "3 states"),
        (tabular_features(len(task.cost)), "all features are 0"),
    ):
        with pytest.raises(LabError, match=words):
            init(task, features, 1, np.random.default_rng(0))
    greedy, rule = BehaviourPolicy(), UpdateRule()
    few = state_aggregation(np.zeros(len(task.cost)))
    with pytest.raises(LabError, match="weights"):
        step(task, few, greedy, rule, SARSA, start, 1)
    with pytest.raises(LabError, match="policy of 0"):
        step(task, good, BehaviourPolicy(FIXED_POLICY), rule, SARSA, start, 1)
    with pytest.raises(LabError, match="no method 3"):
        step(task, good, greedy, rule, 3, start, 1)
    empty = TransitionBatch(*(np.zeros(0, int) for _ in range(5)))
    random = random_states(np.random.default_rng(0), 1)[0]
    with pytest.raises(LabError, match="empty batch"):
        run_to_completion(replay(good, empty, 1.0, rule, REPLAY_TD, np.zeros(good.size), random, 1))


@pytest.mark.parametrize("gamma", [1.0, 0.9])
def test_lstd_of_groups_of_states_is_that_of_any_features(gamma: float) -> None:
    """Solved by its band; the same features, written as a matrix, by rank."""
    batch = batch_of_walks(5)
    apart = zero_features_at(tabular_features(21), walk_task(NINETEEN_STATE_WALK).task.terminal)
    for few in (batch, TransitionBatch(*(column[:7] for column in batch))):  # the second is cut
        for features in (apart, walk_groups()):
            dense = features_from_matrix(features.dense)
            for answers in (least_squares_fit, partial(lstd, gamma=gamma)):
                np.testing.assert_allclose(answers(features, few), answers(dense, few), atol=1e-9)
