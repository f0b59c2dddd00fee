"""A map that is typed and clicked on."""

import pytest

from labs.errors import ParameterError
from labs.params import Group, Params
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.grid_world.params import MapText, edit_map
from labs.tasks.grid_world.picture import board

WORLD = GridWorld.parse("S.#\n.CG")


class MapParams(Params):
    """With a map."""

    map: MapText = Group("World").text("SG", "Map")
    """Of the world."""


def click(row: int, column: int, brush: str, world: GridWorld = WORLD) -> object:
    """The map after a click in the middle of a cell."""
    x, y, z = map(float, board(world).centers[row, column])
    return edit_map(world.text, brush, "board", (x, y, z))["map"]


def test_a_map_that_is_none_is_refused_in_a_sentence() -> None:
    with pytest.raises(ParameterError, match="the map has no goal G"):
        MapParams().change({"map": "S.."})
    with pytest.raises(ParameterError, match="row 2 of the map"):
        MapParams().change({"map": "S..\n.?.\n..G"})
    assert MapParams().change({"map": "..G"}).map == "..G"


def test_a_click_makes_what_the_brush_says() -> None:
    assert click(0, 1, "#") == "S##\n.CG"
    assert click(0, 1, "G") == "SG#\n.C."
    assert click(1, 0, "S") == "..#\nSCG"
    assert click(0, 2, ".") == "S..\n.CG"


def test_a_wall_or_a_cliff_clicked_once_more_is_free() -> None:
    assert click(0, 2, "#") == "S..\n.CG"
    assert click(1, 1, "C") == "S.#\n..G"
    assert click(1, 1, "#") == "S.#\n.#G", "only with its own brush"


def test_other_clicks_change_nothing_or_say_why() -> None:
    assert edit_map(WORLD.text, "#", "board", (9.0, 9.0, 0.0)) == {}
    x, y, z = map(float, board(WORLD).centers[0, 0])
    assert edit_map(WORLD.text, "#", "token", (x, y, z)) == {}
    with pytest.raises(ParameterError, match="no goal"):
        click(1, 2, "#")
