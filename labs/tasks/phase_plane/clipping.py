"""What of a polygon or of a path lies in the window of a phase plane, for labs to come."""

import numpy as np


def clip_polygon(vertices: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """(k, 2): the corners of what a convex polygon (n, 2), its corners in order, shares with the
    box from `lower` to `upper`; (0, 2) where that is nothing."""
    for axis in (0, 1):
        for sign, bound in ((1.0, upper[axis]), (-1.0, -lower[axis])):
            if not len(vertices):
                return vertices
            room = bound - sign * vertices[:, axis]
            after, ahead = np.roll(vertices, -1, axis=0), np.roll(room, -1)
            kept: list[np.ndarray] = []
            for a, b, r, s in zip(vertices, after, room, ahead, strict=True):
                if r >= 0.0:
                    kept.append(a)
                if (r > 0.0 > s) or (r < 0.0 < s):
                    kept.append(a + r / (r - s) * (b - a))
            vertices = np.array(kept).reshape(-1, 2)
    return vertices


def clip_segments(
    starts: np.ndarray, ends: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Starts and ends (m, 2) of what of segments (k, 2) lies in the box (Liang and Barsky, 1984);
    those with a number that is not finite are left out."""
    finite = np.isfinite(starts).all(axis=1) & np.isfinite(ends).all(axis=1)
    starts, ways = starts[finite], (ends - starts)[finite]
    with np.errstate(divide="ignore", invalid="ignore"):
        to_lower, to_upper = (lower - starts) / ways, (upper - starts) / ways
    still = ways == 0.0
    inside = (starts >= lower) & (starts <= upper)
    enter = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(to_lower, to_upper))
    leave = np.where(still, np.inf, np.maximum(to_lower, to_upper))
    first, last = np.maximum(enter.max(axis=1), 0.0), np.minimum(leave.min(axis=1), 1.0)
    seen = first < last
    starts, ways, first, last = starts[seen], ways[seen], first[seen, None], last[seen, None]
    return starts + first * ways, starts + last * ways
