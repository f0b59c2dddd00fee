"""Grid worlds: a map of cells as a finite MDP (labs/problems/finite_mdp.py).

A map is written a row a line, the top row first:

    #  wall     .  free     S  start     G  goal (terminal)     C  cliff

and may end in a line of digits, one a column: the wind, in cells upwards for each step taken
from that column. A step costs 1. Stepping off the edge or into a wall leads nowhere: the part of
the step along the row comes first, then the part along the column with the wind added, each a
cell at a time. A fall off the cliff costs FALL and leads back to the start. With `slip` > 0 the
wanted control is replaced with that probability by one of all controls, drawn evenly.

Named maps: the 4x4 world, the cliff and the windy world of Sutton and Barto (Reinforcement
Learning, 2nd edition, examples 4.1, 6.6 and 6.5), and a room with walls. States are the cells
that are neither wall nor cliff, numbered along the rows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP

KINDS: Mapping[str, str] = {"#": "wall", ".": "free", "S": "start", "G": "goal", "C": "cliff"}
MOVES = np.array([[-1, 0], [0, 1], [1, 0], [0, -1], [-1, 1], [1, 1], [1, -1], [-1, -1]])
"""(row, column) of each control: up, right, down, left; then the king's diagonals."""
STEP, FALL = 1.0, 100.0
"""Costs."""
SIDE = 16
"""Rows and columns at most."""

MAPS: Mapping[str, str] = {
    "4x4": "G...\n....\n....\n...G",
    "cliff": "............\n............\n............\nSCCCCCCCCCCG",
    "windy": "..........\n..........\n..........\nS......G..\n..........\n..........\n..........\n"
    "0001112210",
    "room": "S....#......\n.....#......\n.....#......\n.....#..###.\n........#...\n"
    ".....#..#...\n.....#..#..G\n.....#..#...",
}


@dataclass(frozen=True)
class GridWorld:
    """A map, and its states as cells."""

    rows: tuple[str, ...]
    """The characters of KINDS, all rows of one length."""
    wind: tuple[int, ...]
    """For each column [cells]."""
    kings: bool = False
    """Whether the diagonals are controls too: 8 instead of 4."""

    @classmethod
    def parse(cls, text: str, kings: bool = False) -> "GridWorld":
        """The world of a map. Raises LabError, naming the row."""
        rows = [line.strip() for line in text.strip().splitlines()]
        wind: tuple[int, ...] = ()
        if rows and rows[-1].isdecimal():
            wind = tuple(map(int, rows.pop()))
        if not rows:
            raise LabError("a map has at least one row of cells")
        width = len(rows[0])
        wind = wind or (0,) * width
        for number, row in enumerate(rows, 1):
            if len(row) != width:
                raise LabError(
                    f"row {number} of the map, {row!r}, has {len(row)} cells and the first "
                    f"{width}: all rows are of one length"
                )
            strange = sorted(set(row) - set(KINDS))
            if strange:
                known = ", ".join(f"{sign} {word}" for sign, word in KINDS.items())
                raise LabError(f"row {number} of the map has {strange[0]!r}: there are {known}")
        if len(wind) != width:
            raise LabError(f"the wind has {len(wind)} digits: one for each of {width} columns goes")
        return cls(tuple(rows), wind, kings)._checked()

    def _checked(self) -> "GridWorld":
        cells = "".join(self.rows)
        if max(self.shape) > SIDE:
            raise LabError(f"a map of {self.shape} cells is too large: {SIDE} x {SIDE} at most")
        if cells.count("S") > 1:
            raise LabError(f"the map has {cells.count('S')} starts S: one at most")
        if "G" not in cells:
            raise LabError("the map has no goal G: at least one goes")
        if "C" in cells and "S" not in cells:
            raise LabError("the map has a cliff C but no start S for whoever falls to return to")
        return self

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return len(self.rows), len(self.rows[0])

    @property
    def text(self) -> str:
        """The map as it is written."""
        lines = [*self.rows, "".join(map(str, self.wind))] if any(self.wind) else self.rows
        return "\n".join(lines)

    def with_cell(self, row: int, column: int, kind: str) -> "GridWorld":
        """The world with one cell of another kind; a new start takes the place of the old one,
        and so does a new goal where there was only one. Raises LabError."""
        grid = [list(line) for line in self.rows]
        goals = sum(line.count("G") for line in grid)
        if kind == "S" or (kind == "G" and goals == 1):
            grid = [["." if cell == kind else cell for cell in line] for line in grid]
        grid[row][column] = kind
        return replace(self, rows=tuple("".join(line) for line in grid))._checked()

    @property
    def moves(self) -> np.ndarray:
        """(U, 2) int: (row, column) of each control."""
        return MOVES if self.kings else MOVES[:4]

    @cached_property
    def cells(self) -> np.ndarray:
        """(X, 2) int: (row, column) of each state."""
        return np.argwhere(np.isin([list(row) for row in self.rows], list(".SG")))

    @cached_property
    def index(self) -> np.ndarray:
        """(rows, columns) int: the state of each cell, -1 for walls and the cliff."""
        index = np.full(self.shape, -1)
        index[tuple(self.cells.T)] = np.arange(len(self.cells))
        return index

    def state(self, cell: Sequence[int] | np.ndarray) -> int:
        """The state of a cell (row, column), on the map or beside it; -1 where there is none."""
        row, column = map(int, cell)
        rows, columns = self.shape
        inside = 0 <= row < rows and 0 <= column < columns
        return int(self.index[row, column]) if inside else -1

    @cached_property
    def terminal(self) -> np.ndarray:
        """(X,) bool: the goals."""
        return np.array([self.kind(x) == "G" for x in range(len(self.cells))])

    @cached_property
    def start(self) -> int:
        """The state where an episode begins: S, or where there is none the first that is not a
        goal."""
        kinds = [self.kind(state) for state in range(len(self.cells))]
        return kinds.index("S") if "S" in kinds else kinds.index(".") if "." in kinds else 0

    def kind(self, state: int) -> str:
        """The character of a state's cell."""
        row, column = map(int, self.cells[state])
        return self.rows[row][column]

    def on_map(self, values: np.ndarray, fill: float = 0.0) -> np.ndarray:
        """(rows, columns): `values` (X,) of the states, laid out; `fill` elsewhere."""
        laid = np.full(self.shape, fill)
        laid[tuple(self.cells.T)] = values
        return laid

    @cached_property
    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Without slip: successors (X, U) int32 and costs (X, U)."""
        X, U = len(self.cells), len(self.moves)
        successor, cost = np.empty((X, U), np.int32), np.full((X, U), STEP)
        for x in range(X):
            for u in range(U):
                row, column = self._land(x, u)
                if self.rows[row][column] == "C":
                    successor[x, u], cost[x, u] = self.start, FALL
                else:
                    successor[x, u] = self.index[row, column]
            if self.kind(x) == "G":
                successor[x], cost[x] = x, 0.0
        return successor, cost

    def mdp(self, gamma: float, slip: float = 0.0) -> FiniteMDP:
        """The world as an MDP; with slip in (0, 1] its dynamics are probabilities."""
        successor, cost = self.table
        X, U = cost.shape
        if not slip:
            return FiniteMDP(cost, gamma, self.terminal, successor=successor)
        P = np.zeros((U, X, X))
        for u in range(U):
            np.add.at(P[u], (np.arange(X), successor[:, u]), 1.0 - slip)
            for other in range(U):
                np.add.at(P[u], (np.arange(X), successor[:, other]), slip / U)
        mixed = (1.0 - slip) * cost + slip * cost.mean(axis=1, keepdims=True)
        return FiniteMDP(mixed, gamma, self.terminal, P=P)

    def _land(self, x: int, u: int) -> tuple[int, int]:
        """The cell where a step ends."""
        row, column = map(int, self.cells[x])
        down, right = map(int, self.moves[u])
        down -= self.wind[column]
        if self._open(row, column + right):
            column += right
        for _ in range(abs(down)):
            if not self._open(row + (1 if down > 0 else -1), column):
                break
            row += 1 if down > 0 else -1
        return row, column

    def _open(self, row: int, column: int) -> bool:
        rows, columns = self.shape
        return 0 <= row < rows and 0 <= column < columns and self.rows[row][column] != "#"


@lru_cache(maxsize=64)
def grid_world(text: str, kings: bool) -> GridWorld:
    """The same world for the same map, so that its tables are computed once. Raises LabError."""
    return GridWorld.parse(text, kings)
