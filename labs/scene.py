"""What a lab may draw: a few things by name, in metres, radians and the world's frame (z up).

A drawing is said anew each frame; what a frame does not name disappears from view. The live
scene sends only what changed. `NullScene` is its twin for headless runs.
"""

from typing import Literal, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from labs.models.arms import Arm

Color = Literal["actual", "reference", "force", "warning", "muted"]


class Scene(Protocol):
    """Where a lab draws."""

    def camera(self, position: ArrayLike, look_at: ArrayLike) -> None:
        """The view a new viewer gets, and every viewer when it changes: two (3,) points [m]."""
        ...

    def arm(
        self,
        name: str,
        arm: Arm,
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
        """A polyline through `points` (k, 3) [m]. Of a lower `strength`, in (0, 1], it is paler:
        so that what was tried before fades behind what is tried now."""
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


class NullScene:
    """A scene nobody sees; it keeps the names drawn, so that tests can ask."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def camera(self, position: ArrayLike, look_at: ArrayLike) -> None:
        self.names.append("camera")

    def arm(
        self,
        name: str,
        arm: Arm,
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
