"""Polyhedra and polygons against an independent library (polytope), against their definitions at
random points, and where they are flat, empty, unbounded or given twice."""

import numpy as np
import polytope
import pytest
from scipy.spatial import ConvexHull

from labs.algorithms import polygons, polytopes
from labs.algorithms.polygons import (
    UnboundedError,
    convex_hull,
    minkowski_sum,
    polyhedron_from_vertices,
    vertices,
)
from labs.algorithms.polytopes import pontryagin_difference, remove_redundant_rows
from labs.errors import LabError
from labs.problems.polyhedron import Polyhedron, box

EMPTY = Polyhedron(np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]]), np.array([0.0, -1.0, 1.0]))


def random_polyhedron(
    rng: np.random.Generator, n: int, rows: int, scale: float = 1.0
) -> Polyhedron:
    """Bounded, around a point near the origin, with rows that say nothing and rows said twice."""
    H, h = rng.normal(size=(rows, n)), rng.uniform(0.2, 1.5, rows)
    around = box(np.full(n, -2.0), np.full(n, 2.0))
    center = rng.normal(size=n)
    H, h = np.vstack([H, around.H, 3.0 * H[:2]]), np.concatenate([h, around.h, 3.0 * h[:2]])
    order = rng.permutation(len(h))
    return Polyhedron(H[order], scale * (h + H @ center)[order])


def oracle(polyhedron: Polyhedron) -> polytope.Polytope:
    return polytope.Polytope(polyhedron.H, polyhedron.h)


def farthest_from(points: np.ndarray, others: np.ndarray) -> float:
    """The largest distance of a point to the nearest of the others."""
    return float(np.linalg.norm(points[:, None] - others[None], axis=2).min(axis=1).max())


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e5])
def test_vertices_and_area_are_those_of_the_library(scale: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(15):
        polyhedron = random_polyhedron(rng, 2, 8, scale)
        polygon = vertices(polyhedron)
        unit = Polyhedron(polyhedron.H, polyhedron.h / scale)
        expected = scale * polytope.extreme(oracle(unit))
        assert len(polygon) == len(expected)
        assert farthest_from(polygon, expected) <= 1e-9 * scale
        area = ConvexHull(expected / scale).volume * scale**2
        assert polygons.area(polygon) == pytest.approx(area, rel=1e-9)
        again = vertices(polyhedron_from_vertices(polygon))
        assert len(again) == len(polygon)
        assert farthest_from(again, polygon) <= 1e-12 * scale
        following = np.roll(polygon, -1, axis=0) - polygon
        turns = following[:, 0] * np.roll(following, -1, axis=0)[:, 1]
        turns -= following[:, 1] * np.roll(following, -1, axis=0)[:, 0]
        assert (turns > 0.0).all()  # counter-clockwise, nothing needless


@pytest.mark.parametrize("n", [2, 3, 4])
def test_rows_are_redundant_where_the_library_says_so(n: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(4):
        polyhedron = random_polyhedron(rng, n, 8)
        least = remove_redundant_rows(polyhedron)
        expected = polytope.reduce(oracle(polyhedron))
        assert len(least.h) == len(expected.b)
        assert farthest_from(np.c_[least.H, least.h], np.c_[expected.A, expected.b]) <= 1e-7
        assert polytopes.includes(polyhedron, least)
        assert polytopes.includes(least, polyhedron)


@pytest.mark.parametrize(("n", "kept"), [(3, 2), (4, 2), (3, 1)])
def test_a_shadow_is_what_some_point_lies_above(n: int, kept: int) -> None:
    rng = np.random.default_rng(10 * n + kept)
    for _ in range(3):
        polyhedron = random_polyhedron(rng, n, 6)
        shadow = polytopes.project(polyhedron, kept)
        corners = polytope.extreme(oracle(polyhedron))[:, :kept]
        directions = rng.normal(size=(40, kept))
        reach = polytopes.support(shadow, directions)
        assert reach == pytest.approx(polygons.support_of_points(corners, directions), abs=1e-8)


def test_the_support_function_and_what_includes_what() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        polyhedron = random_polyhedron(rng, 2, 6)
        directions = rng.normal(size=(9, 2))
        reach = polytopes.support(polyhedron, directions)
        corners = vertices(polyhedron)
        assert reach == pytest.approx(polygons.support_of_points(corners, directions), abs=1e-8)
        shrunk = polyhedron_from_vertices(
            0.999 * (corners - corners.mean(axis=0)) + corners.mean(axis=0)
        )
        assert polytopes.includes(polyhedron, shrunk)
        assert not polytopes.includes(shrunk, polyhedron)
        assert polytopes.includes(shrunk, polyhedron, tolerance=0.01)


def test_sum_and_difference_meet_their_definitions() -> None:
    rng = np.random.default_rng(4)
    for _ in range(10):
        P, W = random_polyhedron(rng, 2, 5), convex_hull(0.2 * rng.normal(size=(6, 2)))
        V = vertices(P)
        summed = minkowski_sum(V, W)
        directions = rng.normal(size=(50, 2))
        reach = polygons.support_of_points(summed, directions)
        separate = [polygons.support_of_points(points, directions) for points in (V, W)]
        assert reach == pytest.approx(sum(separate), abs=1e-12)
        assert len(summed) <= len(V) + len(W)
        left = pontryagin_difference(P, W)
        X = rng.uniform(-4.0, 4.0, (500, 2))
        fits = P.contains(X[:, None] + W[None]).all(axis=1)
        assert (left.contains(X) == fits).all()
        assert polytopes.includes(P, polyhedron_from_vertices(minkowski_sum(vertices(left), W)))
    regrown = pontryagin_difference(polyhedron_from_vertices(summed), W)
    assert farthest_from(vertices(regrown), V) <= 1e-9


def test_flat_sets_stay_what_they_are() -> None:
    origin, still = box([0.0, 0.0], [0.0, 0.0]), box([-1.0, 0.0], [2.0, 0.0])
    assert vertices(origin).tolist() == [[0.0, 0.0]]
    assert np.sort(vertices(still), axis=0) == pytest.approx(np.array([[-1.0, 0.0], [2.0, 0.0]]))
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    slanted = vertices(still) @ turn.T
    for flat in (vertices(origin), vertices(still), slanted, slanted[:1]):
        assert farthest_from(vertices(polyhedron_from_vertices(flat)), flat) <= 1e-12
        assert polygons.area(flat) == 0.0
    grown = minkowski_sum(slanted, vertices(box([-0.1, -0.1], [0.1, 0.1])))
    assert len(grown) == 6
    for flat in (origin, still, polyhedron_from_vertices(slanted)):
        assert polytopes.includes(remove_redundant_rows(flat), flat)
        assert polytopes.includes(flat, remove_redundant_rows(flat))
    assert len(convex_hull(np.zeros((5, 2)))) == 1
    assert len(convex_hull(np.outer(np.arange(5.0), [1.0, 2.0]))) == 2


def test_empty_and_unbounded_sets_are_told() -> None:
    assert polytopes.is_empty(EMPTY)
    assert len(vertices(EMPTY)) == 0
    assert (polytopes.support(EMPTY, np.eye(2)) == -np.inf).all()
    assert not remove_redundant_rows(EMPTY).contains(np.zeros(2))
    assert not polyhedron_from_vertices(np.zeros((0, 2))).contains(np.zeros(2))
    assert len(vertices(polyhedron_from_vertices(np.zeros((0, 2))))) == 0
    assert len(minkowski_sum(np.zeros((0, 2)), np.eye(2))) == 0
    assert (
        len(vertices(pontryagin_difference(box([0, 0], [1, 1]), np.array([[0, 0], [2, 0]])))) == 0
    )
    plane, strip = Polyhedron(np.zeros((0, 2)), np.zeros(0)), box([-1.0, -np.inf], [1.0, np.inf])
    for unbounded in (plane, strip, box([-np.inf, -1.0], [0.0, 1.0])):
        assert not polytopes.is_bounded(unbounded)
        assert not polytopes.is_empty(unbounded)
        with pytest.raises(UnboundedError, match="reaches to infinity"):
            vertices(unbounded)
    assert polytopes.support(strip, np.eye(2)).tolist() == [1.0, np.inf]
    assert polytopes.includes(plane, strip)
    assert not polytopes.includes(strip, plane)
    half = polygons.clip(vertices(box([-3, -3], [3, 3])), strip)
    assert polygons.area(half) == pytest.approx(12.0)
    assert len(polytopes.project(strip, 1).h) == 2
    assert len(polytopes.project(box([-np.inf, -1.0], [np.inf, 1.0]), 1).h) == 0
    with pytest.raises(LabError, match="R\\^3"):
        vertices(box([0, 0, 0], [1, 1, 1]))
