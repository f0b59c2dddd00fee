"""The lab on dynamic programming: what its article claims, in numbers, and what it does with a
click, a change and a solution taken up again."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import ArrayLike

from labs.engine.catalog import find
from labs.engine.headless import run
from labs.engine.run import World
from labs.errors import LabError
from labs.params import Value
from labs.reinforcement_learning.dynamic_programming.params import DynamicProgrammingParams
from labs.reinforcement_learning.dynamic_programming.tasks import finite_horizon
from labs.rounding import rounded_up
from labs.scene import NullScene
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.grid_world.picture import NO_VALUE, board
from labs.tasks.grid_world.walk import nominal_path
from labs.tasks.pendulum_table.table import PendulumGrid
from tests.labs.experiments import Experiments

SLUG = "dynamic-programming"
ARTICLE = Experiments("labs.reinforcement_learning", "dynamic_programming")
Setting = Mapping[str, Value]


def solved(setting: Setting) -> World:
    """A world whose iterations are over."""
    world = World(find(SLUG), setting)
    while world.solving:
        world.iterate()
    return world


def params_of(world: World) -> DynamicProgrammingParams:
    """With their type."""
    assert isinstance(world.params, DynamicProgrammingParams)
    return world.params


def start_of(world: World) -> int:
    """The state of S."""
    start: int = world.state.tabular_task.start
    return start


def finite_way(world: World, steps: int) -> np.ndarray:
    """The cells visited with so many steps to go."""
    place = world.state.tabular_task.place
    assert isinstance(place, GridWorld)
    _, policies = finite_horizon(world.state.task, params_of(world).w_f)
    return nominal_path(place, policies[:steps])


@ARTICLE.verify("Little time left")
def test_with_little_time_one_gets_close_instead_of_around(setting: Setting) -> None:
    world = solved(setting)
    assert params_of(world).to_go == 9
    values, _ = finite_horizon(world.state.task, params_of(world).w_f)
    S = start_of(world)
    assert values[9, S] == pytest.approx(9 + 3.0 * 4.0)
    for steps in range(6, 11):
        assert tuple(finite_way(world, steps)[-1]) == (3, 6), "the bottom of the sack"
    assert tuple(finite_way(world, 11)[-1]) == (0, 8)
    assert tuple(finite_way(world, 15)[-1]) != (3, 10)
    np.testing.assert_allclose(values[16:, S], 16.0)
    assert tuple(finite_way(world, 16)[-1]) == (3, 10)
    # The walker goes where the policies lead, and takes as long.
    for _ in range(9 * 30 + 1):
        world.advance()
    assert tuple(world.state.follower.walk.at[0]) == (3, 6)
    np.testing.assert_array_equal(world.state.follower.walk.path[:, 0], finite_way(world, 9))
    assert world.state.follower.walk.cost[0] == 9.0


@ARTICLE.verify("What wandering costs")
def test_the_wanderer_has_the_published_values(setting: Setting) -> None:
    world = solved(setting)
    place = world.state.tabular_task.place
    assert isinstance(place, GridWorld)
    values = place.on_map(world.state.iterates.V[0])
    wanted = [[0, 14, 20, 22], [14, 18, 20, 20], [20, 20, 18, 14], [22, 20, 14, 0]]
    np.testing.assert_allclose(values, wanted, atol=1e-4)
    assert world.state.iterates.count[0] > 100
    assert world.state.iterates.count[3] == 4
    assert world.state.iterates.V[3].max() == 3.0


@ARTICLE.verify("A wave from the goal")
def test_values_spread_a_step_a_sweep(setting: Setting) -> None:
    world = World(find(SLUG), setting)
    S = start_of(world)
    true_at = 0
    while world.solving:
        world.iterate()
        if not true_at and world.state.iterates.V[3, S] == 16.0:
            true_at = int(world.state.iterates.count[3])
    assert true_at == 16
    errors = world.state.iterates.errors[:19, 3]
    np.testing.assert_allclose(errors, np.arange(18.0, -1.0, -1.0), atol=1e-12)
    assert world.state.iterates.count[3] == 19
    bound = world.lab.fields(world.params, world.state)["bound"]
    np.testing.assert_array_equal(bound, 18.0)


@ARTICLE.verify("Keep off the edge")
def test_who_may_slip_keeps_off_the_edge(setting: Setting) -> None:
    def rows(slip: float) -> tuple[int, set[int]]:
        """Steps of the way meant, and the rows it visits between its ends."""
        task = solved({**setting, "slip": slip}).state.tabular_task
        cells = nominal_path(task.place, task.solution[1])
        along = cells[(cells[:, 1] > 0) & (cells[:, 1] < 11)]
        return len(cells) - 1, set(along[:, 0].tolist())

    assert setting["slip"] == 0.05
    assert rows(0.0) == (13, {2})
    assert rows(0.05) == (15, {1})
    assert rows(0.2) == (17, {0})


def angles(world: World, seconds: float) -> np.ndarray:
    """From upright [rad], from now on."""
    begin = world.recorder.count
    for _ in range(round(seconds / world.lab.period)):
        world.advance()
    return np.asarray(np.abs(world.recording().channels["angle"][begin:]))


@ARTICLE.verify("Swing up by table")
def test_the_table_swings_the_pendulum_up(setting: Setting) -> None:
    world = solved(setting)
    off = angles(world, 30.0)
    assert 1.9 < 0.01 * np.flatnonzero(off < 0.2)[0] < 2.3
    assert 0.15 < off[400:].max() < 0.25
    turned = np.unwrap(world.recording().channels["angle"])
    assert turned[:200].max() - turned[0] > 0.3, "to one side"
    assert turned[:200].min() - turned[0] < -0.3, "and to the other"
    millions = world.state.iterates.backups[-1] / 1e6
    np.testing.assert_allclose(millions[1:], [7.4, 2.6, 7.2], atol=0.05)
    ten = solved({**setting, "m": 10}).state.iterates.backups[-1]
    assert ten[2] / 1e6 == pytest.approx(1.9, abs=0.05)


@ARTICLE.verify("Too short-sighted to swing")
def test_a_small_discount_leaves_it_hanging(setting: Setting) -> None:
    assert angles(solved(setting), 8.0).min() > 1.0
    assert angles(solved({**setting, "gamma": 0.8}), 8.0).min() < 0.01
    assert setting["gamma"] == 0.5
    counts = [solved({**setting, "gamma": g}).state.iterates.count[3] for g in (0.5, 0.98)]
    assert counts[0] < 0.2 * counts[1]


@ARTICLE.verify("Too coarse a table")
def test_a_coarse_table_does_not_see_that_it_hangs(setting: Setting) -> None:
    world = solved(setting)
    place = world.state.tabular_task.place
    assert isinstance(place, PendulumGrid)
    assert place.nodes[start_of(world), 0] % (2 * np.pi) == pytest.approx(0.15, abs=0.001)
    assert angles(world, 4.0).min() > 3.14
    assert (world.recording().channels["torque"] == 0.0).all()
    world.press("push")
    assert angles(world, 6.0).min() < 0.2

    def broken(nodes: float) -> float:
        """By how much more the first 8 s cost than promised."""
        world = solved({**setting, "nodes": nodes})
        angles(world, 8.0)
        channels = world.recording().channels
        return float(channels["promised"][-1] - channels["promised"][1])

    assert broken(21) == pytest.approx(29.6, abs=0.1)
    assert broken(51) == pytest.approx(3.4, abs=0.05)
    assert broken(101) == pytest.approx(0.13, abs=0.05)


@ARTICLE.verify("Six joints, ten values each")
def test_the_counter_reaches_the_number_of_the_notes(setting: Setting) -> None:
    world = solved(setting)
    measured = world.lab.measure(world.params, world.state)
    assert measured["states"] == 1e12
    assert measured["memory"] == pytest.approx(8000.0)
    assert 2**6 * measured["states"] == 64e12
    fields = world.lab.fields(world.params, world.state)
    np.testing.assert_allclose(fields["states"], 100.0 ** np.arange(1, 8))


def test_every_experiment_is_verified() -> None:
    ARTICLE.check_all_are_verified()


# Solving --------------------------------------------------------------------------------------


def test_four_iterations_from_one_seed_reach_their_limits() -> None:
    """From initial values that the seed draws, the same for all four."""
    one, other = (World(find(SLUG), {"spread": 20.0}, seed=seed) for seed in (1, 2))
    V = one.state.iterates.V
    assert np.ptp(V, axis=0).max() == 0.0
    assert 5.0 < V.std() < 7.0
    assert not np.array_equal(V, other.state.iterates.V)
    while one.solving:
        one.iterate()
    at, found = one.state.iterates, one.state.tabular_task
    np.testing.assert_allclose(at.V, found.limits, atol=1e-4)
    bound = one.lab.fields(one.params, one.state)
    assert (bound["error_value"] <= bound["bound"] + 1e-9).all()
    assert one.latest is not None
    assert one.latest.done.startswith("All four iterations have converged: the largest distance ")
    assert one.latest.progress == 1.0


def test_a_kept_snapshot_shows_its_sweep_again_and_nothing_is_written_into() -> None:
    world = World(find(SLUG), {"gamma": 0.9})
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
    world = World(find(SLUG))
    straight = solved({})
    for _ in range(7):
        world.iterate()
    again = World(find(SLUG))
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
        while world.solving:
            world.iterate()
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
    assert "From 1 states no way" in world.lab.notes(world.params, world.state)["about"]
    assert (solved({"map": sealed, "gamma": 1.0}).state.iterates.count > 0).all()
    swinging = solved({"world": "pendulum", "gamma": 1.0, "nodes": 31})
    assert (swinging.state.iterates.count > 0).tolist() == [False, False, True, True]


class BoardColors(NullScene):
    """Of the cells drawn."""

    colors: np.ndarray

    def cells(
        self,
        name: str,
        origin: ArrayLike,
        size: float,
        colors: np.ndarray,
        *,
        clickable: bool = True,
    ) -> None:
        self.colors = colors


@pytest.mark.parametrize("shown", ["evaluation", "policy", "modified", "value"])
def test_what_has_no_value_is_left_out(shown: str) -> None:
    world = solved({"map": "S.#G", "gamma": 1.0, "shown": shown})
    for _ in range(200):
        world.advance()
    measured = world.lab.measure(world.params, world.state)
    assert not {"at_start", "promised", "error", "angle", "torque"} & set(measured)
    assert np.isnan(world.recording().channels["at_start"]).all()
    fields = world.lab.fields(world.params, world.state)
    assert np.isnan(fields["V"]).all()
    for name in ("stationary", f"error_{shown}", f"backups_{shown}", "bound"):
        assert len(fields[name]) == 0, name
    scene = BoardColors()
    world.lab.draw(scene, world.params, world.state)
    assert (scene.colors[0, :2] == NO_VALUE).all()


def test_cells_without_a_state_have_no_value_and_all_others_do() -> None:
    world = solved({"map": "S.#\n..G"})
    fields = world.lab.fields(world.params, world.state)
    wall = [[False, False, False], [False, False, True]]
    np.testing.assert_array_equal(np.isnan(fields["V"]), wall)
    np.testing.assert_array_equal(np.isnan(fields["control"]), wall)
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
        f"the largest distance left is {rounded_up(error)}."
    )
    assert float(rounded_up(error)) >= error
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
        while world.solving:
            world.iterate()
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
        run(
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
