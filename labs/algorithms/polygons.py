"""Convex polygons: sets of the plane by their vertices, which makes sums, clipping and areas cheap
(for the sets of linear MPC; notes, 2.5.2).

A polygon is an array (k, 2), counter-clockwise, without repeated or needless vertices: two of them
are a segment, one a point, none the empty set. What is nearer than ROUNDING times its coordinates
counts as one point, so that flat sets (the origin, zero velocity) survive rounding.
"""

import numpy as np

from labs.compiled import compiled
from labs.errors import LabError
from labs.problems.polyhedron import Polyhedron, box

ROUNDING = 1e-12
UNBOUNDED_FACTOR = 1e6
"""A vertex farther than half this many times the farthest row's line counts as infinitely far."""


class UnboundedError(LabError):
    """A polyhedron that has no polygon."""


def convex_hull(points: np.ndarray) -> np.ndarray:
    """The least polygon around points (k, 2)."""
    return np.asarray(_hull(_as_float_array(points)))


def vertices(polyhedron: Polyhedron) -> np.ndarray:
    """The polygon {x : H x <= h}. Raises Unbounded where it is, LabError outside the plane."""
    if polyhedron.n != 2:
        raise LabError(f"a polygon lies in the plane, not in R^{polyhedron.n}")
    polygon, bounded = _vertices(_as_float_array(polyhedron.H), _as_float_array(polyhedron.h))
    if not bounded:
        raise UnboundedError("the set reaches to infinity: add the limits that bound it")
    return np.asarray(polygon)


def clip(polygon: np.ndarray, polyhedron: Polyhedron) -> np.ndarray:
    """What of the polygon lies in the polyhedron, which may be unbounded."""
    H, h = _normalize_rows(_as_float_array(polyhedron.H), _as_float_array(polyhedron.h))
    return np.asarray(_clip(_as_float_array(polygon), H, h))


def polyhedron_from_vertices(polygon: np.ndarray) -> Polyhedron:
    """The polygon by its edges: rows of length 1. A point or segment takes four rows."""
    if len(polygon) == 0:
        return Polyhedron(np.zeros((1, 2)), np.array([-1.0]))
    if len(polygon) == 1:
        return box(polygon[0], polygon[0])
    return Polyhedron(*_edges(_as_float_array(polygon)))


def minkowski_sum(polygon: np.ndarray, other: np.ndarray) -> np.ndarray:
    """{v + w}: of all v in one and w in the other."""
    return convex_hull((polygon[:, None] + other[None]).reshape(-1, 2))


def area(polygon: np.ndarray) -> float:
    """In the product of the coordinates' units."""
    if len(polygon) < 3:
        return 0.0
    x, y = (polygon - polygon[0]).T
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2.0


def support_of_points(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """max of d'p over points (k, n), in each of directions (j, n): (j,); -inf where there are
    none."""
    return np.asarray((directions @ points.T).max(axis=1, initial=-np.inf))


def normalize_rows(polyhedron: Polyhedron) -> Polyhedron:
    """The same set by rows of length 1, so that h is a distance, in any dimension. A row that is
    zero beside the others, as differences and products leave them, goes; where it says
    0 <= -1, it stays alone and the set is empty."""
    return Polyhedron(
        *_normalize_rows(_as_float_array(polyhedron.H), _as_float_array(polyhedron.h))
    )


def _as_float_array(numbers: np.ndarray) -> np.ndarray:
    """As compiled functions take them: of one type and layout."""
    return np.ascontiguousarray(numbers, float)


@compiled
def _normalize_rows(H: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    k, n = H.shape
    length = np.zeros(k)
    longest, largest = 0.0, 0.0
    for i in range(k):
        for j in range(n):
            length[i] = np.hypot(length[i], H[i, j])
        longest, largest = max(longest, length[i]), max(largest, abs(h[i]))
    unit, ends, size = np.empty((k, n)), np.empty(k), 0
    for i in range(k):
        if length[i] > ROUNDING * longest:
            for j in range(n):
                unit[size, j] = H[i, j] / length[i]
            ends[size] = h[i] / length[i]
            size += 1
        elif h[i] < -ROUNDING * largest:
            return np.zeros((1, n)), np.full(1, -1.0)
    return unit[:size].copy(), ends[:size].copy()


@compiled
def _vertices(H: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, bool]:
    """The polygon, and whether it is one."""
    H, h = _normalize_rows(H, h)
    size = 0.0
    for i in range(len(h)):
        size = max(size, abs(h[i]))
    size = size if size > 0.0 else 1.0
    far = UNBOUNDED_FACTOR * size
    around = _clip(_rectangle(-far, -far, far, far), H, h)
    if len(around) == 0:
        return around, True
    left, right = around[:, 0].min(), around[:, 0].max()
    low, high = around[:, 1].min(), around[:, 1].max()
    if max(-left, right, -low, high) > far / 2.0:
        return around, False
    # Once more from near by: what is cut far away is not cut to the last digit.
    margin = max(right - left, high - low) + 1e-4 * size
    near = _rectangle(left - margin, low - margin, right + margin, high + margin)
    return _clip(near, H, h), True


@compiled
def _rectangle(left: float, low: float, right: float, high: float) -> np.ndarray:
    return np.array([[left, low], [right, low], [right, high], [left, high]])


@compiled
def _edges(polygon: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Outer normals of length 1 and h; of a segment also its ends."""
    k = len(polygon)
    rows = k if k > 2 else 4
    H, h = np.empty((rows, 2)), np.empty(rows)
    for i in range(k):
        j = i + 1 if i + 1 < k else 0
        x, y = polygon[j, 0] - polygon[i, 0], polygon[j, 1] - polygon[i, 1]
        length = np.hypot(x, y)
        H[i, 0], H[i, 1] = y / length, -x / length
        h[i] = H[i, 0] * polygon[i, 0] + H[i, 1] * polygon[i, 1]
        if k == 2:
            H[2 + i, 0], H[2 + i, 1] = x / length, y / length
            h[2 + i] = (x * polygon[j, 0] + y * polygon[j, 1]) / length
    return H, h


@compiled
def _rounding_tolerance(points: np.ndarray) -> float:
    largest = 0.0
    for i in range(len(points)):
        largest = max(largest, abs(points[i, 0]), abs(points[i, 1]))
    return ROUNDING * largest


@compiled
def _sort_points(points: np.ndarray) -> np.ndarray:
    """By x, then y (Shell, 1959): NumPy's own sort takes seconds to compile."""
    points, gap = points.copy(), len(points)
    while gap > 1:
        gap = 1 if gap < 5 else 5 * gap // 11
        for i in range(gap, len(points)):
            x, y = points[i, 0], points[i, 1]
            j = i - gap
            while j >= 0 and (points[j, 0] > x or (points[j, 0] == x and points[j, 1] > y)):
                points[j + gap, 0], points[j + gap, 1] = points[j, 0], points[j, 1]
                j -= gap
            points[j + gap, 0], points[j + gap, 1] = x, y
    return points


@compiled
def _hull(points: np.ndarray) -> np.ndarray:
    """Andrew's monotone chain over the points sorted by x, then y. Left out is what lies within
    rounding of the line between its neighbours."""
    k, tolerance = len(points), _rounding_tolerance(points)
    points = _sort_points(points)
    chain = np.empty((2 * k + 2, 2))
    size, floor = 0, 1
    for turn in range(2):
        for j in range(k):
            i = j if turn == 0 else k - 1 - j
            x, y = points[i, 0], points[i, 1]
            while size > floor:
                ax, ay = chain[size - 2, 0], chain[size - 2, 1]
                bx, by = chain[size - 1, 0], chain[size - 1, 1]
                cross = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
                if cross > tolerance * np.hypot(x - ax, y - ay):
                    break
                size -= 1
            if size == 0 or np.hypot(x - chain[size - 1, 0], y - chain[size - 1, 1]) > tolerance:
                chain[size, 0], chain[size, 1] = x, y
                size += 1
        floor = size
    while size > 1 and (
        np.hypot(chain[size - 1, 0] - chain[0, 0], chain[size - 1, 1] - chain[0, 1]) <= tolerance
    ):
        size -= 1
    return chain[:size].copy()


@compiled
def _clip(polygon: np.ndarray, H: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Sutherland and Hodgman's clipping (1974), by one half-plane after the other."""
    most, tolerance = len(polygon) + 2 * len(H), _rounding_tolerance(polygon)
    now, new = np.empty((most, 2)), np.empty((most, 2))
    size = len(polygon)
    now[:size] = polygon
    for r in range(len(H)):
        a, b = H[r, 0], H[r, 1]
        count = 0
        for i in range(size):
            j = i + 1 if i + 1 < size else 0
            d = a * now[i, 0] + b * now[i, 1] - h[r]
            e = a * now[j, 0] + b * now[j, 1] - h[r]
            if d <= tolerance:
                new[count] = now[i]
                count += 1
            if (d < -tolerance and e > tolerance) or (d > tolerance and e < -tolerance):
                s = d / (d - e)
                new[count, 0] = now[i, 0] + s * (now[j, 0] - now[i, 0])
                new[count, 1] = now[i, 1] + s * (now[j, 1] - now[i, 1])
                count += 1
        size = count
        now, new = new, now
        if size == 0:
            break
    return _hull(now[:size])
