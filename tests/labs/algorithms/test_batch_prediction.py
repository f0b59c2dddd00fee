"""Batch prediction: the two answers of one batch, and the sweeps that lead to them."""

import numpy as np
import pytest

from labs.algorithms.batch_prediction import (
    Batch,
    batch_from_episodes,
    certainty_equivalence,
    collect_episodes,
    empty_batch,
    least_squares,
    monte_carlo_sweep,
    td_sweep,
)
from labs.algorithms.prediction import EVERY_VISIT, init, step
from labs.errors import LabError
from labs.problems.episodes import UpdateRule
from labs.problems.prediction import root_mean_square_error
from labs.tasks.random_walk.walks import FIVE_STATE_WALK, walk_task

FIVE_TASK = walk_task(FIVE_STATE_WALK)


def walked(episodes: int, seeds: int = 100) -> Batch:
    return collect_episodes(FIVE_TASK, empty_batch(7, seeds, np.random.default_rng(1)), episodes)


def test_you_are_the_predictor() -> None:
    """Example 6.4 of Sutton and Barto: A 0 B 0 once, B 1 six times, B 0 once. V(B) = 3/4 by both;
    V(A) = 3/4 by TD and 0 by Monte Carlo."""
    A, B, end = 0, 1, 2
    episodes = [([A, B, end], [0.0, 0.0]), *[([B, end], [-1.0])] * 6, ([B, end], [0.0])]
    batch = batch_from_episodes(episodes, 3, 1.0)
    V = np.zeros((1, 3))
    np.testing.assert_allclose(certainty_equivalence(batch, V, 1.0)[0], [-0.75, -0.75, 0.0])
    np.testing.assert_allclose(least_squares(batch, V)[0], [0.0, -0.75, 0.0])


def test_sweeps_settle_at_the_two_answers() -> None:
    batch = walked(20, seeds=10)
    start = np.full((10, 7), -0.5) * (1.0 - FIVE_TASK.task.terminal)
    td = monte_carlo = start
    alpha = 1.0 / batch.visits.max()
    for _ in range(4000):
        td = td_sweep(batch, td, 1.0, alpha)
        monte_carlo = monte_carlo_sweep(batch, monte_carlo, alpha)
    np.testing.assert_allclose(td, certainty_equivalence(batch, start, 1.0), atol=1e-9)
    np.testing.assert_allclose(monte_carlo, least_squares(batch, start), atol=1e-9)


def test_what_was_never_seen_keeps_its_value() -> None:
    batch, start = batch_from_episodes([([3, 2, 1, 0], [0.0] * 3)], 7, 1.0), np.full((1, 7), 5.0)
    for V in (certainty_equivalence(batch, start, 1.0), least_squares(batch, start)):
        assert V[0, [4, 5, 6]].tolist() == [5.0] * 3
    assert least_squares(batch, start)[0, 1:4].tolist() == [0.0] * 3


def test_td_beats_monte_carlo_on_the_five_state_walk_at_every_size_of_batch() -> None:
    """Figure 6.2 of Sutton and Barto, 100 learners with -0.5 for all they have not seen. The answer
    of batch MC is the mean of all costs-to-go, that of learning with steps of 1/N."""
    start = np.full((100, 7), -0.5) * (1.0 - FIVE_TASK.task.terminal)
    np.testing.assert_allclose(
        root_mean_square_error(FIVE_TASK, start), np.sqrt((2 / 9 + 2 / 36) / 5)
    )
    batch = walked(0)
    td: list[float] = []
    monte_carlo: list[float] = []
    for _ in range(100):
        batch = collect_episodes(FIVE_TASK, batch, 1)
        for errors, V in (
            (td, certainty_equivalence(batch, start, 1.0)),
            (monte_carlo, least_squares(batch, start)),
        ):
            errors.append(root_mean_square_error(FIVE_TASK, V).mean())
    assert (np.array(td)[5:] < np.array(monte_carlo)[5:]).all()
    assert td[-1] < 0.7 * monte_carlo[-1]
    learners = init(FIVE_TASK, 100, np.random.default_rng(1))
    mean = step(FIVE_TASK, UpdateRule(1.0, omega=1.0), EVERY_VISIT, learners, 100)
    seen = batch.visits > 0.0
    np.testing.assert_allclose(mean.V[seen], least_squares(batch, start)[seen], rtol=1e-12)


def test_collecting_can_be_interrupted() -> None:
    whole, halves = walked(9, 3), collect_episodes(FIVE_TASK, walked(4, 3), 5)
    for name in ("visits", "transitions", "costs", "returns", "random"):
        assert np.array_equal(getattr(whole, name), getattr(halves, name))


def test_a_cut_episode_is_refused() -> None:
    short = FIVE_TASK._replace(task=FIVE_TASK.task._replace(horizon=2))
    with pytest.raises(LabError, match="cut after 2 steps"):
        collect_episodes(short, empty_batch(7, 1, np.random.default_rng(0)), 1)
