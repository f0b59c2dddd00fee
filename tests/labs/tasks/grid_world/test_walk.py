"""Walkers go where their policies and the probabilities say, one or several side by side."""

from collections.abc import Callable

import numpy as np
import pytest

from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.grid_world.walk import (
    PATH_LENGTH,
    GridWalk,
    advance_walk,
    choose_steps,
    is_valid_walk,
    nominal_path,
    start_walk,
)

UP, RIGHT, DOWN, LEFT = range(4)
MOVE = 5


def never() -> float:
    raise AssertionError("nothing is left to chance here")


def walk_for(
    world: GridWorld,
    policies: np.ndarray,
    walk: GridWalk,
    periods: int,
    gamma: float = 1.0,
    slip: float = 0.0,
    random: Callable[[], float] = never,
) -> GridWalk:
    """So many periods later."""
    mdp = world.mdp(gamma, slip)
    for _ in range(periods):
        if walk.clock == 0:
            walk = choose_steps(world, mdp, policies, walk, random)
        walk = advance_walk(walk)
    return walk


def constant(world: GridWorld, *controls: int) -> np.ndarray:
    """A policy for each walker that always does the same."""
    return np.tile(np.array(controls)[:, None], len(world.cells))


def test_a_step_takes_its_time_and_is_paid_when_it_is_chosen() -> None:
    world = GridWorld.parse("S..G")
    walk = walk_for(world, constant(world, RIGHT), start_walk(world, MOVE), MOVE - 1, gamma=0.5)
    assert (walk.at.tolist(), walk.to.tolist(), walk.clock) == ([[0, 0]], [[0, 1]], MOVE - 1)
    assert (walk.cost.tolist(), walk.steps) == ([1.0], 1)
    walk = walk_for(world, constant(world, RIGHT), walk, 1, gamma=0.5)
    assert (walk.at.tolist(), walk.to.tolist(), walk.clock) == ([[0, 1]], [[0, 1]], 0)
    walk = walk_for(world, constant(world, RIGHT), walk, 2 * MOVE, gamma=0.5)
    assert (walk.at.tolist(), walk.cost.tolist(), walk.idle) == ([[0, 3]], [1.75], 0)
    assert walk.path[:, 0].tolist() == [[0, 0], [0, 1], [0, 2], [0, 3]]
    walk = walk_for(world, constant(world, RIGHT), walk, 2 * MOVE, gamma=0.5)
    assert (walk.at.tolist(), walk.cost.tolist(), walk.idle) == ([[0, 3]], [1.75], 2)


def test_walkers_side_by_side_go_their_own_ways_and_wait_for_each_other() -> None:
    world = GridWorld.parse("SG\n..")
    walk = walk_for(world, constant(world, RIGHT, DOWN), start_walk(world, MOVE, 2), 3 * MOVE)
    assert walk.at.tolist() == [[0, 1], [1, 0]]
    assert (walk.cost.tolist(), walk.steps, walk.idle) == ([1.0, 3.0], 3, 0)


def test_a_slip_follows_the_numbers_drawn() -> None:
    """Of four controls with p = 0.4 each is done with 0.1, the wanted one with 0.7: the next states
    from the middle of a cross, in the order of their numbers, are up, left, right, down."""
    world = GridWorld.parse(".G.\n.S.\n...")
    wanted = constant(world, RIGHT)
    for drawn, cell in ((0.05, [0, 1]), (0.15, [1, 0]), (0.25, [1, 2]), (0.85, [1, 2])):
        walk = walk_for(world, wanted, start_walk(world, 1), 1, slip=0.4, random=lambda r=drawn: r)  # type: ignore[misc]
        assert walk.at.tolist() == [cell], drawn
    walk = walk_for(world, wanted, start_walk(world, 1), 1, slip=0.4, random=lambda: 0.95)
    assert walk.at.tolist() == [[2, 1]]


def test_who_stands_on_no_cell_is_back_at_the_start() -> None:
    world = GridWorld.parse("S..G")
    walk = walk_for(world, constant(world, RIGHT), start_walk(world, MOVE), 2 * MOVE)
    assert is_valid_walk(world, walk)
    for text in ("S.#G", "SG"):
        smaller = GridWorld.parse(text)
        assert not is_valid_walk(smaller, walk)
        again = walk_for(smaller, constant(smaller, RIGHT), walk, MOVE)
        assert again.at.tolist() == [[0, 1]]


def test_a_long_walk_keeps_the_end_of_its_path_and_leaves_the_old_walk_alone() -> None:
    world = GridWorld.parse("S.\n.G")
    first = start_walk(world, 1)
    walk = walk_for(world, constant(world, UP), first, PATH_LENGTH + 50)
    assert walk.path.shape == (PATH_LENGTH, 1, 2)
    assert first.path.shape == (1, 1, 2)
    assert first.cost.tolist() == [0.0]


def test_a_rollout_ends_at_a_goal_or_where_it_comes_again() -> None:
    world = GridWorld.parse(MAPS["cliff"])
    policy = np.full(len(world.cells), RIGHT)
    assert nominal_path(world, policy).tolist() == [[3, 0]], "off the cliff, and back at the start"
    policy[world.state((3, 0))] = UP
    policy[world.state((2, 11))] = DOWN
    way = nominal_path(world, policy).tolist()
    assert way == [[3, 0], *([2, c] for c in range(12)), [3, 11]]
    policy[world.state((2, 5))] = LEFT
    assert nominal_path(world, policy).tolist() == way[:7], "to and fro"


def test_a_rollout_of_a_finite_horizon_takes_the_policy_of_each_time() -> None:
    world = GridWorld.parse("S..G\n....")
    ways = np.array([constant(world, u)[0] for u in (DOWN, RIGHT, RIGHT)])
    assert nominal_path(world, ways).tolist() == [[0, 0], [0, 1], [0, 2], [1, 2]]
    assert nominal_path(world, ways[:0]).tolist() == [[0, 0]]
    assert len(nominal_path(world, np.array([constant(world, UP)[0]] * 9))) == 10, "may come again"


@pytest.mark.parametrize("cell", [(-1, 0), (0, -1), (2, 0), (0, 4), (1, 1)])
def test_there_is_no_state_beside_the_map_or_in_a_wall(cell: tuple[int, int]) -> None:
    world = GridWorld.parse("S..G\n.#..")
    assert world.state(cell) == -1
    assert world.state((1, 2)) == 5
