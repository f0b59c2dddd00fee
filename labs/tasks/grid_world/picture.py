"""Drawing grid worlds: a board to click on, coloured by cost-to-go, with walls, goals, the cliff
and the wind, a policy as arrows, the ways it leads and who walks them; and a relief of the values.

Dark is cheap and pale is dear, as in a heat map of the page; what has no value is grey.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from labs.colors import NO_VALUE, sequential
from labs.scene import Color, Scene, cell_at, cell_centers
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.grid_world.walk import GridWalk

BOARD = "board"
"""The handle that a click on the board holds."""
WALL, CLIFF, GOAL = (0.36, 0.38, 0.42), (0.55, 0.12, 0.12), (0.20, 0.66, 0.33)
HOLE = (0.78, 0.36, 0.30)
MAX_RAISED_WALL_STATES = 200
"""States from which on walls no longer stand out of the relief."""
MAX_LABELLED_STATES = 80
"""States at most of which all that are not free have their letters on them."""
WALKER_COLORS: tuple[Color, ...] = ("actual", "reference")
"""Of the first and the second of those side by side."""
HEIGHT = 0.55
"""[m] of the relief at the largest value."""
CAMERA = ((0.0, -1.0, 1.25), (0.0, 0.0, 0.0))
"""From where one looks: steep enough to read the arrows, flat enough to see the relief."""
LIFT = np.array([0.0, 0.0, 0.012])
"""[m] Lines and arrows float this far above what they belong to."""


@dataclass(frozen=True)
class Board:
    """Where the cells of a map lie in the scene."""

    rows: int
    columns: int
    largest_cell: float = CellWorld.largest_cell
    """[m]"""

    @property
    def size(self) -> float:
        """[m] Side of a cell."""
        return min(self.largest_cell, 2.1 / self.columns, 1.1 / self.rows)

    @property
    def origin(self) -> tuple[float, float, float]:
        """[m] The corner of least x and y."""
        return (-self.size * self.columns / 2, -self.size * self.rows - 0.05, 0.02)

    @cached_property
    def centers(self) -> np.ndarray:
        """(rows, columns, 3) [m]."""
        return cell_centers(self.origin, self.size, self.rows, self.columns)

    @cached_property
    def around(self) -> np.ndarray:
        """(rows + 2, columns + 2, 3) [m]: with a ring of cells more, where the wind is written."""
        corner = np.array(self.origin) - (self.size, self.size, 0.0)
        return cell_centers(corner, self.size, self.rows + 2, self.columns + 2)

    @cached_property
    def relief(self) -> np.ndarray:
        """(rows, columns, 3) [m]: the places of the cells on the floor of the relief, beside."""
        places: np.ndarray = self.centers + np.array([self.size * self.columns + 0.25, 0.0, 0.0])
        return places

    def cell_at(self, point: tuple[float, float, float]) -> tuple[int, int] | None:
        """The (row, column) of the cell at a point [m]; None beside the board."""
        return cell_at(point, self.origin, self.size, self.rows, self.columns)


@lru_cache(maxsize=16)
def board(world: CellWorld) -> Board:
    """Of a world's map."""
    return Board(*world.shape, world.largest_cell)


def value_span(V: np.ndarray) -> tuple[float, float]:
    """From where to where values (X,) are coloured: what is finite of them, and 0."""
    there = V[np.isfinite(V)]
    low, high = float(there.min(initial=0.0)), float(there.max(initial=0.0))
    return low, high if high > low else low + 1.0


def draw_board(
    scene: Scene,
    world: GridWorld,
    V: np.ndarray,
    high: float,
    policy: np.ndarray | None,
    *,
    low: float = 0.0,
    known: np.ndarray | None = None,
    relief: bool = False,
) -> None:
    """Values V (X,), which may be NaN, coloured from `low` to `high` > low; a policy, (X,) controls
    or (X, U) probabilities, if any; of the states in `known` (X,) bool only, if given. With
    `relief` the values stand beside the board as a surface, too, `high` HEIGHT tall."""
    place = board(world)
    heights = _heights(world, V, low, high)
    relief = relief and min(world.shape) >= 2
    scene.camera(*CAMERA, core=place.around)
    scene.cells(BOARD, place.origin, place.size, _colors(world, V, heights, goals=True))
    named = "SG+-" if len(world.cells) > MAX_LABELLED_STATES else set("".join(world.rows)) - {"."}
    for x, kind in enumerate(world.kinds):
        if kind in named:
            corner = place.centers[tuple(world.cells[x])] + place.size * np.array([-0.3, 0.3, 0.1])
            scene.label(f"cell {x}", kind, corner)
    for column, wind in enumerate(world.wind):
        if wind:
            below = place.centers[-1, column] - (0.0, 0.8 * place.size, 0.0)
            scene.label(f"wind {column + 1}", "↑" * wind if wind < 4 else f"{wind}↑", below)
    shown = ~world.terminal if known is None else known & ~world.terminal
    _draw_policy(scene, "policy", world, policy, shown, place.centers, place.size)
    if relief:
        points = place.relief + heights[..., None] * np.array([0.0, 0.0, 1.0])
        scene.surface("relief", points, _colors(world, V, heights, goals=False))
        _draw_policy(scene, "policy on the relief", world, policy, shown, points, place.size)
        scene.label("values", "cost-to-go V", points[0, world.shape[1] // 2] + [0.0, 0.0, 0.12])


def draw_path(
    scene: Scene, world: CellWorld, cells: np.ndarray, which: int, name: str = "way"
) -> None:
    """The way through cells (k, 2), in the colour of the walker number `which`, a little beside
    those of the others."""
    if len(cells) >= 2:
        place = board(world)
        beside = place.size * np.array([0.1 * (which - 0.5), 0.1 * (which - 0.5), 0.15])
        points = place.centers[tuple(cells.T)] + beside
        scene.trail(f"{name} {which + 1}", points, WALKER_COLORS[which])


def draw_walkers(scene: Scene, world: CellWorld, walk: GridWalk) -> None:
    """Everybody on the way from one cell to the next; a cell that is no longer on the map is drawn
    at its edge."""
    place, part = board(world), walk.clock / walk.move
    last = np.array(world.shape) - 1
    begin, end = (place.centers[tuple(np.minimum(at, last).T)] for at in (walk.at, walk.to))
    for m, center in enumerate((1.0 - part) * begin + part * end):
        beside = place.size * np.array([0.15 * m, 0.15 * m, 0.3])
        scene.sphere(
            f"walker {m + 1}", center + beside, min(0.24 * place.size, 0.06), WALKER_COLORS[m]
        )


def _heights(world: GridWorld, V: np.ndarray, low: float, high: float) -> np.ndarray:
    """(rows, columns) [m] in proportion to the values; flat where there are none. Walls stand out,
    but on a map of many cells, where they would hide all else: there they are as high as what is
    around them. A cliff is a hole."""
    part = np.where(np.isfinite(V), V - low, 0.0) / (high - low)
    heights = world.on_map(np.clip(part, -0.2, 1.3) * HEIGHT)
    walls = _cells_of_kind(world, "#")
    if len(world.cells) <= MAX_RAISED_WALL_STATES:
        return np.where(walls, HEIGHT, heights)
    around = sliding_window_view(np.pad(np.where(walls, np.nan, heights), 1, mode="edge"), (3, 3))
    counted = np.maximum(np.isfinite(around).sum(axis=(2, 3)), 1)
    return np.where(walls, np.nansum(around, axis=(2, 3)) / counted, heights)


def _colors(world: GridWorld, V: np.ndarray, heights: np.ndarray, *, goals: bool) -> np.ndarray:
    """(rows, columns, 3): by value; walls, the cliff and, if `goals`, those have their own."""
    colors = sequential(heights, 0.0, HEIGHT)
    colors[tuple(world.cells[~np.isfinite(V)].T)] = NO_VALUE
    for sign, color in {"#": WALL, "C": CLIFF}.items():
        colors[_cells_of_kind(world, sign)] = color
    if goals:
        colors[tuple(world.cells[world.terminal].T)] = HOLE
        colors[tuple(world.cells[world.goals].T)] = GOAL
    return colors


def _cells_of_kind(world: GridWorld, sign: str) -> np.ndarray:
    """(rows, columns) bool: the cells of this kind."""
    return np.asarray(np.array([list(row) for row in world.rows]) == sign)


def _draw_policy(
    scene: Scene,
    name: str,
    world: GridWorld,
    policy: np.ndarray | None,
    shown: np.ndarray,
    places: np.ndarray,
    size: float,
) -> None:
    """An arrow in each cell `shown` (X,), or one for each control of a random policy; `places`
    (rows, columns, 3) [m]."""
    if policy is None:
        return
    if policy.ndim == 1:
        states = np.flatnonzero(shown)
        controls = policy[states]
        back, ahead = -0.28, 0.28
    else:
        states, controls = np.nonzero((policy > 0.0) & shown[:, None])
        back, ahead = 0.05, 0.3
    down, right = world.moves[controls].T
    along = size * np.stack([right, -down, 0 * right], axis=1)
    along = along / np.maximum(np.hypot(down, right), 1.0)[:, None]
    middles = places[tuple(world.cells[states].T)] + LIFT
    scene.arrows(name, middles + back * along, middles + ahead * along, "force")
