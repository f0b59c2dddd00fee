"""Tunables that the labs on grid worlds have in common: a map to type and to click on."""

from collections.abc import Mapping
from typing import Annotated

from labs.errors import LabError, ParameterError
from labs.params import Value, validated_by
from labs.tasks.grid_world.map import MAPS, grid_world
from labs.tasks.grid_world.picture import BOARD, board

MAP_LENGTH = 8000
"""Characters: 32 rows of 32 cells in quotes, and some lines of costs."""
BOOK_WORLDS: Mapping[str, Mapping[str, Value]] = {
    "4 x 3 world": {
        "map": MAPS["4x3"], "gamma": 1.0, "slip": 0.2, "sideways": True, "living": 0.04,
    },
    "FrozenLake": {
        "map": MAPS["frozen lake"], "gamma": 0.99, "slip": 2 / 3, "sideways": True, "living": 0.0,
    },
    "FrozenLake 8 x 8": {
        "map": MAPS["frozen lake 8x8"], "gamma": 0.99, "slip": 2 / 3, "sideways": True,
        "living": 0.0,
    },
}  # fmt: skip
"""The worlds of many books and courses, for labs whose params have these names."""
MapText = Annotated[str, validated_by(lambda text: grid_world(text, False))]
"""The type of a field of Params that holds a map; what is none is refused in a sentence."""


def edit_map(
    text: str, brush: str, handle: str, point: tuple[float, float, float]
) -> Mapping[str, Value]:
    """The field `map`, so far `text`, once the board is clicked at `point` [m]: the cell there is
    of the kind `brush`, or free where it was a wall, a hole or a cliff already. Empty where no cell
    was clicked. Raises ParameterError."""
    world = grid_world(text, False)
    cell = board(world).cell_at(point)
    if handle != BOARD or cell is None:
        return {}
    row, column = cell
    again = brush in "#CH" and world.rows[row][column] == brush
    try:
        return {"map": world.with_cell(row, column, "." if again else brush).text}
    except LabError as error:
        raise ParameterError(str(error)) from None
