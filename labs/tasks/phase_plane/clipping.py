"""What of a path lies in the window of a phase plane."""

import numpy as np


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
