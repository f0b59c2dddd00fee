"""Worlds whose states are cells of a board: what a walk over them needs (walk.py)."""

import abc
from collections.abc import Sequence
from functools import cached_property
from typing import ClassVar

import numpy as np


class CellWorld(abc.ABC):
    """States on a board, each in a cell (row, column), row 0 on top."""

    largest_cell: ClassVar[float] = 0.24
    """[m] Side of a cell in the scene, at most."""

    @property
    @abc.abstractmethod
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""

    @property
    @abc.abstractmethod
    def cells(self) -> np.ndarray:
        """(X, 2) int: (row, column) of each state."""

    @property
    @abc.abstractmethod
    def start(self) -> int:
        """The state where an episode begins."""

    @property
    @abc.abstractmethod
    def terminal(self) -> np.ndarray:
        """(X,) bool: where it ends."""

    @property
    @abc.abstractmethod
    def nominal(self) -> np.ndarray:
        """(X, U) int32: the next state, were nothing left to chance."""

    @property
    @abc.abstractmethod
    def notes(self) -> tuple[str, ...]:
        """What was understood otherwise than written, in sentences."""

    @cached_property
    def index(self) -> np.ndarray:
        """(rows, columns) int: the state of each cell, -1 where there is none."""
        index = np.full(self.shape, -1)
        index[tuple(self.cells.T)] = np.arange(len(self.cells))
        return index

    def state(self, cell: Sequence[int] | np.ndarray) -> int:
        """The state of a cell (row, column), on the board or beside it; -1 where there is none."""
        row, column = map(int, cell)
        rows, columns = self.shape
        inside = 0 <= row < rows and 0 <= column < columns
        return int(self.index[row, column]) if inside else -1

    def on_map(self, values: np.ndarray, fill: float = 0.0) -> np.ndarray:
        """(rows, columns): `values` (X,) of the states, laid out; `fill` elsewhere."""
        laid = np.full(self.shape, fill)
        laid[tuple(self.cells.T)] = values
        return laid
