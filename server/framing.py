"""The nearest camera that has all that is drawn in the free part of its window.

In the camera's axes (right, up, forward) a point (x, y, z) is in the window of a camera at c where

    -l (z - c_z) <= x - c_x <= r (z - c_z)   and   -b (z - c_z) <= y - c_y <= t (z - c_z)

with the tangents l, r, b, t of the window's free part. This is linear in c: the nearest camera
follows from one extreme over the points for each side, and what moves widens those extremes as it
goes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

FOV = np.radians(35.0)
"""Of the whole height: narrow, so that near and far parts are of similar size."""
PANEL, BUTTONS, SHEET, MARGIN = 46, 24, 44, 12
"""[px] that the folded panel takes on the right, the buttons at the bottom, both at the bottom of a
narrow window, and air around."""
NARROW_ASPECT, NARROW_HEIGHT = 1.5, 300
"""Width over height of a narrow window, a phone's, and its height [px]."""
MIN_HEIGHT, MAX_HEIGHT = 270, 450
"""[px] A viewer tells the size of what it draws on, which may be finer than its screen, or coarser
where it draws slowly: heights beyond these are not believed."""


@dataclass(frozen=True)
class Window:
    """A viewer's window: its width over its height, and its height [px], about."""

    aspect: float
    height: float

    @classmethod
    def of(cls, width: int, height: int) -> "Window":
        """As a viewer tells it."""
        aspect = width / height
        return cls(
            aspect,
            NARROW_HEIGHT if aspect < NARROW_ASPECT else min(max(height, MIN_HEIGHT), MAX_HEIGHT),
        )

    @property
    def pixel_tangent(self) -> float:
        """The tangent of one pixel: how wide it is [m] a metre away."""
        return float(2.0 * np.tan(FOV / 2)) / self.height

    @property
    def tangents(self) -> np.ndarray:
        """(4,): of the free part: right, left, top, bottom."""
        taken = (0, 0, 0, SHEET) if self.aspect < NARROW_ASPECT else (PANEL, 0, 0, BUTTONS)
        half = 0.5 * self.height * np.array([self.aspect, self.aspect, 1.0, 1.0])
        return np.asarray(self.pixel_tangent * (half - taken - MARGIN))


def side_extremes(points: np.ndarray, window: Window) -> np.ndarray:
    """(6,): the largest x - r z, -x - l z, y - t z, -y - b z, -z and z of points (k, 3) in the
    camera's axes."""
    x, y, z = points.T
    right, left, top, bottom = window.tangents
    sides = (x - right * z, -x - left * z, y - top * z, -y - bottom * z, -z, z)
    return np.array([side.max() for side in sides])


def nearest_camera(reach: np.ndarray, window: Window) -> np.ndarray:
    """(3,): the nearest camera, in its own axes, that has all of these extremes in its window."""
    right, left, top, bottom = window.tangents
    z = min(
        -(reach[0] + reach[1]) / (right + left),
        -(reach[2] + reach[3]) / (top + bottom),
        -reach[4] - 0.05,
    )
    x = 0.5 * (reach[0] + right * z - reach[1] - left * z)
    y = 0.5 * (reach[2] + top * z - reach[3] - bottom * z)
    return np.array([x, y, z])


def camera_axes(position: ArrayLike, look_at: ArrayLike) -> np.ndarray:
    """(3, 3): right, up and forward of a camera that stands upright, as rows."""
    forward = np.asarray(look_at, float) - np.asarray(position, float)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    across = float(np.linalg.norm(right))
    right = right / across if across > 1e-9 else np.array([1.0, 0.0, 0.0])  # straight down
    return np.array([right, np.cross(right, forward), forward])
