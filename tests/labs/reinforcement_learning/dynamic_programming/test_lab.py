"""The lab on dynamic programming: what it does with a click, a change and a solution that is taken
up again."""

from itertools import pairwise

import numpy as np
import pytest

from labs.colors import NO_VALUE
from labs.engine.catalog import find_lab
from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.errors import LabError
from labs.params import Value
from labs.rounding import round_up
from labs.scene import NullScene
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.grid_world.picture import board
from tests.labs.reinforcement_learning.dynamic_programming.worlds import (
    SLUG,
    params_of,
    solved,
)
from tests.labs.solving import solve
from tests.labs.tasks.recording_scene import RecordingScene

# Solving --------------------------------------------------------------------------------------


def test_four_iterations_from_one_seed_reach_their_limits() -> None:
    """From initial values that the seed draws, the same for all four."""
    one, other = (World(find_lab(SLUG), {"spread": 20.0}, seed=seed) for seed in (1, 2))
    V = one.state.iterates.V
    assert np.ptp(V, axis=0).max() == 0.0
    assert 5.0 < V.std() < 7.0
    assert not np.array_equal(V, other.state.iterates.V)
    solve(one)
    at, found = one.state.iterates, one.state.tabular_task
    np.testing.assert_allclose(at.V, found.limits, atol=1e-4)
    bound = one.lab.fields(one.params, one.state)
    assert (bound["error_value"] <= bound["bound"] + 1e-9).all()
    assert one.latest is not None
    assert one.latest.done.startswith("All four iterations have converged: the largest distance ")
    assert one.latest.progress == 1.0


def test_a_kept_snapshot_shows_its_sweep_again_and_nothing_is_written_into() -> None:
    world = World(find_lab(SLUG), {"gamma": 0.9})
    lab, snapshots, copies = world.lab, [], []
    for snapshot in filter(None, lab.solve(world.params, world.state)):
        snapshots.append(snapshot)
        copies.append(snapshot.data["iterates"].V.copy())
    for snapshot, V in zip(snapshots, copies, strict=True):
        at = lab.accept(world.params, world.state, snapshot).iterates
        np.testing.assert_array_equal(at.V, V)
        assert len(at.errors) == at.count.max() + 1
    parts = [s.progress or 0.0 for s in snapshots]
    assert parts[-1] == 1.0
    assert all(0.0 <= part <= 1.0 for part in parts)


def test_solving_goes_on_from_where_the_state_is() -> None:
    world = World(find_lab(SLUG))
    straight = solved({})
    for _ in range(7):
        world.iterate()
    again = World(find_lab(SLUG))
    again.state = world.state
    rest = list(filter(None, again.lab.solve(again.params, world.state)))
    last = rest[-1].data["iterates"]
    np.testing.assert_array_equal(last.V, straight.state.iterates.V)
    np.testing.assert_array_equal(last.errors, straight.state.iterates.errors)
    (nothing,) = filter(None, again.lab.solve(again.params, straight.state))
    assert nothing.done


def test_a_warm_start_takes_fewer_sweeps() -> None:
    sweeps = {}
    for warm in (True, False):
        world = solved({"world": "pendulum", "gamma": 0.95, "warm": warm})
        world.change({"gamma": 0.951})
        solve(world)
        sweeps[warm] = world.state.iterates.count
        np.testing.assert_allclose(
            world.state.iterates.V, world.state.tabular_task.limits, atol=1e-4
        )
    assert (sweeps[True] < sweeps[False]).all()
    world.change({"m": 9})  # a new race is run afresh
    assert world.solving
    world.iterate()
    assert (world.state.iterates.count == 1).all()


def test_what_has_no_limit_is_not_begun_and_says_why() -> None:
    sealed = MAPS["4x4"].replace("....\n....", "#...\n.#..", 1)
    world = solved({"map": "G.\n#.\n.#", "gamma": 1.0})
    assert (world.state.iterates.count == 0).all()
    done = world.latest.done if world.latest else ""
    assert "Value iteration: not begun: with gamma = 1 the cost-to-go of 1 of 4 states" in done
    assert "From 1 state no way" in world.lab.notes(world.params, world.state)["about"]
    assert (solved({"map": sealed, "gamma": 1.0}).state.iterates.count > 0).all()
    swinging = solved({"world": "pendulum", "gamma": 1.0, "nodes": 31})
    assert (swinging.state.iterates.count > 0).tolist() == [False, False, True, True]


@pytest.mark.parametrize("shown", ["evaluation", "policy", "modified", "value"])
def test_what_has_no_value_is_left_out(shown: str) -> None:
    world = solved({"map": "S.#G", "gamma": 1.0, "shown": shown})
    for _ in range(200):
        world.advance()
    measured = world.lab.measure(world.params, world.state)
    assert not {"at_start", "promised", "error", "angle", "torque"} & set(measured)
    assert np.isnan(world.recording().channels["at_start"]).all()
    fields = world.lab.fields(world.params, world.state)
    assert np.isnan(fields["V_map"]).all()
    for name in ("stationary", f"error_{shown}", f"backups_{shown}", "bound"):
        assert len(fields[name]) == 0, name
    scene = RecordingScene()
    world.lab.draw(scene, world.params, world.state)
    assert (scene.colors["board"][0, :2] == NO_VALUE).all()


def test_cells_without_a_state_have_no_value_and_all_others_do() -> None:
    world = solved({"map": "S.#\n..G"})
    fields = world.lab.fields(world.params, world.state)
    wall = [[False, False, False], [False, False, True]]
    np.testing.assert_array_equal(np.isnan(fields["V_map"]), wall)
    ways = {(x, y): (right, up) for x, y, right, up in fields["policy"].tolist()}
    assert ways.keys() == {(1, 2), (2, 2), (1, 1), (2, 1)}, "all but wall and goal; y = 2 on top"
    assert ways[1, 1] == ways[2, 1] == (1, 0)
    assert ways[2, 2] == (0, -1)
    measured = world.lab.measure(world.params, world.state)
    assert measured["at_start"] == pytest.approx(1 + 0.95 + 0.95**2)
    assert measured["error"] < 1e-6


def test_without_discount_a_small_change_is_no_convergence() -> None:
    """A wanderer on 15 x 15 cells: the iteration stops with an error of 142."""
    open_field = "\n".join(["S" + 14 * ".", *13 * [15 * "."], 14 * "." + "G"])
    world = solved({"map": open_field, "gamma": 1.0, "tolerance": 0.1})
    error = world.state.iterates.errors[-1, 0]
    assert error > 100.0
    assert world.latest is not None
    assert world.latest.done == (
        "All four iterations have stopped; with gamma = 1 that bounds no distance to the limit: "
        f"the largest distance left is {round_up(error)}."
    )
    assert float(round_up(error)) >= error
    lines = world.lab.notes(world.params, world.state)["account"].splitlines()
    assert lines[0].endswith(
        "by more than 0.1; with gamma = 1 that bounds no distance to the limit."
    )
    assert lines[3].endswith("The last sweep changed no value.")


# In the scene ---------------------------------------------------------------------------------


def test_a_click_edits_the_map() -> None:
    world = solved({})
    place = GridWorld.parse(params_of(world).map)
    centers = board(place).centers

    def click(row: int, column: int) -> str:
        world.hold("board", tuple(map(float, centers[row, column])))  # type: ignore[arg-type]
        solve(world)
        for _ in range(40):
            world.advance()
        return str(params_of(world).map.splitlines()[row][column])

    assert click(0, 5) == "#"
    assert click(0, 5) == "."
    world.change({"brush": "G"})
    assert click(6, 12) == "G"
    assert params_of(world).map.count("G") == 1, "the goal has moved"
    world.change({"brush": "S"})
    assert click(0, 0) == "S"
    world.change({"brush": "#"})
    with pytest.raises(LabError, match="no goal"):
        click(6, 12)
    assert params_of(world).map.count("G") == 1
    np.testing.assert_allclose(world.state.iterates.V, world.state.tabular_task.limits, atol=1e-4)


def test_a_wall_that_lands_on_the_walker_sends_it_back() -> None:
    world = solved({})
    while tuple(world.state.follower.walk.at[0].astype(int)) == (3, 0):
        world.advance()
    row, column = world.state.follower.walk.to[0].astype(int)
    grid = [list(line) for line in params_of(world).map.splitlines()]
    grid[row][column] = "#"
    world.change({"map": "\n".join("".join(line) for line in grid)})
    world.iterate()
    assert tuple(world.state.follower.walk.at[0]) == (3, 0)


def test_the_optimal_walk_keeps_the_promise() -> None:
    """Paid plus discounted cost-to-go is constant along it, and it ends at the goal."""
    world = solved({})
    for _ in range(16 * 30 + 50):
        world.advance()
    promised = world.recording().channels["promised"][1:]
    np.testing.assert_allclose(promised, promised[0], atol=1e-9)
    assert tuple(world.state.follower.walk.at[0]) == (3, 10)
    way = world.state.follower.walk.path[:, 0]
    assert len(way) == 17
    assert all(np.abs(b - a).sum() == 1 for a, b in pairwise(way))


def test_slipping_follows_the_probabilities() -> None:
    """A wanderer's paths depend on the seed, and on nothing else."""
    ways = [
        run_headless(
            SLUG, {"shown": "evaluation", "slip": 0.3}, seconds=6.0, seed=seed
        ).state.follower.walk.path[:, 0]
        for seed in (0, 0, 1)
    ]
    np.testing.assert_array_equal(ways[0], ways[1])
    assert ways[0].shape != ways[2].shape or not np.array_equal(ways[0], ways[2])


@pytest.mark.parametrize("world", ["grid", "pendulum"])
@pytest.mark.parametrize("shown", ["evaluation", "policy", "modified", "value", "finite"])
def test_every_method_draws_its_values_and_policy(world: str, shown: str) -> None:
    shown_one = solved({"world": world, "shown": shown, "gamma": 0.9})
    scene = NullScene()
    shown_one.lab.draw(scene, shown_one.params, shown_one.state)
    assert {"relief", "policy"} <= set(scene.names)
    assert ("board" in scene.names) == (world == "grid")
    assert ("pendulum 1" in scene.names) == (world == "pendulum")


def test_a_torque_is_held_whatever_a_new_table_offers() -> None:
    """Until the next look-up, though the coarser table has fewer torques to choose from."""
    setting: dict[str, Value] = {
        "world": "pendulum",
        "gamma": 0.98,
        "levels": 11,
        "nodes": 31,
        "shown": "value",
    }
    world = solved(setting)

    def torque() -> float:
        return float(world.lab.measure(world.params, world.state)["torque"])

    for _ in range(55):
        world.advance()
    held = torque()
    assert held not in (-2.5, 0.0, 2.5)
    world.change({"levels": 3})
    world.iterate()
    assert torque() == held
    solve(world)
    for _ in range(15):
        world.advance()
    assert torque() in (-2.5, 0.0, 2.5)
