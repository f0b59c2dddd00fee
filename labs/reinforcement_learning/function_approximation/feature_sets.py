"""The features to choose from, on the line of the random walk and on the pendulum's plane.

On the plane an angle runs round the circle: Fourier features have cos and sin of its multiples, and
radial functions and groups go round as well; velocities are scaled to [0, 1]. Polynomials and tiles
are cut where the pendulum hangs, at half a turn from upright."""

from functools import lru_cache

import numpy as np

from labs.algorithms.features import (
    Features,
    features_from_matrix,
    fourier_basis,
    grid_centers,
    polynomial_basis,
    radial_basis,
    state_aggregation,
    tabular_features,
    tile_coding,
    zero_features_at,
)
from labs.tasks.pendulum_table.table import PendulumGrid

FEATURE_SETS = {
    "table": "Table",
    "aggregation": "Aggregation",
    "polynomial": "Polynomials",
    "fourier": "Fourier",
    "radial": "Radial functions",
    "tiles": "Tile coding",
}
LINE_TILINGS, PLANE_TILINGS = 8, 4
"""Grids of tile coding."""
WIDTH = 0.5
"""Of a radial function, in distances of neighbouring centers."""


@lru_cache(maxsize=8)
def line_features(kind: str, n: int, states: int) -> Features:
    """Of so many states along a line between two ends that have none, evenly over [0, 1]: n groups,
    n centers, n cells a tiling, or an order n."""
    inner = _line_features(kind, n, states)
    # The ends look like their neighbours, times 0.
    place = np.clip(np.arange(-1, states + 1), 0, states - 1)
    wider = inner._replace(active=inner.active[place], value=inner.value[place])
    return zero_features_at(wider, np.isin(np.arange(states + 2), (0, states + 1)))


def _line_features(kind: str, n: int, states: int) -> Features:
    points = np.linspace(0.0, 1.0, states)[:, None]
    match kind:
        case "table":
            return tabular_features(states)
        case "aggregation":
            return state_aggregation(np.arange(states) * n // states)
        case "polynomial":
            return polynomial_basis(points, n)
        case "fourier":
            return fourier_basis(points, n)
        case "radial":
            centers = grid_centers(n, 1) if n > 1 else np.array([[0.5]])
            return radial_basis(points, centers, WIDTH / max(n - 1, 1), normalized=True)
        case _:
            return tile_coding(points, LINE_TILINGS, np.array([n]))


@lru_cache(maxsize=8)
def plane_features(kind: str, n: int, grid: PendulumGrid) -> Features:
    """Of the pendulum's angle and velocity: n by n groups, centers or cells, or an order n in
    each."""
    angle = np.repeat(grid.angles, grid.v_nodes)
    turn = np.repeat(np.arange(grid.q_nodes) / grid.q_nodes, grid.v_nodes)
    speed = np.tile(np.linspace(0.0, 1.0, grid.v_nodes), grid.q_nodes)
    points = np.stack([turn, speed], axis=1)
    match kind:
        case "table":
            return tabular_features(grid.X)
        case "aggregation":
            across = np.repeat(np.arange(grid.q_nodes) * n // grid.q_nodes, grid.v_nodes)
            up = np.tile(np.arange(grid.v_nodes) * n // grid.v_nodes, grid.q_nodes)
            return state_aggregation(across * n + up)
        case "polynomial":
            return polynomial_basis(points, n)
        case "fourier":
            k = np.arange(n + 1)
            around = np.hstack([np.cos(np.outer(angle, k)), np.sin(np.outer(angle, k[1:]))])
            return _products(around, np.cos(np.pi * np.outer(speed, k)))
        case "radial":
            off = np.abs(turn[:, None] - np.arange(n) / n)
            around = np.exp(-0.5 * (np.minimum(off, 1.0 - off) * n / WIDTH) ** 2)
            place = np.linspace(0.0, 1.0, n) if n > 1 else np.array([0.5])
            along = np.exp(-0.5 * ((speed[:, None] - place) * max(n - 1, 1) / WIDTH) ** 2)
            around, along = (part / part.sum(axis=1, keepdims=True) for part in (around, along))
            return _products(around, along)
        case _:
            return tile_coding(points, PLANE_TILINGS, np.array([n, n]))


def _products(a: np.ndarray, b: np.ndarray) -> Features:
    """Every feature of a (X, k) times every one of b (X, l)."""
    return features_from_matrix((a[:, :, None] * b[:, None, :]).reshape(len(a), -1))
