"""Problems that can be watched: their walkers and pendulums, and values carried over."""

import numpy as np
import pytest

from labs.reinforcement_learning.dynamic_programming.problems import (
    LOST,
    MOVE,
    PAUSE,
    Walk,
    afresh,
    begin,
    carried,
    finite_horizon,
    fits,
    grid_key,
    nudged,
    pendulum_key,
    problem,
    rollout,
    state_of,
    tick,
)
from labs.tasks.grid_world.map import MAPS, GridWorld

ROOM = grid_key(MAPS["room"], False, 0.0, 0.9)
PENDULUM = pendulum_key(21, 3, 2.5, 0.05, 0.05, 0.9)


def follow(key: str, walk: Walk, policy: np.ndarray | None, ticks: int) -> Walk:
    """So many ticks later."""
    for _ in range(ticks):
        walk = tick(problem(key), walk, policy, seed=0)
    return walk


def test_a_problem_is_made_once() -> None:
    assert problem(ROOM) is problem(grid_key(MAPS["room"], False, 0.0, 0.9))
    assert problem(ROOM) is not problem(grid_key(MAPS["room"], False, 0.1, 0.9))
    assert problem(ROOM).solution is problem(ROOM).solution


def test_distances_are_straight() -> None:
    found = problem(grid_key("S#.\n...\nG..", False, 0.0, 1.0))
    assert found.distance[found.start] == 2.0
    assert found.distance[1] == pytest.approx(np.sqrt(8.0)), "walls or not"
    swinging = problem(PENDULUM)
    hanging = swinging.distance[swinging.start]
    assert hanging == pytest.approx(np.pi, abs=0.16)
    values, _ = finite_horizon(PENDULUM, 2.0)
    np.testing.assert_allclose(values[0], 2.0 * swinging.distance)


def test_a_walker_walks_rests_and_starts_anew() -> None:
    found = problem(ROOM)
    _, best = found.solution
    way = rollout(found, best)
    steps = len(way) - 1
    assert found.mdp.terminal[state_of(found, way[-1])]
    walk = follow(ROOM, begin(found), best, MOVE)
    np.testing.assert_array_equal(walk.at, way[1])
    walk = follow(ROOM, walk, best, MOVE * (steps - 1))
    np.testing.assert_array_equal(walk.path, way)
    assert walk.paid == pytest.approx((1.0 - 0.9**steps) / 0.1)
    walk = follow(ROOM, walk, best, PAUSE - 1)
    np.testing.assert_array_equal(walk.at, way[-1])
    walk = follow(ROOM, walk, best, 2)
    np.testing.assert_array_equal(walk.at, way[0])


def test_who_gets_lost_starts_anew_and_who_has_nothing_to_do_rests() -> None:
    found = problem(ROOM)
    up = np.zeros(found.mdp.X, np.int64)
    walk = follow(ROOM, begin(found), up, LOST * MOVE + 1)
    assert walk.resting
    assert walk.steps == LOST
    assert follow(ROOM, begin(found), None, 1).resting == PAUSE


def test_a_fall_leads_back() -> None:
    key = grid_key(MAPS["cliff"], False, 0.0, 1.0)
    right = np.ones(38, np.int64)
    walk = follow(key, begin(problem(key)), right, MOVE)
    np.testing.assert_array_equal(walk.at, [3, 0])
    assert walk.paid == 100.0


def test_the_pendulum_holds_a_torque_for_a_time_step() -> None:
    found = problem(PENDULUM)
    policy = np.arange(found.mdp.X) % 3
    walk = begin(found)
    chosen = []
    for _ in range(50):
        walk = tick(found, walk, policy, 0)
        chosen.append(walk.u)
    assert walk.steps == 5
    assert all(len(set(chosen[k : k + 10])) == 1 for k in range(0, 50, 10))
    coasting = follow(PENDULUM, begin(found), None, 30)
    np.testing.assert_array_equal(coasting.at, 0.0)
    np.testing.assert_array_equal(nudged(found, walk, 0).at - walk.at, [0.0, 4.0])


def test_a_nudge_moves_the_walker_somewhere() -> None:
    found = problem(ROOM)
    walk = begin(found)
    places = []
    for _ in range(20):
        walk = nudged(found, walk, 3)
        assert not found.mdp.terminal[state_of(found, walk.at)]
        places.append(tuple(walk.at))
    assert len(set(places)) > 5


def test_a_walk_fits_while_its_cells_are_there() -> None:
    walk = begin(problem(ROOM))
    assert fits(problem(ROOM), walk)
    elsewhere = GridWorld.parse(MAPS["room"]).changed(3, 3, "S").changed(0, 0, "#")
    assert not fits(problem(grid_key(elsewhere.text, False, 0.0, 0.9)), walk)
    small = problem(grid_key("SG", False, 0.0, 0.9))
    far = problem(ROOM).place
    assert isinstance(far, GridWorld)
    corner = far.cells[-1].astype(float)
    assert not fits(small, Walk(corner, corner, corner[None]))


def test_values_are_carried_over_by_cells() -> None:
    old = grid_key("S..\n..G", False, 0.0, 0.9)
    new = grid_key("S#.\n..G", False, 0.0, 0.9)
    at = afresh(old, 7, 5.0)
    assert at.V[0].max() > 0.0
    found = carried(at, old, new, afresh(new, 7, 5.0))
    np.testing.assert_array_equal(found.V, np.delete(at.V, 1, axis=1))
    assert (found.count == 0).all()
    other = afresh(PENDULUM, 7, 5.0)
    assert carried(at, old, PENDULUM, other) is other
    larger = grid_key("S...\n...G", False, 0.0, 0.9)
    fresh = afresh(larger, 7, 5.0)
    assert carried(at, old, larger, fresh) is fresh
    heavier = pendulum_key(21, 3, 2.0, 0.05, 0.05, 0.9)
    kept = carried(other, PENDULUM, heavier, afresh(heavier, 8, 1.0))
    np.testing.assert_array_equal(kept.V, other.V)


def test_the_start_is_drawn_by_the_seed() -> None:
    one, same, other = (afresh(ROOM, seed, 10.0) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.V, same.V)
    assert not np.array_equal(one.V, other.V)
    assert (one.V[:, problem(ROOM).mdp.terminal] == 0.0).all()
