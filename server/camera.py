"""The cameras of those who look. A lab says from where one looks, and so in which direction; a
camera goes as near as it can with all that is drawn in view, until a hand takes it."""

import itertools
import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np
import viser
from numpy.typing import ArrayLike

from server.framing import FOV, NARROW_ASPECT, Window, camera_axes, nearest_camera, side_extremes

BOUNDS_MARGIN = 1.0
"""What moves is followed to so many times the size of what was there when something new was drawn:
what runs away does not shrink the rest."""
SMOOTHING = 0.12
"""The part of the way to its place that the camera goes in a frame."""
MEMORY_SECONDS = 2.5
"""[s] for which what was in view keeps its place, and up to twice as long."""
ZOOM_IN_RATIO = 0.75
"""The camera comes nearer again if it can, to this part of its distance."""
JUMP_DISTANCE = 0.1
"""Where something new is drawn, or a run begins, it forgets what was if it fits better from a place
that is so far away, in parts of its distance."""
POSE_TOLERANCE = 2e-3
"""Poses that differ by less, in parts of the distance, are one."""
BALL_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) / np.sqrt(3.0)
"""(8, 3) of a ball of radius 1."""
NO_POINTS = np.empty((0, 3))
HALF_CHARACTER_WIDTH, LINE_HEIGHT = 3.6, 18.0
"""[px] half the width of a character of a label, and the height of its line."""


@dataclass(frozen=True)
class FrameContents:
    """What a frame shows: points (k, 3) [m], and labels as a point and the text's length each; and
    what a narrow window shows of it, (n, 3) [m], none for all."""

    points: np.ndarray
    labels: list[tuple[np.ndarray, int]]
    core: np.ndarray = field(default_factory=lambda: NO_POINTS)

    def visible_in(self, window: Window) -> "FrameContents":
        """What is to be in view in a window."""
        if not len(self.core) or window.aspect >= NARROW_ASPECT:
            return self
        low, high = self.core[:, :2].min(axis=0), self.core[:, :2].max(axis=0)
        return FrameContents(
            self.core, [(p, n) for p, n in self.labels if ((low <= p[:2]) & (p[:2] <= high)).all()]
        )


class Camera:
    """The camera of one viewer. It follows what is drawn until a hand takes it."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client
        self._window = Window(0.0, 0.0)
        self._home = np.zeros((2, 3))
        self._axes = np.eye(3)
        self._reach = self._latest = self._before = np.zeros(6)
        self._due = 0.0
        self._bounds = np.zeros((2, 3))
        self._at: np.ndarray | None = None
        self._poses: deque[np.ndarray] = deque([self._pose()], maxlen=300)

    def metres_per_pixel(self, point: np.ndarray) -> float:
        """At a point (3,) [m], wherever the camera is now."""
        away = float(np.linalg.norm(point - self._client.camera.position))
        return self._window.pixel_tangent * away if self._window.height else 0.0

    def reset(self) -> None:
        """Forgets that a hand has moved it, and begins anew."""
        self._at = None

    def project(self, points: np.ndarray) -> np.ndarray | None:
        """(k, 2) [px, to the right and up, from the middle] of points (k, 3) [m]; None for a
        window that is not there yet."""
        if not self._window.height:
            return None
        position, look_at = self._pose()
        local = (points - position) @ camera_axes(position, look_at).T
        return np.asarray(
            local[:, :2] / np.maximum(local[:, 2:], 1e-3) / self._window.pixel_tangent
        )

    def follow(self, drawn: FrameContents, home: np.ndarray, now: float, *, changed: bool) -> None:
        """Moves the camera to where all that is drawn, and was since the beginning, is in view, in
        the direction of `home`, (2, 3) [m]: a position and the point looked at. A viewer stands
        there at first, and when it resets its view by itself. `changed`: something else is drawn
        than a frame ago, not only elsewhere. `now` [s] is of any clock."""
        camera = self._client.camera
        if min(camera.image_width, camera.image_height) < 2 or not len(drawn.points):
            return
        window = Window.of(camera.image_width, camera.image_height)
        drawn = drawn.visible_in(window)
        # One that draws coarser for a while is not another window.
        resized = abs(window.aspect - self._window.aspect) > 0.02 * window.aspect
        window = self._window = window if resized else self._window
        if not np.array_equal(home, self._home):
            self._home, self._axes = home, camera_axes(*home)
            self._at = None
        elif self._is_at(home):
            self._at = None
        elif self._at is not None and not any(map(self._is_at, reversed(self._poses))):
            return  # a hand has moved it
        begins = self._at is None
        local = self._add_label_boxes(drawn, self._axes)
        if begins or resized or changed:
            low, high = local.min(axis=0), local.max(axis=0)
            room = BOUNDS_MARGIN * float((high - low).max())
            self._bounds = np.array([low - room, high + room])
        reach = side_extremes(np.clip(local, *self._bounds), window)
        if changed and not begins:
            begins = self._distance(reach) < ZOOM_IN_RATIO * self._distance(self._reach)
        jumps = begins or resized
        if jumps or (changed and self._is_far_from_best(reach, window)):
            self._reach = self._latest = self._before = reach
            self._due = now + MEMORY_SECONDS
        self._update_extremes(reach, now)
        goal = nearest_camera(self._reach, window)
        if jumps or self._at is None:
            self._at = goal
        elif np.linalg.norm(goal - self._at) < 0.5 * POSE_TOLERANCE * self._distance(self._reach):
            return
        else:
            self._at = self._at + SMOOTHING * (goal - self._at)
        self._apply_pose()

    def _is_far_from_best(self, reach: np.ndarray, window: Window) -> bool:
        """Whether this frame alone is seen best from another place than all that was."""
        away = nearest_camera(reach, window) - nearest_camera(self._reach, window)
        return float(np.linalg.norm(away)) > JUMP_DISTANCE * self._distance(self._reach)

    def _update_extremes(self, reach: np.ndarray, now: float) -> None:
        """Extremes of this frame. A plan's first guesses may reach far, and never again."""
        self._reach = np.maximum(reach, self._reach)
        self._latest = np.maximum(reach, self._latest)
        if now > self._due:
            self._due = now + MEMORY_SECONDS
            lately = np.maximum(self._latest, self._before)
            if self._distance(lately) < ZOOM_IN_RATIO * self._distance(self._reach):
                self._reach = lately
            self._before, self._latest = self._latest, reach

    def _distance(self, reach: np.ndarray) -> float:
        """[m] from the camera to the middle of what is in view."""
        return float(0.5 * (reach[5] - reach[4]) - nearest_camera(reach, self._window)[2])

    def _add_label_boxes(self, drawn: FrameContents, axes: np.ndarray) -> np.ndarray:
        """What is to be in view in the camera's axes; labels as wide as they will be about."""
        local = drawn.points @ axes.T
        distance = self._distance(side_extremes(local, self._window))
        boxes = [
            axes @ point
            + distance
            * self._window.pixel_tangent
            * np.array([side * HALF_CHARACTER_WIDTH * n, up, 0.0])
            for point, n in drawn.labels
            for side in (-1.0, 1.0)
            for up in (-LINE_HEIGHT, LINE_HEIGHT)
        ]
        return np.concatenate([local, boxes]) if boxes else local

    def _apply_pose(self) -> None:
        assert self._at is not None
        middle = 0.5 * (self._reach[5] - self._reach[4])
        ahead = np.array([0.0, 0.0, middle - self._at[2]])
        pose = np.array([self._at, self._at + ahead]) @ self._axes
        self._poses.append(pose)
        self._client.camera.position, self._client.camera.look_at = pose

    def _pose(self) -> np.ndarray:
        """(2, 3): position and the point looked at [m]."""
        camera = self._client.camera
        return np.array([camera.position, camera.look_at])

    def _is_at(self, pose: np.ndarray) -> bool:
        """Whether the viewer stands at a pose (2, 3) [m]."""
        near = POSE_TOLERANCE * float(np.linalg.norm(pose[0] - pose[1]))
        return bool(np.abs(self._pose() - pose).max() < near)


class Cameras:
    """Those of all who look."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._cameras: dict[int, Camera] = {}
        self._home = np.array([[3.0, 3.0, 3.0], [0.0, 0.0, 0.0]])
        self._core = NO_POINTS
        self._points: list[np.ndarray] = []
        self._solid: list[np.ndarray] = []
        self._labels: list[tuple[np.ndarray, int]] = []
        self.solid = NO_POINTS
        """(k, 3) [m]: the solid points of the last frame."""
        server.initial_camera.fov = FOV

    def set_home_view(self, position: ArrayLike, look_at: ArrayLike, core: ArrayLike = ()) -> None:
        """From where a lab wants to be looked at: two (3,) points [m]; and what of it a narrow
        window shows, (..., 3) [m], none for all."""
        self._core = np.asarray(core, float).reshape(-1, 3)
        home = np.array([position, look_at], float)
        if not np.array_equal(home, self._home):
            self._home = home
            self._server.initial_camera.position, self._server.initial_camera.look_at = home

    def include_points(self, points: np.ndarray) -> None:
        """Points (..., 3) [m] of this frame that are to be in view."""
        self._points.append(points.reshape(-1, 3))

    def include_ball(self, center: ArrayLike, radius: float) -> None:
        """A ball: center (3,) [m], radius [m]."""
        self._points.append(np.asarray(center, float) + radius * BALL_CORNERS)

    def add_obstacles(self, points: np.ndarray) -> None:
        """Points (k, 3) [m] on what a label had better not hide."""
        self._solid.append(points)

    def include_label(self, point: np.ndarray, text: str) -> None:
        """A label at a point (3,) [m]."""
        self._labels.append((point, len(text)))

    def reset(self) -> None:
        """Every camera begins anew, whoever has moved it."""
        for camera in self._cameras.values():
            camera.reset()

    def follow(self, *, changed: bool, held: bool = False) -> None:
        """Places the cameras for what was seen since the last call; not while a hand has `held` of
        something, which would slip away under it."""
        drawn = FrameContents(np.concatenate(self._points or [NO_POINTS]), self._labels, self._core)
        self.solid = np.concatenate(self._solid or [self.solid[:0]])
        self._points, self._solid, self._labels = [], [], []
        now = time.monotonic()
        clients = self._server.get_clients()
        self._cameras = {i: self._cameras.get(i) or Camera(client) for i, client in clients.items()}
        for camera in self._cameras.values():
            if not held:
                camera.follow(drawn, self._home, now, changed=changed)

    def project(self, points: np.ndarray) -> np.ndarray | None:
        """(k, 2) [px] where the first who looks sees points (k, 3) [m]; None where nobody does."""
        camera = next(iter(self._cameras.values()), None)
        return camera.project(points) if camera else None

    def metres_per_pixel(self, point: np.ndarray) -> float:
        """At a point (3,) [m], for whom a pixel is the largest there; 0 where nobody looks."""
        return max((c.metres_per_pixel(point) for c in self._cameras.values()), default=0.0)
