"""The phase plane: where a state is in the scene, what is cut off, and what is drawn."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from labs.algorithms.polygons import clip
from labs.problems.polyhedron import box
from labs.tasks.phase_plane.clipping import clip_segments
from labs.tasks.phase_plane.picture import PhasePlane
from labs.tasks.phase_plane.systems import PLANE_SYSTEMS, plane_system
from tests.labs.contract import CheckingScene

RNG = np.random.default_rng(5)
LOWER, UPPER = np.array([-1.0, -0.5]), np.array([1.5, 2.0])


@pytest.mark.parametrize("lying", [False, True])
@pytest.mark.parametrize("name", PLANE_SYSTEMS)
def test_a_dragged_point_is_the_state_it_shows(name: str, lying: bool) -> None:
    plane = PhasePlane.of(plane_system(name), lying=lying)
    for share in RNG.uniform(size=(5, 2)):
        x = plane.lower + share * (plane.upper - plane.lower)
        away = plane.place(x, 0.3)
        np.testing.assert_allclose((away - plane.place(x)) @ plane.normal, 0.3)
        np.testing.assert_allclose(plane.state_at(away), x, atol=1e-12)
    beyond = plane.state_at(plane.place(plane.upper + 9.0))
    np.testing.assert_allclose(beyond, plane.upper)


def test_above_the_rail_a_state_is_where_the_cart_is() -> None:
    system = plane_system("cart")
    for lying in (False, True):
        plane = PhasePlane.of(system, lying=lying)
        assert plane.place(np.array([0.7, -0.2]))[1] == pytest.approx(
            system.pose(np.array([0.7, -0.2]))[0]
        )


def test_a_polygon_is_cut_to_the_window() -> None:
    for _ in range(40):
        points = RNG.normal(size=(7, 2)) * 2.0
        hull = points[ConvexHull(points).vertices]
        cut = clip(hull, box(LOWER, UPPER))
        some = RNG.uniform(LOWER, UPPER, (300, 2))
        np.testing.assert_array_equal(_inside(some, hull), _inside(some, cut))
        assert (cut >= LOWER - 1e-12).all()
        assert (cut <= UPPER + 1e-12).all()
    assert clip(hull + 50.0, box(LOWER, UPPER)).shape == (0, 2)


def test_segments_are_cut_to_the_window() -> None:
    a, b = RNG.normal(size=(2, 200, 2)) * 2.0
    b[:20, 0] = a[:20, 0]  # upright
    b[20:40] = a[20:40]  # of no length
    starts, ends = clip_segments(a, b, LOWER, UPPER)
    s = np.linspace(0.0, 1.0, 2001)[:, None, None]
    along = a + s * (b - a)
    lengths = np.linalg.norm(b - a, axis=1)
    inside = ((along >= LOWER) & (along <= UPPER)).all(axis=2).mean(axis=0) * lengths
    assert np.linalg.norm(ends - starts, axis=1).sum() == pytest.approx(inside.sum(), rel=2e-3)
    assert ((starts >= LOWER - 1e-9) & (ends <= UPPER + 1e-9)).all()
    a[0] = np.nan
    assert np.isfinite(clip_segments(a, b, LOWER, UPPER)[0]).all()


@pytest.mark.parametrize("lying", [False, True])
@pytest.mark.parametrize("name", PLANE_SYSTEMS)
def test_all_that_is_drawn_can_be_shown(name: str, lying: bool) -> None:
    system, scene = plane_system(name), CheckingScene()
    plane = PhasePlane.of(system, lying=lying)
    x = np.array(system.x_eq)
    large = x + 9.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    many = x + 4.0 * RNG.normal(size=(50, 2))
    many[3] = np.nan
    plane.draw_axes(scene)
    plane.draw_body(scene, x)
    plane.fill(scene, "set", large, "reference", 0.3)
    plane.fill(scene, "beside", large + 40.0)
    plane.fill(
        scene, "shade", x + 0.1 * (large - x), (0.1, 0.2, 0.3), 1.0, layer=2, outline="muted"
    )
    plane.path(scene, "way", many)
    plane.path(scene, "ways", many.reshape(5, 10, 2), "muted", 0.5)
    plane.dots(scene, "dots", many)
    plane.arrows(scene, "arrows", many[:25], many[25:])
    plane.paint(scene, "colours", np.full((6, 7, 3), 0.5))
    plane.surface(scene, "V", np.zeros((6, 7)), np.full((6, 7, 3), 0.5))
    plane.ball(scene, "ball", many[0])
    plane.handle(scene, "state", many[1])
    plane.label(scene, "name", "X", many[2])
    assert {"set", "edge of shade", "way", "ways", "dots", "arrows"} <= scene.drawn
    assert "beside" not in scene.drawn
    np.testing.assert_allclose(plane.grid(3, 5)[[0, -1], [0, -1]], [plane.lower, plane.upper])


def _inside(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Whether each of the points is in a convex polygon, its corners in the positive sense."""
    if len(polygon) < 3:
        return np.zeros(len(points), bool)
    edges = np.roll(polygon, -1, axis=0) - polygon
    to = points[:, None] - polygon
    return np.asarray((edges[:, 0] * to[..., 1] - edges[:, 1] * to[..., 0] >= 0.0).all(axis=1))
