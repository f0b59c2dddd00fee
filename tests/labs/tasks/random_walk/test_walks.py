"""Random walks of the literature: their values as published, their visits as counted."""

import numpy as np
import pytest

from labs.problems.finite_mdp import random_policy
from labs.problems.prediction import empty_episode, sample_episode
from labs.random_numbers import random_states
from labs.tasks.random_walk.walks import (
    FIVE_STATE_WALK,
    NINETEEN_STATE_WALK,
    THOUSAND_STATE_WALK,
    WalkShape,
    on_policy_distribution,
    walk_mdp,
    walk_task,
)


def test_values_are_linear_between_the_ends() -> None:
    np.testing.assert_allclose(
        walk_task(FIVE_STATE_WALK).truth[1:6], -np.arange(1, 6) / 6, atol=1e-14
    )
    np.testing.assert_allclose(
        walk_task(NINETEEN_STATE_WALK).truth[1:20], np.linspace(0.9, -0.9, 19), atol=1e-14
    )
    assert [walk.start for walk in (FIVE_STATE_WALK, NINETEEN_STATE_WALK, THOUSAND_STATE_WALK)] == [
        3,
        10,
        500,
    ]


def test_the_long_jumps_of_the_thousand_states() -> None:
    """V solves its Bellman equation; near the ends it bends away from the straight line."""
    task, mdp = walk_task(THOUSAND_STATE_WALK), walk_mdp(THOUSAND_STATE_WALK)
    V = task.truth
    P, C = mdp.transition_matrix(random_policy(mdp)), mdp.policy_cost(random_policy(mdp))
    np.testing.assert_allclose(C + P @ V, V, atol=1e-12)
    np.testing.assert_allclose(V, -V[::-1], atol=1e-12)
    assert P[1, 0] == pytest.approx(100 / 200)
    assert P[950, 1001] == pytest.approx(50 / 200)
    assert V[1] < 1.0 - 0.05


def test_visits_are_shared_as_counted() -> None:
    walk = WalkShape(7, 0.0, -1.0, reach=3)
    task, share, counts = walk_task(walk), on_policy_distribution(walk), np.zeros(9)
    room, random = empty_episode(task.task.horizon), random_states(np.random.default_rng(0), 1)[0]
    lengths = []
    for _ in range(20_000):
        T = sample_episode(task, random, room)
        counts += np.bincount(room.states[:T], minlength=9)
        lengths.append(T)
        assert room.states[T] in (0, 8)
    np.testing.assert_allclose(counts / counts.sum(), share, atol=0.006)
    assert share.sum() == pytest.approx(1.0)
