"""Grid worlds: a map of cells as a finite MDP (labs/problems/finite_mdp.py).

A map is written a row a line, the top row first:

    #  wall     .  free     S  start     G  goal     H  hole     C  cliff     +  -  ends, see below

and may end in a line of digits, one a column: the wind, in cells upwards for each step taken
from that column. Stepping off the edge or into a wall leads nowhere: the part of the step along
the row comes first, then the part along the column with the wind added, each a cell at a time.

A step costs `living`, 1 unless said otherwise, and what the cell costs that it leads to: nothing,
but for + (a reward of 1), - (a cost of 1), H (FALL_COST) and what the map says in lines below it,
see `map_parser.py`. G, H, + and - are ends. A fall off the cliff costs FALL_COST in all and leads
back to the start. With slip, the wanted control is replaced with that probability by one of all
controls, drawn evenly, or, `sideways`, by one of the two at right angles to it.

Named maps: the 4x4 world, the cliff and the windy world of Sutton and Barto (Reinforcement
Learning, 2nd edition, examples 4.1, 6.6 and 6.5), a room with walls, the 4 x 3 world of Russell
and Norvig (Artificial Intelligence, chapter on complex decisions), and the two of Gymnasium's
FrozenLake. States are the cells that are neither wall nor cliff, numbered along the rows.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from labs.errors import LabError
from labs.problems.finite_mdp import FiniteMDP
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.map_parser import CellKind, parse_map

CELL_KINDS: Mapping[str, str] = {
    "#": "wall",
    ".": "free",
    "S": "start",
    "G": "goal",
    "H": "hole",
    "C": "cliff",
    "+": "reward 1",
    "-": "cost 1",
}
TERMINAL_LETTERS = "GH+-"
MOVES = np.array([[-1, 0], [0, 1], [1, 0], [0, -1], [-1, 1], [1, 1], [1, -1], [-1, -1]])
"""(row, column) of each control: up, right, down, left; then the king's diagonals."""
STEP_COST, FALL_COST = 1.0, 100.0
"""Costs, unless said otherwise."""
CELL_COSTS: Mapping[str, float] = {"+": -1.0, "-": 1.0, "H": FALL_COST, "C": FALL_COST}
MAX_SIDE = 32
"""Rows and columns at most."""

MAPS: Mapping[str, str] = {
    "4x4": "G...\n....\n....\n...G",
    "cliff": "............\n............\n............\nSCCCCCCCCCCG",
    "windy": "..........\n..........\n..........\nS......G..\n..........\n..........\n..........\n"
    "0001112210",
    "room": "S....#......\n.....#......\n.....#......\n.....#..###.\n........#...\n"
    ".....#..#...\n.....#..#..G\n.....#..#...",
    "4x3": "...+\n.#.-\nS...",
    "frozen lake": "SFFF\nFHFH\nFFFH\nHFFG\nG = reward 1\nH = cost 0",
    "frozen lake 8x8": "SFFFFFFF\nFFFFFFFF\nFFFHFFFF\nFFFFFHFF\nFFFHFFFF\nFHHFFFHF\nFHFFHFHF\n"
    "FFFHFFFG\nG = reward 1\nH = cost 0",
}


@dataclass(frozen=True)
class GridWorld(CellWorld):
    """A map, and its states as cells."""

    rows: tuple[str, ...]
    """The characters of CELL_KINDS and of the legend, all rows of one length."""
    wind: tuple[int, ...]
    """For each column [cells]."""
    kings: bool = False
    """Whether the diagonals are controls too: 8 instead of 4."""
    legend: tuple[tuple[str, CellKind], ...] = ()
    """What the map says of letters."""
    notes: tuple[str, ...] = field(default=(), compare=False)
    """What was understood otherwise than written, in sentences."""

    @classmethod
    def parse(cls, text: str, kings: bool = False) -> "GridWorld":
        """The world of a map. Raises LabError, naming the row."""
        found = parse_map(text, CELL_KINDS, TERMINAL_LETTERS)
        rows = found.rows
        if not rows:
            raise LabError("a map has at least one row of cells")
        width = len(rows[0])
        wind = found.wind or (0,) * width
        for number, row in enumerate(rows, 1):
            if len(row) != width:
                raise LabError(
                    f"row {number} of the map, {row!r}, has {len(row)} cells and the first "
                    f"{width}: all rows are of one length"
                )
        if len(wind) != width:
            raise LabError(f"the wind has {len(wind)} digits: one for each of {width} columns goes")
        notes, legend = found.notes, tuple(found.legend.items())
        if "H" in "".join(rows) and "H" not in found.legend:
            notes += (
                f"A hole H ends an episode and costs {FALL_COST:g}; H = cost 0 below the map: 0.",
            )
        return cls(tuple(rows), wind, kings, legend, notes)._validate()

    def _validate(self) -> "GridWorld":
        cells = "".join(self.rows)
        if max(self.shape) > MAX_SIDE:
            raise LabError(
                f"a map of {self.shape} cells is too large: {MAX_SIDE} x {MAX_SIDE} at most"
            )
        if cells.count("S") > 1:
            raise LabError(f"the map has {cells.count('S')} starts S: one at most")
        if not any(map(self.is_terminal, cells)):
            raise LabError("the map has no goal G, nor another end: at least one goes")
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
        wind = ["".join(map(str, self.wind))] if any(self.wind) else []
        said = [_write_kind(sign, kind) for sign, kind in self.legend]
        return "\n".join([*self.rows, *wind, *said])

    def is_terminal(self, sign: str) -> bool:
        """Whether an episode ends in cells of this kind."""
        kind = dict(self.legend).get(sign)
        return kind.terminal if kind else sign in TERMINAL_LETTERS

    def cost(self, sign: str) -> float:
        """Of a step into a cell of this kind, beside that of any step; of a fall in all."""
        kind = dict(self.legend).get(sign)
        return kind.cost if kind else CELL_COSTS.get(sign, 0.0)

    def with_cell(self, row: int, column: int, kind: str) -> "GridWorld":
        """The world with one cell of another kind; a new start takes the place of the old one,
        and so does a new goal where there was only one. Raises LabError."""
        grid = [list(line) for line in self.rows]
        goals = sum(line.count("G") for line in grid)
        if kind == "S" or (kind == "G" and goals == 1):
            grid = [["." if cell == kind else cell for cell in line] for line in grid]
        grid[row][column] = kind
        return replace(self, rows=tuple("".join(line) for line in grid))._validate()

    @property
    def moves(self) -> np.ndarray:
        """(U, 2) int: (row, column) of each control."""
        return MOVES if self.kings else MOVES[:4]

    @cached_property
    def cells(self) -> np.ndarray:
        """(X, 2) int: (row, column) of each state."""
        return np.argwhere(~np.isin([list(row) for row in self.rows], list("#C")))

    @cached_property
    def terminal(self) -> np.ndarray:
        """(X,) bool: the ends."""
        return np.array(list(map(self.is_terminal, self.kinds)))

    @cached_property
    def goals(self) -> np.ndarray:
        """(X,) bool: the ends that cost least."""
        costs = np.array(list(map(self.cost, self.kinds)))
        costs -= [kind == "G" for kind in self.kinds]  # a goal before a hole
        least = costs[self.terminal].min()
        return np.asarray(self.terminal & (costs == least))

    @cached_property
    def start(self) -> int:
        """The state where an episode begins: S, or where there is none the first that is no end."""
        return self.kinds.index("S") if "S" in self.kinds else int(np.argmin(self.terminal))

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The character of each state's cell."""
        return tuple(self.rows[row][column] for row, column in self.cells)

    @cached_property
    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Without slip: successors (X, U) int32 and costs (X, U), that of a step being
        STEP_COST."""
        return self.nominal, self._costs(STEP_COST)

    @property
    def nominal(self) -> np.ndarray:
        """(X, U) int32: the next state without slip."""
        return self._nominal_steps[0]

    @cached_property
    def _nominal_steps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Without slip: successors (X, U) int32, the cost (X, U) of the cells they are in, and
        whether it is a fall (X, U)."""
        X, U = len(self.cells), len(self.moves)
        successor, cost = np.empty((X, U), np.int32), np.zeros((X, U))
        fall = np.zeros((X, U), bool)
        for x in range(X):
            if self.terminal[x]:
                successor[x] = x
                continue
            for u in range(U):
                row, column = self._next_cell(x, u)
                sign = self.rows[row][column]
                fall[x, u], cost[x, u] = sign == "C", self.cost(sign)
                successor[x, u] = self.start if sign == "C" else self.index[row, column]
        return successor, cost, fall

    def _costs(self, living: float) -> np.ndarray:
        """(X, U) without slip."""
        _, cost, fall = self._nominal_steps
        costs = np.where(fall, cost, living + cost)
        costs[self.terminal] = 0.0
        return costs

    def mdp(
        self, gamma: float, slip: float = 0.0, sideways: bool = False, living: float = STEP_COST
    ) -> FiniteMDP:
        """The world as an MDP; with slip in (0, 1] its dynamics are probabilities."""
        successor, cost = self.nominal, self._costs(living)
        U = cost.shape[1]
        if not slip:
            return FiniteMDP(cost, gamma, self.terminal, successor=successor)
        u = np.arange(U)
        others = np.tile(u, (U, 1))
        if sideways:
            around = u // 4 * 4  # the diagonals are at right angles to one another
            others = np.stack([around + (u + 1) % 4, around + (u + 3) % 4], axis=1)
        happens = np.hstack([u[:, None], others])
        p = np.full(happens.shape, slip / others.shape[1])
        p[:, 0] = 1.0 - slip
        outcomes = successor[:, happens].transpose(1, 0, 2)
        order = outcomes.argsort(axis=2, kind="stable")
        P = np.broadcast_to(p[:, None], outcomes.shape)
        P, outcomes = (np.take_along_axis(of, order, axis=2) for of in (P, outcomes))
        mixed = (cost[:, happens] * p).sum(axis=2)
        return FiniteMDP(mixed, gamma, self.terminal, P=P, outcomes=outcomes)

    def _next_cell(self, x: int, u: int) -> tuple[int, int]:
        """The cell where a step leads."""
        row, column = map(int, self.cells[x])
        down, right = map(int, self.moves[u])
        down -= self.wind[column]
        if self._is_free(row, column + right):
            column += right
        for _ in range(abs(down)):
            if not self._is_free(row + (1 if down > 0 else -1), column):
                break
            row += 1 if down > 0 else -1
        return row, column

    def _is_free(self, row: int, column: int) -> bool:
        rows, columns = self.shape
        return 0 <= row < rows and 0 <= column < columns and self.rows[row][column] != "#"


def _write_kind(sign: str, kind: CellKind) -> str:
    """The line of the legend that says so."""
    value = f"cost {kind.cost!r}" if kind.cost >= 0.0 else f"reward {-kind.cost!r}"
    end = ", end" if kind.terminal and sign not in TERMINAL_LETTERS else ""
    return f"{sign} = {value.removesuffix('.0')}{end}"


@lru_cache(maxsize=64)
def grid_world(text: str, kings: bool) -> GridWorld:
    """The same world for the same map, so that its tables are computed once. Raises LabError."""
    return GridWorld.parse(text, kings)
