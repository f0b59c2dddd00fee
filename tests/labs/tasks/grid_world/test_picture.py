"""Grid worlds as they are drawn: colours, arrows, and a board that is where one clicks on it."""

import numpy as np
import pytest

from labs.colors import NO_VALUE
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.grid_world.picture import (
    CLIFF,
    GOAL,
    HEIGHT,
    WALL,
    board,
    draw_board,
    draw_path,
    draw_walkers,
)
from labs.tasks.grid_world.walk import start_walk
from tests.labs.tasks.recording_scene import RecordingScene, all_finite

WORLD = GridWorld.parse("S.#\n.CG")


@pytest.mark.parametrize("relief", [False, True])
def test_what_has_no_value_is_grey_and_what_is_no_state_has_a_colour_of_its_own(
    relief: bool,
) -> None:
    scene = RecordingScene()
    V = np.array([1.0, np.nan, np.inf, 0.0])
    draw_board(scene, WORLD, V, 1.0, None, relief=relief)
    colors = scene.colors["board"]
    np.testing.assert_array_equal(colors[0, 1], NO_VALUE)
    np.testing.assert_array_equal(colors[1, 0], NO_VALUE)
    for cell, color in (((0, 2), WALL), ((1, 1), CLIFF), ((1, 2), GOAL)):
        np.testing.assert_array_equal(colors[cell], color)
    assert all_finite(scene)
    assert ("relief" in scene.names) == relief
    assert {"cell 0": "S", "cell 3": "G"}.items() <= scene.labels.items()


def test_the_relief_is_as_tall_as_the_values() -> None:
    scene = RecordingScene()
    draw_board(scene, WORLD, np.array([2.0, 1.0, 0.0, 0.0]), 2.0, None, relief=True)
    heights = scene.points["relief"][..., 2] - board(WORLD).relief[..., 2]
    np.testing.assert_allclose(heights, [[HEIGHT, HEIGHT / 2, HEIGHT], [0.0, 0.0, 0.0]])


def test_walls_of_a_large_map_are_as_high_as_what_is_around_them() -> None:
    rows = ["." * 20] * 14 + ["." * 10 + "#" * 3 + "." * 7, "S" + "." * 18 + "G"]
    world, scene = GridWorld.parse("\n".join(rows)), RecordingScene()
    draw_board(scene, world, np.full(len(world.cells), 1.0), 2.0, None, relief=True)
    heights = scene.points["relief"][..., 2] - board(world).relief[..., 2]
    np.testing.assert_allclose(heights, HEIGHT / 2)


def test_arrows_point_where_the_policy_leads_in_the_states_that_are_known() -> None:
    scene, known = RecordingScene(), np.array([True, False, True, True])
    draw_board(scene, WORLD, np.zeros(4), 1.0, np.array([1, 1, 0, 0]), known=known)
    starts, ends = scene.points["policy"]
    ways = (ends - starts) / board(WORLD).size
    np.testing.assert_allclose(ways, [[0.56, 0.0, 0.0], [0.0, 0.56, 0.0]], atol=1e-12)
    middles = board(WORLD).centers[[0, 1], [0, 0]]
    np.testing.assert_allclose((0.5 * (starts + ends))[:, :2], middles[:, :2])


def test_a_random_policy_has_an_arrow_for_each_control() -> None:
    scene = RecordingScene()
    draw_board(scene, WORLD, np.zeros(4), 1.0, np.tile([0.5, 0.5, 0.0, 0.0], (4, 1)))
    assert scene.points["policy"].shape == (2, 6, 3)


@pytest.mark.parametrize("text", [*MAPS.values(), "S" + 15 * "." + 15 * ("\n" + 16 * "G"), "SG"])
def test_a_click_in_the_middle_of_a_cell_is_that_cell(text: str) -> None:
    place = board(GridWorld.parse(text))
    for cell in np.ndindex(place.rows, place.columns):
        x, y, z = map(float, place.centers[cell])
        assert place.cell_at((x, y, z)) == cell
    assert place.cell_at((place.origin[0] - 0.01, place.origin[1], 0.0)) is None


def test_the_wind_is_written_below_its_columns() -> None:
    scene, windy = RecordingScene(), GridWorld.parse(MAPS["windy"])
    draw_board(scene, windy, np.zeros(len(windy.cells)), 1.0, None)
    assert [scene.labels.get(f"wind {c + 1}", "") for c in range(10)] == [
        "↑" * wind for wind in windy.wind
    ]


def test_walkers_are_drawn_between_their_cells_and_ways_through_them() -> None:
    scene, walk = RecordingScene(), start_walk(WORLD, 4, 2)
    draw_walkers(scene, WORLD, walk)
    assert {"walker 1", "walker 2"} <= set(scene.names)
    far = start_walk(GridWorld.parse(MAPS["cliff"]), 4)
    draw_walkers(scene, WORLD, far)
    draw_path(scene, WORLD, np.array([[0, 0], [0, 1]]), 1)
    draw_path(scene, WORLD, np.array([[0, 0]]), 0)
    assert ("way 2" in scene.names, "way 1" in scene.names) == (True, False)
    assert all_finite(scene)
