"""The numerics of the lab of prediction: beside the algorithms, and beside one another."""

import numpy as np
import pytest

from labs.algorithms.bellman import policy_backup
from labs.algorithms.monte_carlo import every_visit, first_visit
from labs.algorithms.temporal_difference import td0
from labs.problems.episodes import UpdateRule
from labs.problems.prediction import Episode
from labs.random_numbers import random_states
from labs.reinforcement_learning.prediction.corners import ExhaustiveSearch
from labs.reinforcement_learning.prediction.live_learner import (
    advance_live_learner,
    start_live_learner,
)
from labs.reinforcement_learning.prediction.targets import sample_targets
from labs.reinforcement_learning.prediction.worlds import (
    PredictionWorld,
    grid_prediction,
    pendulum_prediction,
    walk_prediction,
)
from labs.tasks.random_walk.walks import FIVE_STATE_WALK, NINETEEN_STATE_WALK

RULES = (UpdateRule(0.2), UpdateRule(0.5))


def test_the_grid_has_the_values_of_the_book() -> None:
    """Example 4.1 of Sutton and Barto."""
    world = grid_prediction(1.0)
    expected = [[0, 14, 20, 22], [14, 18, 20, 20], [20, 20, 18, 14], [22, 20, 14, 0]]
    np.testing.assert_allclose(world.truth.reshape(4, 4), expected, atol=1e-9)


@pytest.mark.parametrize(
    "world",
    [
        walk_prediction(FIVE_STATE_WALK, 1.0),
        grid_prediction(1.0),
        pendulum_prediction(0.95, 0.2, True),
    ],
    ids=["walk", "grid", "swing"],
)
def test_monte_carlo_is_unbiased_within_its_standard_error(world: PredictionWorld) -> None:
    """And the value that was computed is the one that is paid."""
    random = random_states(np.random.default_rng(3), 1)[0]
    for x in (world.start, int(world.states[0])):
        mc, td = sample_targets(world.task, x, world.truth, random, 4000)
        there = mc[np.isfinite(mc)]
        assert len(there) > 3980
        for targets in (there, td):
            allowed = 4.0 * targets.std() / np.sqrt(len(targets)) + 1e-9
            assert abs(targets.mean() - world.truth[x]) < allowed
        assert td.std() <= there.std()


def test_a_pendulum_that_is_held_up_has_no_targets_of_monte_carlo() -> None:
    world = pendulum_prediction(0.95, 0.2, False)
    random = random_states(np.random.default_rng(3), 1)[0]
    mc, td = sample_targets(world.task, world.start, world.truth, random, 100)
    assert np.isnan(mc).all()
    assert np.isfinite(td).all()


@pytest.mark.parametrize("first", [True, False])
def test_the_walker_learns_as_the_many_do(first: bool) -> None:
    """Episode by episode, bit for bit: its episodes are given to both."""
    world = grid_prediction(1.0)
    live = start_live_learner(world, random_states(np.random.default_rng(5), 1)[0], 0.5)
    V, visits = live.V.copy(), live.visits.copy()
    while live.episodes < 20:
        done = live.episodes
        live = advance_live_learner(world, RULES, first, live, 1.0)
        if live.episodes > done:
            T = len(live.controls)
            costs = world.mdp.C[live.states[:-1], live.controls]
            episode = Episode(live.states, live.controls, costs, np.empty(T))
            update = first_visit if first else every_visit
            update(1.0, episode, T, True, RULES[0], V[0], visits[0])
            td0(1.0, episode, T, RULES[1], V[1], visits[1])
            np.testing.assert_array_equal(live.V, V)
            np.testing.assert_array_equal(live.visits, visits)


def test_the_walker_rests_and_starts_anew_where_an_episode_is_cut() -> None:
    """Monte Carlo learns nothing from it."""
    world = pendulum_prediction(0.95, 0.2, False)
    live = start_live_learner(world, random_states(np.random.default_rng(5), 1)[0], 0.0)
    for _ in range(100):
        live = advance_live_learner(world, RULES, False, live, 1.0)
    assert live.over
    assert live.episodes == 1
    assert not live.V[0].any()
    assert live.V[1].any()
    live = advance_live_learner(world, RULES, False, live, 1.0)
    assert not live.over
    assert len(live.controls) == 1


def test_exhaustive_search_gives_the_values_of_dynamic_programming_at_another_price() -> None:
    for world in (
        walk_prediction(FIVE_STATE_WALK, 0.9),
        walk_prediction(NINETEEN_STATE_WALK, 1.0),
        grid_prediction(1.0),
    ):
        tree, V = ExhaustiveSearch(world.mdp, world.policy), np.zeros(world.mdp.X)
        for _ in range(6):
            tree.deepen()
            V, _, _ = policy_backup(world.mdp, V, world.policy)
            np.testing.assert_allclose(tree.values, V, atol=1e-12)
    tree = ExhaustiveSearch(
        walk_prediction(FIVE_STATE_WALK, 1.0).mdp, walk_prediction(FIVE_STATE_WALK, 1.0).policy
    )
    tree.deepen()
    assert tree.transitions == 10.0
    tree.deepen()
    assert tree.transitions == 16.0  # two of the ten ended


def test_the_pendulum_s_end_costs_nothing() -> None:
    world = pendulum_prediction(0.95, 0.0, True)
    assert world.mdp.terminal.sum() == 9
    assert not world.mdp.C[world.mdp.terminal].any()
    np.testing.assert_allclose(world.truth[world.mdp.terminal], 0.0, atol=1e-12)
