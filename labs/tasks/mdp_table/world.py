"""The states of a table as the cells of a board, so that one can walk over them."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import ceil, sqrt
from typing import ClassVar

import numpy as np

from labs.problems.finite_mdp import FiniteMDP
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.mdp_table.table import MdpTable, parse_table

NO_NAMES_NOTE = "Here states have no names."
"""In place of words about each state of a table."""


@dataclass(frozen=True, eq=False)
class TableWorld(CellWorld):
    """Row by row, in the order of the table; an episode starts in its first state."""

    largest_cell: ClassVar[float] = 0.5

    table: MdpTable

    @property
    def shape(self) -> tuple[int, int]:
        many = len(self.table.states)
        columns = many if many <= 4 else ceil(sqrt(1.6 * many))
        return ceil(many / columns), columns

    @cached_property
    def cells(self) -> np.ndarray:
        rows, columns = np.divmod(np.arange(len(self.table.states)), self.shape[1])
        return np.stack([rows, columns], axis=1)

    @property
    def start(self) -> int:
        return 0

    @cached_property
    def terminal(self) -> np.ndarray:
        return self.table.terminal

    @cached_property
    def nominal(self) -> np.ndarray:
        """(X, U) int32: the most probable next state, one that is elsewhere among equals."""
        elsewhere = self.table.P.copy()
        elsewhere[:, np.arange(len(self.cells)), np.arange(len(self.cells))] -= 1e-9
        return np.asarray(elsewhere.argmax(axis=2).T, np.int32)

    @property
    def notes(self) -> tuple[str, ...]:
        return self.table.notes

    def mdp(self, gamma: float) -> FiniteMDP:
        """The table as an MDP."""
        return self.table.mdp(gamma)

    def results(self, V: np.ndarray, control: np.ndarray) -> dict[str, np.ndarray]:
        """For a solution: V and controls (..., X), -1 where all are alike, with the names of the
        states (X,) and of what the controls count (U,)."""
        own = self.table.control_index[np.arange(len(self.cells)), np.maximum(control, 0)]
        return {
            "V": V,
            "greedy_control": np.where(control < 0, control, own),
            "state_names": np.array(self.table.states),
            "control_names": np.array(self.table.controls),
        }

    def describe(self, V: np.ndarray, policy: np.ndarray | None) -> str:
        """V (X,) and the control of a policy (X,), if any, in words: a line a state."""
        lines = []
        for x, name in enumerate(self.table.states):
            if self.terminal[x]:
                does = ": the end"
            elif policy is None or not self.table.controls[0]:
                does = ""
            else:
                does = f": {self.table.control(x, int(policy[x]))}"
            value = f"{V[x]:.6g}".replace("-", "−")
            known = np.isfinite(V[x])
            lines.append(f"{name}{does}, V = {value}" if known else f"{name}: no finite V")
        return "\n".join(lines)


def state_values(place: object, V: np.ndarray) -> np.ndarray:
    """V (X,) of a table's states, NaN where there is none; empty elsewhere."""
    none = np.zeros(0)
    return np.where(np.isfinite(V), V, np.nan) if isinstance(place, TableWorld) else none


@lru_cache(maxsize=16)
def table_world(text: str) -> TableWorld:
    """The same world for the same table. Raises LabError."""
    return TableWorld(parse_table(text))
