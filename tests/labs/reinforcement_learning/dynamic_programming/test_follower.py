"""The walker and the pendulum that follow the policy shown: on the way, at rest, pushed, and on a
map that changes."""

import numpy as np
import pytest

from labs.reinforcement_learning.dynamic_programming.follower import (
    MAX_WALK_STEPS,
    MOVE,
    REST,
    PolicyFollower,
    apply_push,
    carry_over,
    follow_policy,
    start_follower,
)
from labs.reinforcement_learning.dynamic_programming.tasks import (
    TabularTask,
    grid_key,
    pendulum_key,
    tabular_task,
)
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.grid_world.walk import GridWalk, nominal_path
from labs.tasks.pendulum_table.swing import Swing

ROOM = tabular_task(grid_key(MAPS["room"], False, 0.0, False, 1.0, 0.9))
PENDULUM = tabular_task(pendulum_key(21, 3, 2.5, 0.05, 0.05, 0.9))


def follow_for(
    task: TabularTask, follower: PolicyFollower, policy: np.ndarray | None, periods: int
) -> PolicyFollower:
    """So many periods later."""
    for _ in range(periods):
        follower = follow_policy(task, follower, policy, seed=0)
    return follower


def optimal_path(task: TabularTask) -> tuple[np.ndarray, np.ndarray]:
    """An optimal policy, and the cells it leads through."""
    assert isinstance(task.place, GridWorld)
    _, best = task.solution
    return best, nominal_path(task.place, best)


def test_a_walker_walks_rests_and_starts_anew() -> None:
    best, way = optimal_path(ROOM)
    steps = len(way) - 1
    assert ROOM.mdp.terminal[ROOM.state(way[-1])]
    at = follow_for(ROOM, start_follower(ROOM), best, MOVE)
    np.testing.assert_array_equal(at.walk.at[0], way[1])
    at = follow_for(ROOM, at, best, MOVE * (steps - 1))
    np.testing.assert_array_equal(at.walk.path[:, 0], way)
    assert at.walk.cost[0] == pytest.approx((1.0 - 0.9**steps) / 0.1)
    at = follow_for(ROOM, at, best, REST - 1)
    np.testing.assert_array_equal(at.walk.at[0], way[-1])
    at = follow_for(ROOM, at, best, 2)
    np.testing.assert_array_equal(at.walk.at[0], way[0])
    assert (at.walk.steps, at.walk.cost[0]) == (0, 0.0)


def test_who_gets_lost_starts_anew_and_who_has_nothing_to_do_rests() -> None:
    up = np.zeros(ROOM.mdp.X, np.int64)
    at = follow_for(ROOM, start_follower(ROOM), up, MAX_WALK_STEPS * MOVE + 1)
    assert at.resting
    assert at.walk.steps == MAX_WALK_STEPS
    assert follow_for(ROOM, start_follower(ROOM), None, 1).resting == REST


def test_a_fall_leads_back() -> None:
    task = tabular_task(grid_key(MAPS["cliff"], False, 0.0, False, 1.0, 1.0))
    right = np.ones(38, np.int64)
    at = follow_for(task, start_follower(task), right, MOVE)
    np.testing.assert_array_equal(at.walk.at[0], [3, 0])
    assert at.walk.cost[0] == 100.0


def test_the_pendulum_holds_a_torque_for_a_time_step_and_coasts_at_rest() -> None:
    policy = np.arange(PENDULUM.mdp.X) % 3
    at = start_follower(PENDULUM)
    torques = []
    for _ in range(50):
        at = follow_policy(PENDULUM, at, policy, 0)
        assert isinstance(at.walk, Swing)
        torques.append(float(at.walk.torque[0]))
    assert at.walk.steps == 5
    assert all(len(set(torques[k : k + 10])) == 1 for k in range(0, 50, 10))
    coasting = follow_for(PENDULUM, start_follower(PENDULUM), None, 30)
    np.testing.assert_array_equal(coasting.walk.at, 0.0)
    pushed = apply_push(PENDULUM, at, 0)
    np.testing.assert_array_equal(pushed.walk.at[0] - at.walk.at[0], [0.0, 4.0])


def test_a_push_moves_the_walker_somewhere() -> None:
    at = start_follower(ROOM)
    places = []
    for _ in range(20):
        at = apply_push(ROOM, at, 3)
        assert not ROOM.mdp.terminal[ROOM.state(at.walk.at[0])]
        places.append(tuple(at.walk.at[0]))
    assert len(set(places)) > 5


def test_a_walk_goes_on_while_its_cells_are_there() -> None:
    at = start_follower(ROOM, draws=3)
    assert carry_over(ROOM, at) is at
    elsewhere = GridWorld.parse(MAPS["room"]).with_cell(3, 3, "S").with_cell(0, 0, "#")
    other = tabular_task(grid_key(elsewhere.text, False, 0.0, False, 1.0, 0.9))
    moved = carry_over(other, at)
    np.testing.assert_array_equal(moved.walk.at[0], [3, 3])
    assert moved.draws == 3
    small = tabular_task(grid_key("SG", False, 0.0, False, 1.0, 0.9))
    assert isinstance(ROOM.place, GridWorld)
    corner = ROOM.place.cells[-1:]
    far = PolicyFollower(GridWalk(corner, corner, np.zeros(1), corner[None], MOVE))
    np.testing.assert_array_equal(carry_over(small, far).walk.at[0], [0, 0])
    assert isinstance(carry_over(PENDULUM, at).walk, Swing)


def test_a_smaller_table_takes_over_a_swing() -> None:
    """With fewer torques and nodes, in the midst of a time step."""
    large = tabular_task(pendulum_key(21, 11, 2.5, 0.05, 0.05, 0.9))
    full = np.full(large.mdp.X, 10)
    at = follow_for(large, start_follower(large), full, 15)
    assert at.walk.clock == 5
    small = tabular_task(pendulum_key(11, 3, 2.5, 0.05, 0.05, 0.9))
    kept = carry_over(small, at)
    assert kept is at
    later = follow_for(small, kept, np.ones(small.mdp.X, np.int64), 10)
    assert isinstance(later.walk, Swing)
    assert later.walk.torque[0] == 0.0
