"""What a lab may draw: a few things by name, in metres, radians and the world's frame (z up).

A drawing is said anew each frame; what a frame does not name disappears from view. The live
scene sends only what changed. `NullScene` is its twin for headless runs.
"""

import math
from typing import Literal, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from labs.shapes import Body, Vector3

Color = Literal["actual", "reference", "force", "warning", "muted"]


class Scene(Protocol):
    """Where a lab draws."""

    def camera(self, position: ArrayLike, look_at: ArrayLike, core: ArrayLike = ()) -> None:
        """The view a new viewer gets, and every viewer when it changes: two (3,) points [m]. A
        narrow window shows the `core` (..., 3) [m], if given; what is drawn around it may leave."""
        ...

    def arm(
        self,
        name: str,
        arm: Body,
        q: np.ndarray,
        *,
        ghost: bool = False,
        effort: np.ndarray | None = None,
    ) -> None:
        """A robot at q (nq,) [rad]. A ghost is translucent. `effort` (nv,) is |tau|/tau_max:
        joints near their limit wear a ring, amber from 0.8, red at 1."""
        ...

    def trail(
        self, name: str, points: np.ndarray, color: Color = "actual", strength: float = 1.0
    ) -> None:
        """A polyline through `points` (k, 3) [m], or m of them, (m, k, 3). Of a lower `strength`,
        in (0, 1], it is paler: so that what was tried before fades behind what is tried now. A
        muted one may leave the view; all else that is drawn is kept in it."""
        ...

    def arrow(self, name: str, start: ArrayLike, end: ArrayLike, color: Color = "force") -> None:
        """An arrow between two (3,) points [m]."""
        ...

    def sphere(self, name: str, center: ArrayLike, radius: float, color: Color = "actual") -> None:
        """A ball: center (3,) [m], radius [m]."""
        ...

    def frame(self, name: str, placement: pin.SE3, length: float = 0.15) -> None:
        """The axes of a frame in the world: x red, y green, z blue; `length` [m]."""
        ...

    def arc(
        self,
        name: str,
        center: ArrayLike,
        axis: ArrayLike,
        angle: float,
        radius: float,
        color: Color = "force",
    ) -> None:
        """A circular arrow about `axis` through `center` (3,) [m], of `angle` [rad] in the
        right-handed sense, within (-2 pi, 2 pi): a torque at a joint."""
        ...

    def ellipsoid(
        self, name: str, center: ArrayLike, axes: np.ndarray, color: Color = "actual"
    ) -> None:
        """A translucent ellipsoid: the image of the unit ball under `axes` (3, 3) [m], moved to
        `center` (3,) [m]."""
        ...

    def handle(self, name: str, position: ArrayLike, radius: float = 0.05) -> None:
        """A ball at `position` (3,) [m] the user can drag. While it is held, its place is in
        `Inputs.handles[name]`."""
        ...

    def label(self, name: str, text: str, position: ArrayLike) -> None:
        """A short text at a (3,) point [m]."""
        ...

    def cells(
        self,
        name: str,
        origin: ArrayLike,
        size: float,
        colors: np.ndarray,
        *,
        clickable: bool = True,
    ) -> None:
        """A horizontal board of square cells with sides of `size` [m], thin gaps between them.
        `colors` (rows, columns, 3) in [0, 1], sRGB. Row 0 lies farthest along y, column 0 first
        along x; `origin` (3,) [m] is the corner of least x and y, so that cell (r, c) covers
        origin + size [c, c + 1] in x and origin + size [rows - 1 - r, rows - r] in y
        (`cell_at`, `cell_centers`). A click on a clickable board holds the handle of its name
        at the point clicked, and releases it at once: `Lab.edit` says what that changes."""
        ...

    def surface(self, name: str, points: np.ndarray, colors: np.ndarray) -> None:
        """A surface through `points` (rows, columns, 3) [m], at least two of each, coloured by
        `colors` of the same shape in [0, 1], sRGB, blended in between; seen from both sides."""
        ...

    def arrows(
        self, name: str, starts: np.ndarray, ends: np.ndarray, color: Color = "force"
    ) -> None:
        """Many arrows at once, from `starts` to `ends`, both (k, 3) [m], k from 0; one of no
        length is left out. All have the same head, in proportion to the longest arrow."""
        ...

    def polygon(
        self,
        name: str,
        corners: np.ndarray,
        color: Color | Vector3 = "actual",
        opacity: float = 1.0,
    ) -> None:
        """A flat convex polygon, filled, seen from both sides: `corners` (k, 3) [m] in order round
        it, k at least 3. `color` by name, or sRGB in [0, 1]; `opacity` in (0, 1]. Of two in the
        same plane it is not told which hides the other: leave a millimetre or two between."""
        ...

    def dots(
        self, name: str, centers: np.ndarray, diameter: float, color: Color = "actual"
    ) -> None:
        """Many dots at once, at `centers` (k, 3) [m], k from 0, `diameter` [m] wide."""
        ...


class NullScene:
    """A scene nobody sees; it keeps the names drawn, so that tests can ask."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def camera(self, position: ArrayLike, look_at: ArrayLike, core: ArrayLike = ()) -> None:
        self.names.append("camera")

    def arm(
        self,
        name: str,
        arm: Body,
        q: np.ndarray,
        *,
        ghost: bool = False,
        effort: np.ndarray | None = None,
    ) -> None:
        self.names.append(name)

    def trail(
        self, name: str, points: np.ndarray, color: Color = "actual", strength: float = 1.0
    ) -> None:
        self.names.append(name)

    def arrow(self, name: str, start: ArrayLike, end: ArrayLike, color: Color = "force") -> None:
        self.names.append(name)

    def sphere(self, name: str, center: ArrayLike, radius: float, color: Color = "actual") -> None:
        self.names.append(name)

    def frame(self, name: str, placement: pin.SE3, length: float = 0.15) -> None:
        self.names.append(name)

    def arc(
        self,
        name: str,
        center: ArrayLike,
        axis: ArrayLike,
        angle: float,
        radius: float,
        color: Color = "force",
    ) -> None:
        self.names.append(name)

    def ellipsoid(
        self, name: str, center: ArrayLike, axes: np.ndarray, color: Color = "actual"
    ) -> None:
        self.names.append(name)

    def handle(self, name: str, position: ArrayLike, radius: float = 0.05) -> None:
        self.names.append(name)

    def label(self, name: str, text: str, position: ArrayLike) -> None:
        self.names.append(name)

    def cells(
        self,
        name: str,
        origin: ArrayLike,
        size: float,
        colors: np.ndarray,
        *,
        clickable: bool = True,
    ) -> None:
        self.names.append(name)

    def surface(self, name: str, points: np.ndarray, colors: np.ndarray) -> None:
        self.names.append(name)

    def arrows(
        self, name: str, starts: np.ndarray, ends: np.ndarray, color: Color = "force"
    ) -> None:
        self.names.append(name)

    def polygon(
        self,
        name: str,
        corners: np.ndarray,
        color: Color | Vector3 = "actual",
        opacity: float = 1.0,
    ) -> None:
        self.names.append(name)

    def dots(
        self, name: str, centers: np.ndarray, diameter: float, color: Color = "actual"
    ) -> None:
        self.names.append(name)


def arc_point(center: ArrayLike, axis: ArrayLike, angle: ArrayLike, radius: float) -> np.ndarray:
    """(..., 3) [m]: where `Scene.arc` is after angles (...) [rad] about its axis."""
    z: np.ndarray = np.asarray(axis, float) / np.linalg.norm(axis)
    x = np.cross(z, [0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    turned = np.multiply.outer(np.cos(angle), x) + np.multiply.outer(np.sin(angle), np.cross(z, x))
    return np.asarray(np.asarray(center, float) + radius * turned)


def cell_at(
    point: ArrayLike, origin: ArrayLike, size: float, rows: int, columns: int
) -> tuple[int, int] | None:
    """The (row, column) of the cell of `Scene.cells` over or under `point` (3,) [m]; None beside
    the board."""
    x, y, _ = (np.asarray(point, float) - np.asarray(origin, float)) / size
    row, column = math.floor(rows - y), math.floor(x)
    return (row, column) if 0 <= row < rows and 0 <= column < columns else None


def cell_centers(origin: ArrayLike, size: float, rows: int, columns: int) -> np.ndarray:
    """The middle (rows, columns, 3) [m] of every cell of `Scene.cells`."""
    x, y, z = np.asarray(origin, float)
    across = x + size * (np.arange(columns) + 0.5)
    away = y + size * (rows - np.arange(rows) - 0.5)
    return np.stack([*np.meshgrid(across, away), np.full((rows, columns), z)], axis=-1)
