"""What the article on dynamic programming claims, in numbers."""

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.reinforcement_learning.dynamic_programming.iteration_comparison import ITERATION_METHODS
from labs.reinforcement_learning.dynamic_programming.tasks import finite_horizon
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.grid_world.walk import nominal_path
from labs.tasks.pendulum_table.table import PendulumGrid
from tests.labs.experiments import ArticleExperiments
from tests.labs.reinforcement_learning.dynamic_programming.worlds import (
    SLUG,
    Settings,
    params_of,
    solved,
)

ARTICLE = ArticleExperiments("labs.reinforcement_learning", "dynamic_programming")


def start_of(world: World) -> int:
    """The state of S."""
    start: int = world.state.tabular_task.start
    return start


def finite_horizon_path(world: World, steps: int) -> np.ndarray:
    """The cells visited with so many steps to go."""
    place = world.state.tabular_task.place
    assert isinstance(place, GridWorld)
    _, policies = finite_horizon(world.state.task, params_of(world).w_f)
    return nominal_path(place, policies[:steps])


@ARTICLE.verify("Little time left")
def test_with_little_time_one_gets_close_instead_of_around(setting: Settings) -> None:
    world = solved(setting)
    assert params_of(world).to_go == 9
    values, _ = finite_horizon(world.state.task, params_of(world).w_f)
    S = start_of(world)
    assert values[9, S] == pytest.approx(9 + 3.0 * 4.0)
    for steps in range(6, 11):
        assert tuple(finite_horizon_path(world, steps)[-1]) == (3, 6), "the bottom of the sack"
    assert tuple(finite_horizon_path(world, 11)[-1]) == (0, 8)
    assert tuple(finite_horizon_path(world, 15)[-1]) != (3, 10)
    np.testing.assert_allclose(values[16:, S], 16.0)
    assert tuple(finite_horizon_path(world, 16)[-1]) == (3, 10)
    # The walker goes where the policies lead, and takes as long.
    for _ in range(9 * 30 + 1):
        world.advance()
    assert tuple(world.state.follower.walk.at[0]) == (3, 6)
    np.testing.assert_array_equal(
        world.state.follower.walk.path[:, 0], finite_horizon_path(world, 9)
    )
    assert world.state.follower.walk.cost[0] == 9.0
    assert ARTICLE.answer("Little time left") == "Into the sack."


@ARTICLE.verify("What wandering costs")
def test_the_wanderer_has_the_published_values(setting: Settings) -> None:
    world = solved(setting)
    place = world.state.tabular_task.place
    assert isinstance(place, GridWorld)
    values = place.on_map(world.state.iterates.V[0])
    wanted = [[0, 14, 20, 22], [14, 18, 20, 20], [20, 20, 18, 14], [22, 20, 14, 0]]
    np.testing.assert_allclose(values, wanted, atol=1e-4)
    assert world.state.iterates.count[0] > 100
    assert world.state.iterates.count[3] == 4
    assert world.state.iterates.V[3].max() == 3.0
    assert values.max() == pytest.approx(ARTICLE.answer("What wandering costs"), abs=1e-4)


@ARTICLE.verify("A wave from the goal")
def test_values_spread_a_step_a_sweep(setting: Settings) -> None:
    world = World(find_lab(SLUG), setting)
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
    assert ARTICLE.answer("A wave from the goal") == true_at


@ARTICLE.verify("Keep off the edge")
def test_who_may_slip_keeps_off_the_edge(setting: Settings) -> None:
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
    assert ARTICLE.answer("Keep off the edge") == "No: two rows up."


def angles(world: World, seconds: float) -> np.ndarray:
    """From upright [rad], from now on."""
    begin = world.recorder.count
    for _ in range(round(seconds / world.lab.period)):
        world.advance()
    return np.asarray(np.abs(world.recording().channels["angle"][begin:]))


@ARTICLE.verify("The price of life")
def test_how_dear_life_is_decides_the_way(setting: Settings) -> None:
    def controls(living: float) -> tuple[int, float]:
        """In the bottom row beside its last cell; and V of the start."""
        world = solved({**setting, "living": living})
        place, at = world.state.tabular_task.place, world.state.iterates
        return int(at.policy[3][place.state((2, 2))]), float(at.V[3][place.start])

    up, right, left = 0, 1, 3
    way, value = controls(0.04)
    assert way == left
    assert value == pytest.approx(-0.705, abs=5e-4)
    assert controls(0.1)[0] == up
    world = solved({**setting, "living": 2.0})
    place, policy = world.state.tabular_task.place, world.state.iterates.policy[3]
    assert policy[place.state((1, 2))] == right, "into the -"
    assert ARTICLE.answer("The price of life") == "Left, all the way round."


@ARTICLE.verify("Where does a taxi wait?")
def test_a_taxi_waits_at_the_stand(setting: Settings) -> None:
    world = solved(setting)
    place, mdp = world.state.tabular_task.place, world.state.tabular_task.mdp
    np.testing.assert_allclose(-mdp.C[0], [8.0, 2.75, 4.25])
    assert -mdp.C[1, 1] == 15.0
    at = world.state.iterates
    np.testing.assert_allclose(-at.V[3], [121.65, 135.31, 122.84], atol=5e-3)
    doing = [place.table.control(x, u) for x, u in enumerate(at.policy[3])]
    assert doing == ["stand"] * 3
    short = solved({**setting, "gamma": 0.0}).state.iterates
    assert [place.table.control(x, u) for x, u in enumerate(short.policy[3])] == ["cruise"] * 3
    assert ARTICLE.answer("Where does a taxi wait?") == "Wait at the stand."


@ARTICLE.verify("Swing up by table")
def test_the_table_swings_the_pendulum_up(setting: Settings) -> None:
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
    assert list(ITERATION_METHODS.values())[1 + int(np.argmin(millions[1:]))] == ARTICLE.answer(
        "Swing up by table"
    )


@ARTICLE.verify("Too short-sighted to swing")
def test_a_small_discount_leaves_it_hanging(setting: Settings) -> None:
    assert angles(solved(setting), 8.0).min() > 1.0
    assert angles(solved({**setting, "gamma": 0.8}), 8.0).min() < 0.01
    assert setting["gamma"] == 0.5
    counts = [solved({**setting, "gamma": g}).state.iterates.count[3] for g in (0.5, 0.98)]
    assert counts[0] < 0.2 * counts[1]
    assert ARTICLE.answer("Too short-sighted to swing") == "Never."


@ARTICLE.verify("Too coarse a table")
def test_a_coarse_table_does_not_see_that_it_hangs(setting: Settings) -> None:
    world = solved(setting)
    place = world.state.tabular_task.place
    assert isinstance(place, PendulumGrid)
    assert place.nodes[start_of(world), 0] % (2 * np.pi) == pytest.approx(0.15, abs=0.001)
    assert angles(world, 4.0).min() > 3.14
    assert (world.recording().channels["torque"] == 0.0).all()
    world.press("push")
    assert angles(world, 6.0).min() < 0.2
    # Live, what half-made policies do while the table fills is over once it is full.
    world = World(find_lab(SLUG), setting)
    for _ in range(5):
        world.iterate()
        world.advance()
    while world.solving:
        world.press("push")
        world.advance()
        world.iterate()
    assert angles(world, 4.0)[-300:].min() > 3.14

    def broken(nodes: float) -> float:
        """By how much more the first 8 s cost than promised."""
        world = solved({**setting, "nodes": nodes})
        angles(world, 8.0)
        channels = world.recording().channels
        return float(channels["promised"][-1] - channels["promised"][1])

    assert broken(21) == pytest.approx(29.6, abs=0.1)
    assert broken(51) == pytest.approx(3.4, abs=0.05)
    assert broken(101) == pytest.approx(0.13, abs=0.05)
    assert ARTICLE.answer("Too coarse a table") == "It hangs still."


@ARTICLE.verify("Six joints, ten values each")
def test_the_counter_reaches_the_number_of_the_notes(setting: Settings) -> None:
    world = solved(setting)
    measured = world.lab.measure(world.params, world.state)
    assert measured["states"] == 1e12
    assert measured["memory"] == pytest.approx(8000.0)
    assert 2**6 * measured["states"] == 64e12
    fields = world.lab.fields(world.params, world.state)
    np.testing.assert_allclose(fields["states"], 100.0 ** np.arange(1, 8))


def test_every_experiment_is_verified() -> None:
    ARTICLE.check_all_are_verified()
