"""What dynamic programming is tried on, and the values it begins with."""

import numpy as np
import pytest

from labs.reinforcement_learning.dynamic_programming.tasks import (
    cold_start,
    finite_horizon,
    grid_key,
    pendulum_key,
    tabular_task,
    warm_start,
)
from labs.tasks.grid_world.map import MAPS

ROOM = grid_key(MAPS["room"], False, 0.0, False, 1.0, 0.9)
PENDULUM = pendulum_key(21, 3, 2.5, 0.05, 0.05, 0.9)


def test_a_task_is_made_once() -> None:
    assert tabular_task(ROOM) is tabular_task(grid_key(MAPS["room"], False, 0.0, False, 1.0, 0.9))
    assert tabular_task(ROOM) is not tabular_task(
        grid_key(MAPS["room"], False, 0.1, False, 1.0, 0.9)
    )
    assert tabular_task(ROOM).solution is tabular_task(ROOM).solution


def test_distances_are_straight() -> None:
    task = tabular_task(grid_key("S#.\n...\nG..", False, 0.0, False, 1.0, 1.0))
    assert task.distance[task.start] == 2.0
    assert task.distance[1] == pytest.approx(np.sqrt(8.0)), "walls or not"
    swinging = tabular_task(PENDULUM)
    hanging = swinging.distance[swinging.start]
    assert hanging == pytest.approx(np.pi, abs=0.16)
    values, _ = finite_horizon(PENDULUM, 2.0)
    np.testing.assert_allclose(values[0], 2.0 * swinging.distance)


def test_a_warm_start_carries_values_over_by_cells() -> None:
    old = grid_key("S..\n..G", False, 0.0, False, 1.0, 0.9)
    new = grid_key("S#.\n..G", False, 0.0, False, 1.0, 0.9)
    at = cold_start(old, 7, 5.0)
    assert at.V[0].max() > 0.0
    found = warm_start(at, old, new, cold_start(new, 7, 5.0))
    np.testing.assert_array_equal(found.V, np.delete(at.V, 1, axis=1))
    assert (found.count == 0).all()
    other = cold_start(PENDULUM, 7, 5.0)
    assert warm_start(at, old, PENDULUM, other) is other
    larger = grid_key("S...\n...G", False, 0.0, False, 1.0, 0.9)
    cold = cold_start(larger, 7, 5.0)
    assert warm_start(at, old, larger, cold) is cold
    heavier = pendulum_key(21, 3, 2.0, 0.05, 0.05, 0.9)
    kept = warm_start(other, PENDULUM, heavier, cold_start(heavier, 8, 1.0))
    np.testing.assert_array_equal(kept.V, other.V)


def test_a_cold_start_is_drawn_by_the_seed() -> None:
    one, same, other = (cold_start(ROOM, seed, 10.0) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.V, same.V)
    assert not np.array_equal(one.V, other.V)
    assert (one.V[:, tabular_task(ROOM).mdp.terminal] == 0.0).all()
