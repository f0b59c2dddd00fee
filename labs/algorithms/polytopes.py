"""Sets of R^n given by linear inequalities: how far they reach, whether one holds another, sums and
shadows of them (for the sets of linear MPC; notes, 2.5.2). By linear programmes (HiGHS) and
Fourier-Motzkin elimination, for a few dimensions; `polygons.py` has what is quicker in the plane.
"""

import contextlib

import numpy as np
from scipy.optimize import linprog

from labs.algorithms.polygons import (
    UnboundedError,
    normalize_rows,
    polyhedron_from_vertices,
    support_of_points,
    vertices,
)
from labs.errors import LabError
from labs.problems.polyhedron import Polyhedron

TOLERANCE = 1e-9
"""By which, in units of length, a row may be exceeded and still counts as met."""


def support(polyhedron: Polyhedron, directions: np.ndarray) -> np.ndarray:
    """max of d'x over the set, in each of directions (k, n): (k,); inf where it is unbounded
    there, -inf everywhere where it is empty. In the plane by vertices, where there are any."""
    if polyhedron.n == 2:
        with contextlib.suppress(UnboundedError):
            return support_of_points(vertices(polyhedron), directions)
    return support_by_linear_programs(polyhedron, directions)


def support_by_linear_programs(polyhedron: Polyhedron, directions: np.ndarray) -> np.ndarray:
    """The same by one linear programme for each direction."""
    if len(polyhedron.h) == 0:
        return np.where(np.any(directions, axis=1), np.inf, 0.0)
    answer = np.zeros(len(directions))
    for i, direction in enumerate(directions):
        found = linprog(-direction, polyhedron.H, polyhedron.h, bounds=(None, None))
        if found.status == 4:  # HiGHS could not tell unbounded from infeasible
            found = linprog(0.0 * direction, polyhedron.H, polyhedron.h, bounds=(None, None))
            found.status = 2 if found.status == 2 else 3
        if found.status == 2:
            return np.full(len(directions), -np.inf)
        if found.status not in (0, 3):
            raise LabError(f"no support function: {found.message}")
        answer[i] = -found.fun if found.status == 0 else np.inf
    return answer


def is_empty(polyhedron: Polyhedron) -> bool:
    """Whether no x meets all rows."""
    return bool(support(polyhedron, np.zeros((1, polyhedron.n)))[0] == -np.inf)


def is_bounded(polyhedron: Polyhedron) -> bool:
    """Whether the set lies within some box; so does the empty one."""
    eye = np.eye(polyhedron.n)
    return bool((support(polyhedron, np.vstack([eye, -eye])) < np.inf).all())


def includes(outer: Polyhedron, inner: Polyhedron, tolerance: float = TOLERANCE) -> bool:
    """Whether all of `inner` lies in `outer`, to within a distance of `tolerance`."""
    unit = normalize_rows(outer)
    return bool((support(inner, unit.H) <= unit.h + tolerance).all())


def pontryagin_difference(polyhedron: Polyhedron, points: np.ndarray) -> Polyhedron:
    """{x : x + w in the polyhedron for every w in W}, of W = the hull of points (k, n): each row's
    h less by W's support there."""
    return Polyhedron(polyhedron.H, polyhedron.h - support_of_points(points, polyhedron.H))


def remove_redundant_rows(polyhedron: Polyhedron, tolerance: float = TOLERANCE) -> Polyhedron:
    """The same set by rows of length 1, none of which the others imply. One linear programme a
    row. The empty set becomes 0 <= -1."""
    unit = normalize_rows(polyhedron)
    if is_empty(unit):
        return Polyhedron(np.zeros((1, unit.n)), np.array([-1.0]))
    kept = list(range(len(unit.h)))
    for i in range(len(unit.h)):
        others = [j for j in kept if j != i]
        # The row itself stays, a step farther out, so that the programme is bounded.
        H, h = unit.H[[*others, i]], np.append(unit.h[others], unit.h[i] + 1.0)
        if support(Polyhedron(H, h), unit.H[i : i + 1])[0] <= unit.h[i] + tolerance:
            kept = others
    return Polyhedron(unit.H[kept], unit.h[kept])


def _remove_redundant_rows(polyhedron: Polyhedron) -> Polyhedron:
    """Likewise, in the plane by its corners."""
    if polyhedron.n == 2:
        try:
            return polyhedron_from_vertices(vertices(polyhedron))
        except UnboundedError:
            pass
    return remove_redundant_rows(polyhedron)


def project(polyhedron: Polyhedron, n: int) -> Polyhedron:
    """{x in R^n : (x, u) in the polyhedron for some u}, by Fourier-Motzkin elimination: of the last
    variable, each row that bounds it above joins each that bounds it below. Redundant rows go
    after every variable, else their number squares."""
    H, h = polyhedron.H, polyhedron.h
    for last in range(polyhedron.n - 1, n - 1, -1):
        column = H[:, last]
        zero = np.abs(column) <= 1e-12 * np.abs(H).max(axis=1, initial=0.0)
        above, below = np.flatnonzero((column > 0.0) & ~zero), np.flatnonzero((column < 0) & ~zero)
        scale = np.where(zero, 1.0, column)
        H, h = H / np.abs(scale)[:, None], h / np.abs(scale)
        rows = (H[above][:, None] + H[below][None]).reshape(-1, last + 1)
        ends = (h[above][:, None] + h[below][None]).ravel()
        left = Polyhedron(np.vstack([H[zero], rows])[:, :last], np.concatenate([h[zero], ends]))
        left = _remove_redundant_rows(left)
        H, h = left.H, left.h
    return Polyhedron(H, h)
