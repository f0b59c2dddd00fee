"""The camera: what is drawn fills the window, and a hand is left alone."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from server.camera import HALF_CHARACTER_WIDTH, MEMORY_SECONDS, Camera, FrameContents
from server.framing import FOV, Window, camera_axes, nearest_camera, side_extremes

SIZES = ((640, 270), (660, 360), (390, 350), (1366, 650))
HOME = np.array([[1.0, -1.0, 0.8], [0.0, 0.0, 0.3]])
AXES = camera_axes(*HOME)


def random_points(seed: int, size: float = 1.0) -> np.ndarray:
    """(40, 3) [m]"""
    return np.random.default_rng(seed).uniform(-size, size, (40, 3))


def slopes(points: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """(4,): how far right, left, up and down points in the camera's axes reach on its picture."""
    x, y = ((points - camera)[:, :2] / (points - camera)[:, 2:]).T
    return np.array([x.max(), -x.min(), y.max(), -y.min()])


class Viewer:
    """Takes a camera's poses as a browser does, and tells them back."""

    def __init__(self, width: int, height: int) -> None:
        self.camera: Any = SimpleNamespace(image_width=width, image_height=height)
        self.camera.position, self.camera.look_at = np.full(3, 3.0), np.zeros(3)

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """(k, 2) [px] from the middle."""
        axes = camera_axes(self.camera.position, self.camera.look_at)
        local = (points - self.camera.position) @ axes.T
        scale = 0.5 * self.camera.image_height / np.tan(FOV / 2)
        return np.asarray(scale * local[:, :2] / local[:, 2:])

    def shows(self, points: np.ndarray) -> bool:
        half = 0.5 * np.array([self.camera.image_width, self.camera.image_height])
        return bool((np.abs(self.pixels(points)) < half).all())


def follow(camera: Camera, points: np.ndarray, *, now: float = 0.0, changed: bool = False) -> None:
    camera.follow(FrameContents(points, []), HOME, now, changed=changed)


def test_axes_are_those_of_a_camera_that_stands_upright() -> None:
    for look_at in ((0.0, 0.0, 0.3), (1.0, -1.0, 0.0)):  # the second straight down
        right, up, forward = camera_axes((1.0, -1.0, 0.8), look_at)
        np.testing.assert_allclose(np.cross(right, forward), up, atol=1e-12)
        assert right[2] == 0.0
        assert np.linalg.norm(right) == pytest.approx(1.0)
        assert up[2] >= 0.0


@pytest.mark.parametrize("size", SIZES)
def test_the_nearest_camera_that_has_all_in_its_window(size: tuple[int, int]) -> None:
    window = Window.of(*size)
    for seed in range(20):
        points = random_points(seed, 0.1 + seed)
        camera = nearest_camera(side_extremes(points, window), window)
        free = window.tangents - slopes(points, camera)
        assert free.min() > -1e-9
        assert free.reshape(2, 2).max(axis=1).min() < 1e-9, "one pair of sides is touched"
        ahead = camera + np.array([0.0, 0.0, 1e-3])
        assert (slopes(points, ahead) > window.tangents).any()


@pytest.mark.parametrize("size", SIZES)
def test_a_viewer_sees_all_at_once_and_what_comes_after_a_while(size: tuple[int, int]) -> None:
    viewer, points = Viewer(*size), random_points(0)
    camera = Camera(viewer)  # type: ignore[arg-type]
    follow(camera, points)
    assert viewer.shows(points)
    grown, before = 1.4 * points, viewer.camera.position
    for frame in range(80):
        follow(camera, grown)
        if frame == 0:
            step = np.linalg.norm(viewer.camera.position - before)
    assert viewer.shows(grown)
    assert 0.0 < step < 0.2 * np.linalg.norm(viewer.camera.position - before), "it glides"
    there = viewer.camera.position
    follow(camera, points)
    np.testing.assert_array_equal(viewer.camera.position, there)  # nothing breathes


def test_what_runs_away_does_not_shrink_the_rest() -> None:
    viewer, points = Viewer(640, 270), random_points(0)
    camera = Camera(viewer)  # type: ignore[arg-type]
    follow(camera, points)
    away = np.linalg.norm(viewer.camera.position)
    for _ in range(80):
        follow(camera, np.concatenate([points, [[0.0, 1e6, 0.0]]]))
    assert np.linalg.norm(viewer.camera.position) < 4.0 * away


def test_a_hand_is_left_alone_until_the_view_is_reset() -> None:
    viewer, points = Viewer(640, 270), random_points(0)
    camera = Camera(viewer)  # type: ignore[arg-type]
    follow(camera, points)
    fitted = viewer.camera.position
    viewer.camera.position = turned = np.array([-4.0, 1.0, 2.0])
    for changed in (False, True):
        follow(camera, 1.5 * points, changed=changed)
    viewer.camera.image_width = 900
    follow(camera, points)
    np.testing.assert_array_equal(viewer.camera.position, turned)
    camera.reset()
    viewer.camera.image_width = 640
    follow(camera, points)
    np.testing.assert_allclose(viewer.camera.position, fitted)


def test_a_camera_that_was_set_back_by_its_viewer_follows_again() -> None:
    """By its own "Reset View"; and a viewer that opens may go there late."""
    viewer, points = Viewer(640, 270), random_points(0)
    camera = Camera(viewer)  # type: ignore[arg-type]
    for _ in range(2):
        follow(camera, points)
        fitted = viewer.camera.position
        viewer.camera.position, viewer.camera.look_at = HOME
        follow(camera, points)
        np.testing.assert_array_equal(viewer.camera.position, fitted)
        viewer.camera.position = np.array([-4.0, 1.0, 2.0])
        follow(camera, points)
        viewer.camera.position, viewer.camera.look_at = HOME


def test_a_change_moves_the_camera_nearer_only_if_it_is_worth_it() -> None:
    viewer, points = Viewer(640, 270), random_points(0)
    camera = Camera(viewer)  # type: ignore[arg-type]
    follow(camera, points)
    fitted = viewer.camera.position
    follow(camera, 0.95 * points, changed=True)
    np.testing.assert_array_equal(viewer.camera.position, fitted)
    follow(camera, 0.82 * points, changed=True)  # glides
    assert np.linalg.norm(viewer.camera.position) > 0.9 * np.linalg.norm(fitted)
    for _ in range(60):
        follow(camera, 0.82 * points)
    assert np.linalg.norm(viewer.camera.position) < 0.9 * np.linalg.norm(fitted)
    follow(camera, 0.4 * points, changed=True)
    assert np.linalg.norm(viewer.camera.position) < 0.6 * np.linalg.norm(fitted)


def test_what_went_far_once_is_forgotten() -> None:
    viewer, points = Viewer(640, 270), random_points(0)
    camera = Camera(viewer)  # type: ignore[arg-type]
    follow(camera, points)
    fitted = viewer.camera.position
    for frame in range(300):
        now = 3.0 * MEMORY_SECONDS * frame / 200
        follow(camera, 1.8 * points if frame == 10 else points, now=now)
    np.testing.assert_allclose(viewer.camera.position, fitted, atol=0.02)


def test_another_window_is_fitted_at_once() -> None:
    viewer, points = Viewer(640, 270), random_points(0)
    camera = Camera(viewer)  # type: ignore[arg-type]
    follow(camera, points)
    viewer.camera.image_width, viewer.camera.image_height = 300, 600
    assert not viewer.shows(points)
    follow(camera, points)
    assert viewer.shows(points)


def test_a_viewer_that_draws_coarser_for_a_while_is_left_where_it_is() -> None:
    viewer, points = Viewer(640, 270), random_points(0)
    camera = Camera(viewer)  # type: ignore[arg-type]
    follow(camera, points)
    fitted = viewer.camera.position
    viewer.camera.image_width, viewer.camera.image_height = 426, 180
    follow(camera, 0.5 * points)
    np.testing.assert_array_equal(viewer.camera.position, fitted)


def test_labels_are_in_view_too() -> None:
    viewer, points = Viewer(390, 350), 0.3 * random_points(0)
    corner = points[np.argmax(points @ AXES[0])]
    camera = Camera(viewer)  # type: ignore[arg-type]
    follow(camera, points)
    half_text = 30 * HALF_CHARACTER_WIDTH
    assert viewer.pixels(corner[None])[0, 0] + half_text > 390 / 2
    camera.reset()
    camera.follow(FrameContents(points, [(corner, 30)]), HOME, 0.0, changed=False)
    assert viewer.pixels(corner[None])[0, 0] + half_text < 390 / 2


def test_a_narrow_window_shows_the_core_as_large_as_it_goes() -> None:
    core = random_points(1, 0.3)
    drawn = FrameContents(
        np.concatenate([core, random_points(2) + np.array([3.0, 0.0, 0.0])]), [], core
    )
    for size, all_of_it in (((660, 360), True), ((390, 350), False)):
        viewer = Viewer(*size)
        Camera(viewer).follow(drawn, HOME, 0.0, changed=False)  # type: ignore[arg-type]
        assert viewer.shows(core)
        assert viewer.shows(drawn.points) == all_of_it
