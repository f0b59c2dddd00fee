"""V and its change over the plane, the largest level set in which it decreases, and the constants
of its conditions on the set that is asked about."""

from dataclasses import dataclass

import numpy as np

from labs.algorithms.lyapunov import (
    LyapunovConstants,
    largest_invariant_level,
    largest_level_inside,
    linear_constants,
    sampled_constants,
)
from labs.appendix.lyapunov.params import LyapunovParams
from labs.errors import LabError
from labs.resumable import Resumable

NODES = 81
"""Along either axis, of what is kept."""
GRID_REFINEMENT = 2
"""The grid has so many times as many intervals, but for MPC, whose law takes longer."""
ENSEMBLE_SIZE = 60
"""States let loose at once."""
DECREASE_TOLERANCE = 1e-12
"""What V may fail to decrease by, in parts of itself, by rounding alone."""


@dataclass(frozen=True, eq=False)
class LyapunovAnalysis:
    """What is known of one V and one loop. Its arrays are never written into."""

    V: np.ndarray
    """(NODES, NODES), over the window."""
    change: np.ndarray
    """(NODES, NODES): V(f(x)) - V(x)."""
    level_max: float
    """The largest level below which V decreases everywhere in the window; 0: there is none."""
    level: float
    """Of the set, if it is a level set; of a box, the level of the largest set of a quadratic V in
    it in which V decreases."""
    starts: np.ndarray
    """(ENSEMBLE_SIZE, 2) on the edge of the set."""
    alphas: np.ndarray
    """(3,) alpha_1, alpha_2, alpha_3 on the set, or in the window if the set is empty."""
    decreasing: float
    """The part of the window in which V decreases."""
    covered: float
    """The part of the window that the largest level set covers."""

    @property
    def constants(self) -> LyapunovConstants:
        return LyapunovConstants(*map(float, self.alphas))


def analyse(params: LyapunovParams) -> Resumable[LyapunovAnalysis | str]:
    """Looks at the grid; why there is no V, where there is none."""
    try:
        candidate = params.V
    except LabError as error:
        return str(error)
    loop = params.loop
    skip = 1 if params.system == "mpc" else GRID_REFINEMENT
    fine = params.plane.grid(skip * (NODES - 1) + 1, skip * (NODES - 1) + 1)
    X = fine.reshape(-1, 2)
    F = yield from loop.next_grid_states(X)
    V = yield from candidate.values(X)
    V_next = yield from candidate.values(F)
    falls = V_next < V - DECREASE_TOLERANCE * np.abs(V)
    shape, kept = fine.shape[:2], (slice(None, None, skip), slice(None, None, skip))
    after = np.where(falls, V_next, V).reshape(shape)
    near = linear_constants(loop.A, candidate.P)
    level_max = 0.0  # where V grows right beside the origin, between the grid's states
    if near.alpha_3 > 0.0:
        level_max = largest_invariant_level(V.reshape(shape), after, np.ones(shape, bool))
    if params.set == "box":
        inside = params.box.contains(X)
        fits = largest_level_inside(candidate.P, params.box) if candidate.quadratic else 0.0
        level = min(level_max, fits)
    else:
        level = params.share * level_max
        inside = level > V
    apart = np.square(X).sum(axis=1) > 0.0
    some = inside if (inside & apart).any() else np.ones(len(X), bool)
    found = sampled_constants(X[some], V[some], V_next[some])
    alphas = [
        min(found.alpha_1, near.alpha_1),
        max(found.alpha_2, near.alpha_2),
        min(found.alpha_3, near.alpha_3),
    ]
    values = V.reshape(shape)[kept]
    return LyapunovAnalysis(
        values,
        (V_next - V).reshape(shape)[kept],
        level_max,
        level,
        _boundary_states(params, fine[kept], values, level),
        np.array(alphas),
        float(falls[apart].mean()),
        float((level_max > V).mean()) if level_max > 0.0 else 0.0,
    )


def _boundary_states(
    params: LyapunovParams, grid: np.ndarray, V: np.ndarray, level: float
) -> np.ndarray:
    """(ENSEMBLE_SIZE, 2) states on the edge of the set, seen from the origin at even angles; of a
    set that is empty, on an ellipse half as large as the window."""
    angles = 2.0 * np.pi * (np.arange(ENSEMBLE_SIZE) + 0.5) / ENSEMBLE_SIZE
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    window = np.array(params.loop.window)
    if params.set == "box":
        corner = window * [params.box_1, params.box_2]
        return np.asarray(ways / np.abs(ways).max(axis=1, keepdims=True) * corner)
    if level <= 0.0:
        return np.asarray(0.5 * window * ways)
    # Outward along each ray until V is no longer below: first on the grid's scale, then between.
    reach = np.linspace(0.0, 1.0, 2 * NODES)[1:] / np.abs(ways).max(axis=1, keepdims=True)
    along = reach[..., None] * ways[:, None] * window
    found = interpolate_value(grid, V, along.reshape(-1, 2)).reshape(reach.shape)
    beyond = found > level
    first = np.where(beyond.any(axis=1), beyond.argmax(axis=1), reach.shape[1] - 1)
    rows = np.arange(ENSEMBLE_SIZE)
    before = np.maximum(first - 1, 0)
    low = np.where(first > 0, found[rows, before], 0.0)
    high = found[rows, first]
    near = np.where(first > 0, reach[rows, before], 0.0)
    share = np.clip((level - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    size = near + share * (reach[rows, first] - near)
    return np.asarray(size[:, None] * ways * window)


def interpolate_value(grid: np.ndarray, V: np.ndarray, X: np.ndarray) -> np.ndarray:
    """V (k,) at states X (k, 2) of the window, by the grid's four nodes about each."""
    lower, upper = grid[0, 0], grid[-1, -1]
    place = np.clip((X - lower) / (upper - lower), 0.0, 1.0) * (NODES - 1)
    cell = np.minimum(place.astype(int), NODES - 2)
    s, r = (place - cell).T
    j, i = cell.T
    low = (1.0 - s) * V[i, j] + s * V[i, j + 1]
    high = (1.0 - s) * V[i + 1, j] + s * V[i + 1, j + 1]
    return np.asarray((1.0 - r) * low + r * high)
