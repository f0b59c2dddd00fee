"""What is kept of the optimiser's iterations, to be plotted and drawn."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

KEPT_CURVES, CURVE_POINTS = 8, 120
"""Iterations whose curves are kept, and points of each."""


@dataclass(frozen=True)
class DescentHistory:
    """The curve as it is now, and how it came about. Arrays are never written into again."""

    nodes: np.ndarray
    """(N + 1, 2) [m]: across and depth from A, N being that of the finest grid; the nodes that a
    coarser one lacks lie in B."""
    cost: np.ndarray
    """(k + 1,) [ms] T from the first guess on; (0,) where B is out of reach."""
    gradient: np.ndarray
    """(k,) after each step max |dT/dv| [ms/(m/s)], without what pushes against a bound."""
    curves: np.ndarray
    """(KEPT_CURVES, CURVE_POINTS, 2) [m] of the last iterations, the newest last."""
    segments: np.ndarray
    """(m,) of the grids to be solved, one after the other."""
    solved: np.ndarray
    """(m,) [ms] T on each of them, 0 for those not solved yet."""

    @classmethod
    def start(cls, nodes: np.ndarray, cost: float, grids: list[int]) -> Self:
        """Of a first guess; infinite is the cost of one that does not arrive."""
        segments, none = np.array(grids, dtype=float), np.zeros(0)
        nodes = _pad_nodes(nodes, grids[-1] + 1)
        curves = np.tile(_resample_nodes(nodes), (KEPT_CURVES, 1, 1))
        costs = np.array([cost]) if np.isfinite(cost) else none
        return cls(nodes, costs, none, curves, segments, np.zeros(len(grids)))

    def append(self, nodes: np.ndarray, cost: float, gradient: float) -> Self:
        """One iteration later."""
        return replace(
            self,
            nodes=_pad_nodes(nodes, len(self.nodes)),
            cost=np.append(self.cost, cost),
            gradient=np.append(self.gradient, gradient),
            curves=np.concatenate([self.curves[1:], _resample_nodes(nodes)[None]]),
        )

    def finish_grid(self) -> Self:
        """The first grid not solved yet is solved now: its T counts."""
        solved = self.solved.copy()
        solved[np.count_nonzero(solved)] = self.cost[-1]
        return replace(self, solved=solved)


def _pad_nodes(nodes: np.ndarray, count: int) -> np.ndarray:
    """(count, 2): the last one repeated."""
    return np.concatenate([nodes, np.repeat(nodes[-1:], count - len(nodes), axis=0)])


def _resample_nodes(nodes: np.ndarray) -> np.ndarray:
    """(CURVE_POINTS, 2) on the polyline, evenly along it."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(nodes, axis=0).T))])
    along = np.linspace(0.0, length[-1], CURVE_POINTS)
    return np.stack([np.interp(along, length, axis) for axis in nodes.T], axis=1)
