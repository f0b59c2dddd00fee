"""A board whose cells are clicked, a surface and arrows over it: tables in the scene."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from pydantic import field_validator

from labs.colors import sequential
from labs.lab import Handle, Inputs, Lab, Measurement, State
from labs.params import Group, Params, Value
from labs.plots import Line, TimeSeries
from labs.scene import Scene, cell_at, cell_centers
from labs.tunables import MAX_TEXT_LENGTH

SIZE = 0.1
"""[m] The side of a cell."""
WALL = (0.35, 0.37, 0.41)


KNOBS = Group()


class BoardParams(Params):
    map: str = KNOBS.text(
        "........\n........\n..###...\n....#...\n........\n........",
        "Map",
        rows=6,
        max_length=MAX_TEXT_LENGTH,
    )
    """Rows of free cells (.) and walls (#)."""
    rate: float = KNOBS.knob(1.0, 0.0, 5.0, r"\omega", "rad/s")
    """How fast it waves."""

    @field_validator("map")
    @classmethod
    def _is_a_map(cls, value: str) -> str:
        rows = value.split("\n")
        if len(rows) < 2 or len({len(row) for row in rows}) > 1 or len(rows[0]) < 2:
            raise ValueError("give at least two rows of at least two cells, all of one length")
        if set(value) - set(".#\n"):
            raise ValueError("a cell is . or #")
        return value


@dataclass
class BoardState(State):
    held: int = 0
    """Steps that saw the board held: none, since a click changes the map instead."""


class Board(Lab[BoardParams, BoardState]):
    title = "Board"
    section = "T.3"
    summary = "A board to click, and a wave over it."
    Params = BoardParams
    plots = (TimeSeries("Walls", "", Line("walls", "n"), Line("held", "h")),)
    handles = (Handle("board", "A click makes a wall, or takes it away."),)

    def init(self, params: BoardParams, rng: np.random.Generator) -> BoardState:
        return BoardState()

    def step(self, params: BoardParams, inputs: Inputs, state: BoardState) -> BoardState:
        return replace(state, t=state.t + self.period, held=state.held + len(inputs.handles))

    def edit(
        self, params: BoardParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        rows = params.map.split("\n")
        cell = cell_at(point, _origin(rows), SIZE, len(rows), len(rows[0]))
        if handle != "board" or cell is None:
            return {}
        row, column = cell
        other = "." if rows[row][column] == "#" else "#"
        rows[row] = rows[row][:column] + other + rows[row][column + 1 :]
        return {"map": "\n".join(rows)}

    def measure(self, params: BoardParams, state: BoardState) -> Measurement:
        return {"walls": float(params.map.count("#")), "held": float(state.held)}

    def draw(self, scene: Scene, params: BoardParams, state: BoardState) -> None:
        rows = params.map.split("\n")
        walls = np.array([[cell == "#" for cell in row] for row in rows])
        centers = cell_centers(_origin(rows), SIZE, *walls.shape)
        x, y = centers[..., 0], centers[..., 1]
        phase = params.rate * state.t
        heights = np.sin(4.0 * x + phase) * np.cos(4.0 * y)
        slopes = np.stack([np.cos(4.0 * x + phase), -np.sin(4.0 * y), 0.0 * x], axis=-1)
        scene.camera((0.05, -1.0, 1.0), (0.05, 0.05, 0.02))
        colors = sequential(heights, -1.0, 1.0)
        scene.surface("wave", centers + 0.1 * np.stack([0 * x, 0 * x, 4 + heights], -1), colors)
        scene.cells("board", _origin(rows), SIZE, np.where(walls[..., None], WALL, colors))
        free = centers[~walls] + (0.0, 0.0, 0.02)
        scene.arrows("slopes", free, free + 0.04 * slopes[~walls], "muted")


def _origin(rows: list[str]) -> tuple[float, float, float]:
    """The middle of the board stands over the middle of the floor."""
    return (-0.5 * SIZE * len(rows[0]), -0.5 * SIZE * len(rows), 0.02)
