"""What the two clocks of the lab multiple-shooting must obey."""

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.multiple_shooting.lab import MultipleShootingState
from labs.params import Value
from labs.scene import NullScene
from labs.tasks.motion.playback import FEEDBACK
from tests.labs.solving import solve, stop_reason


def world_of(**setting: Value) -> World:
    return World(find_lab("multiple-shooting"), setting)


def state(world: World) -> MultipleShootingState:
    assert isinstance(world.state, MultipleShootingState)
    return world.state


def drawn(world: World) -> list[str]:
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    return scene.names


def test_arcs_are_drawn_apart_until_they_join() -> None:
    world = world_of(segments=7.0)
    assert [f"gap {i}" in drawn(world) for i in range(1, 8)] == [True] * 6 + [False]
    solve(world)
    assert stop_reason(world).startswith("Converged")
    names = drawn(world)
    assert not [name for name in names if name.startswith("gap")]
    assert {f"segment {i}" for i in range(1, 8)} | {f"start {i}" for i in range(1, 8)} < set(names)
    world.show(1)
    assert [name for name in drawn(world) if name.startswith("gap")], "looking back"


def test_segments_are_at_most_as_many_as_pieces() -> None:
    world = world_of(pieces=6.0, segments=40.0)
    solve(world)
    np.testing.assert_array_equal(state(world).anatomy.cuts, 2 * np.arange(7))


def test_the_plan_is_played_to_its_goal() -> None:
    world = world_of()
    solve(world)
    while not len(state(world).goal_errors):
        world.advance()
    assert state(world).goal_errors[FEEDBACK] < 1e-4


def test_a_change_starts_warm() -> None:
    world = world_of()
    solve(world)
    world.change({"segments": 20.0})
    solve(world)
    assert stop_reason(world).startswith("Converged")
    assert state(world).history.iterations <= 3
    assert state(world).history.gaps[0].max() < 0.5, "from the motion it had"


def test_a_reach_goes_to_the_dragged_target_around_the_ball() -> None:
    world = world_of(system="ur5", horizon=1.0, obstacle=True)
    target = (0.45, -0.25, 0.3)
    world.change(world.lab.edit(world.params, "target", target))
    solve(world)
    assert stop_reason(world).startswith("Converged")
    at = state(world)
    tips = at.history.tips[-1].reshape(-1, 3)
    np.testing.assert_allclose(tips[-1], target, atol=1e-3)
    ball = world.params.ball  # type: ignore[attr-defined]
    nodes = at.history.tips[-1][:, 0]
    assert np.linalg.norm(nodes - ball.center, axis=1).min() >= ball.radius - 1e-3


def test_an_infeasible_limit_says_so_and_the_next_change_recovers() -> None:
    world = world_of(limited=True, limit=0.2)
    solve(world)
    assert stop_reason(world).startswith("Infeasible")
    assert state(world).failed
    world.change({"limited": False})
    solve(world)
    assert stop_reason(world).startswith("Converged")
    fresh = world_of()
    solve(fresh)
    assert stop_reason(world) == stop_reason(fresh), "from the first guess, not from what failed"
    assert not state(world).failed
    assert state(world).history.gaps[-1].max() == pytest.approx(0.0, abs=1e-7)
