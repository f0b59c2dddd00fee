"""V*_N over the plane, on rays from the origin to the edge of where the problem is feasible, and
whether it falls there in the next step: V*(x+) - V*(x) + l(x, u*) <= 0?"""

from dataclasses import dataclass

import numpy as np

from labs.algorithms.polygons import area, polyhedron_from_vertices
from labs.optimal_control.mpc_stability.assumptions import boundary_points
from labs.optimal_control.mpc_stability.formulation import Formulation
from labs.resumable import Resumable

RESOLUTIONS = ((8, 25), (20, 61))
"""Rings and rays, coarse and fine."""
FALLS, FALLS_LESS, RISES, INFEASIBLE_NEXT = range(4)
"""By at least l; by less; not at all; there is no V*(x+)."""
EDGE_FRACTION = 1.0 - 1e-6
"""Of the way to the edge: there, but for rounding."""
ROUNDING = 1e-7
"""Of 1 + V*."""
MIN_AREA = 1e-6
"""Of the window: a smaller area of X_0 has no surface."""


@dataclass(frozen=True, eq=False)
class ValueSurface:
    """Rows are rings from the origin outwards, columns rays once around and back to the first."""

    points: np.ndarray
    """(rings, rays, 2); of no surface (0, 0, 2)."""
    V: np.ndarray
    """(rings, rays) finite."""
    change: np.ndarray
    """(rings, rays) FALLS ... INFEASIBLE_NEXT."""

    @classmethod
    def empty(cls) -> "ValueSurface":
        """Where it is not known, or X_0 has no inside."""
        return cls(np.zeros((0, 0, 2)), np.zeros((0, 0)), np.zeros((0, 0), dtype=int))

    def shares(self) -> np.ndarray:
        """(4,) of the feasible states looked at, by what V* does there, each weighed with the
        area about it."""
        if not self.V.size:
            return np.zeros(4)
        rings = len(self.V)
        weight = np.arange(rings)[:, None] * np.linalg.norm(self.points[-1], axis=1) ** 2
        weight = weight[:, :-1].ravel()
        counts = np.bincount(self.change[:, :-1].ravel(), weight, minlength=4)
        return np.asarray(counts / weight.sum())


def value_surface(formulation: Formulation, size: tuple[int, int]) -> Resumable[ValueSurface]:
    """With rings and rays as in `size`."""
    corners, units = formulation.feasible_polygon, np.array(formulation.system.x_max)
    if formulation.settings.task == "track" or area(corners) < MIN_AREA * float(np.prod(units)):
        return ValueSurface.empty()
    rings, rays = size
    angles = np.linspace(0.0, 2.0 * np.pi, rays)
    edge = EDGE_FRACTION * boundary_points(polyhedron_from_vertices(corners), angles, units)
    points = np.linspace(0.0, 1.0, rings)[:, None, None] * edge
    # Along a ray and back along the next: neighbours follow each other.
    order = points.transpose(1, 0, 2).copy()
    order[1::2] = order[1::2, ::-1]
    X = order.reshape(-1, 2)
    p = formulation.problem
    V, u = yield from formulation.planner.values(X)
    V = np.where(np.isfinite(V), V, 0.0)
    u = np.where(np.isfinite(u), u, 0.0)
    after, _ = yield from formulation.planner.values(X @ p.A.T + u @ p.B.T)
    rise, slack = after - V, ROUNDING * (1.0 + np.abs(V))
    paid = formulation.stage_cost(X, u)
    change = np.select(
        [~np.isfinite(rise), rise > slack, rise + paid <= slack],
        [INFEASIBLE_NEXT, RISES, FALLS],
        FALLS_LESS,
    )
    return ValueSurface(points, _restore_order(V, rings, rays), _restore_order(change, rings, rays))


def _restore_order(values: np.ndarray, rings: int, rays: int) -> np.ndarray:
    """From the order of solving to (rings, rays)."""
    table = values.reshape(rays, rings).copy()
    table[1::2] = table[1::2, ::-1]
    return table.T.copy()
