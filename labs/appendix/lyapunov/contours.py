"""Level lines of a function of the plane."""

import numpy as np


def level_lines(X: np.ndarray, V: np.ndarray, level: float) -> np.ndarray:
    """(m, 2, 2): segments of {V = level}, of V (rows, columns) at the states X (rows, columns, 2)
    of a grid, blended linearly over triangles of it; NaN in V cuts the line."""
    a, b = (slice(None, -1), slice(None, -1)), (slice(None, -1), slice(1, None))
    c, d = (slice(1, None), slice(1, None)), (slice(1, None), slice(None, -1))
    found = [np.empty((0, 2, 2))]
    for corners in ((a, b, c), (a, c, d)):
        places = np.stack([X[some].reshape(-1, 2) for some in corners], axis=1)
        above = np.stack([V[some].ravel() for some in corners], axis=1) - level
        crossed = (above > 0.0).any(axis=1) & (above <= 0.0).any(axis=1)
        places, above = places[crossed], above[crossed]
        finite = np.isfinite(above).all(axis=1)
        places, above = places[finite], above[finite]
        # Of the three corners one is alone on its side: the line leaves through both its edges.
        high = above > 0.0
        alone = np.where(high.sum(axis=1) == 1, high.argmax(axis=1), high.argmin(axis=1))
        rows = np.arange(len(alone))
        ends = []
        for other in ((alone + 1) % 3, (alone + 2) % 3):
            share = above[rows, alone] / (above[rows, alone] - above[rows, other])
            way = places[rows, other] - places[rows, alone]
            ends.append(places[rows, alone] + share[:, None] * way)
        found.append(np.stack(ends, axis=1))
    return np.concatenate(found)
