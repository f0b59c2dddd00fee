"""A scene for tests that look at what is drawn."""

import numpy as np
from numpy.typing import ArrayLike

from labs.scene import Color, NullScene
from labs.shapes import Vector3


class RecordingScene(NullScene):
    """Keeps what is drawn, by name."""

    def __init__(self) -> None:
        super().__init__()
        self.colors: dict[str, np.ndarray] = {}
        self.points: dict[str, np.ndarray] = {}
        self.labels: dict[str, str] = {}

    def cells(
        self,
        name: str,
        origin: ArrayLike,
        size: float,
        colors: np.ndarray,
        *,
        clickable: bool = True,
    ) -> None:
        super().cells(name, origin, size, colors, clickable=clickable)
        self.colors[name] = colors
        self.points[name] = np.asarray(origin)

    def surface(self, name: str, points: np.ndarray, colors: np.ndarray) -> None:
        super().surface(name, points, colors)
        self.points[name], self.colors[name] = points, colors

    def arrows(
        self, name: str, starts: np.ndarray, ends: np.ndarray, color: Color = "force"
    ) -> None:
        super().arrows(name, starts, ends, color)
        self.points[name] = np.stack([starts, ends])

    def trail(
        self, name: str, points: np.ndarray, color: Color = "actual", strength: float = 1.0
    ) -> None:
        super().trail(name, points, color, strength)
        self.points[name] = points

    def sphere(self, name: str, center: ArrayLike, radius: float, color: Color = "actual") -> None:
        super().sphere(name, center, radius, color)
        self.points[name] = np.asarray(center)

    def polygon(
        self,
        name: str,
        corners: np.ndarray,
        color: Color | Vector3 = "actual",
        opacity: float = 1.0,
    ) -> None:
        super().polygon(name, corners, color, opacity)
        self.points[name] = corners

    def label(self, name: str, text: str, position: ArrayLike) -> None:
        super().label(name, text, position)
        self.labels[name] = text


def all_finite(scene: RecordingScene) -> bool:
    return all(
        np.isfinite(part).all() for parts in (scene.points, scene.colors) for part in parts.values()
    )
