"""The phase plane in the scene beside the body that moves.

    system = plane_system("cart")
    plane = PhasePlane.of(system)                  # standing; .of(system, lying=True) for surfaces
    plane.draw_axes(scene)                         # with the camera
    plane.draw_body(scene, x)                      # the cart on its rail, below the plane
    plane.fill(scene, "X", vertices, "reference", 0.2)      # a convex set, (k, 2) in order
    plane.fill(scene, "X_f", others, "actual", 0.4, layer=1)    # above it
    plane.path(scene, "prediction", X, "reference", layer=2)    # (k, 2), or (m, k, 2) for m paths
    plane.dots(scene, "runs", many)                # (k, 2)
    plane.paint(scene, "decrease", colors)         # (rows, columns, 3) over the window
    plane.surface(scene, "V", heights, colors)     # (rows, columns) [m], on a lying plane
    plane.handle(scene, "state", x)                # dragged: plane.state_at(point) -> (2,)

All but the state is cut off at the window. What overlaps is drawn in layers, higher ones in front.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from labs.algorithms.polygons import clip
from labs.problems.polyhedron import box
from labs.scene import Color, Scene
from labs.shapes import BLUE, Vector3
from labs.tasks.phase_plane.clipping import clip_segments
from labs.tasks.phase_plane.systems import PlaneSystem

LAYER = 0.004
"""[m] from one layer to the next."""
HANDLE_RADIUS = 0.04
"""[m] its radius."""
WINDOW_SCALE = 1.25
"""The window shows so many times the natural limits."""


@dataclass(frozen=True, eq=False)
class PhasePlane:
    """An upright or a lying plate that shows the states from `lower` to `upper`."""

    system: PlaneSystem
    lower: np.ndarray
    """(2,)"""
    upper: np.ndarray
    """(2,)"""
    center: np.ndarray
    """(3,) [m] of the plate."""
    size: tuple[float, float]
    """[m] of the plate, along x_1 and along x_2."""
    lying: bool
    body_place: tuple[float, float]
    """(x, y) [m] of the body."""
    camera: tuple[Vector3, Vector3]

    @classmethod
    def of(
        cls,
        system: PlaneSystem,
        lower: np.ndarray | None = None,
        upper: np.ndarray | None = None,
        *,
        lying: bool = False,
    ) -> Self:
        """The plane of a system, of a window about its natural limits if none is given. With a
        mass, x_1 has the scale of the rail and stands right above or before it."""
        x_eq, reach = np.array(system.x_eq), WINDOW_SCALE * np.array(system.x_max)
        lower = x_eq - reach if lower is None else np.asarray(lower, float)
        upper = x_eq + reach if upper is None else np.asarray(upper, float)
        if system.body == "mass":
            width, middle = float(upper[0] - lower[0]), float(0.5 * (upper[0] + lower[0]))
            if lying:
                center, size, place = (0.05, middle, 0.02), (width, 1.7), (-1.05, 0.0)
                camera = ((2.4, 0.0, 2.2), (-0.3, 0.0, 0.2))
            else:
                center, size, place = (0.0, middle, 1.55), (width, 1.5), (0.0, 0.0)
                camera = ((4.0, 0.0, 1.5), (0.0, 0.0, 1.2))
        elif lying:
            center, size, place = (0.1, 0.4, 0.02), (1.6, 1.5), (-0.2, -0.98)
            camera = ((2.4, -0.1, 2.2), (0.0, -0.1, 0.3))
        else:
            center, size, place = (0.0, 0.5, 0.75), (2.0, 1.25), (0.0, -0.95)
            camera = ((3.5, -0.1, 0.9), (0.0, -0.1, 0.7))
        return cls(system, lower, upper, np.array(center), size, lying, place, camera)

    # Where ------------------------------------------------------------------------------------

    @property
    def normal(self) -> np.ndarray:
        """(3,) towards the viewer."""
        return np.array([0.0, 0.0, 1.0] if self.lying else [1.0, 0.0, 0.0])

    @property
    def axes(self) -> np.ndarray:
        """(2, 3) [m] for each unit of x_1 and x_2."""
        up = [-1.0, 0.0, 0.0] if self.lying else [0.0, 0.0, 1.0]
        scale = np.array(self.size) / (self.upper - self.lower)
        return np.asarray(np.array([[0.0, 1.0, 0.0], up]) * scale[:, None])

    def place(self, X: np.ndarray, lift: np.ndarray | float = 0.0) -> np.ndarray:
        """(..., 3) [m]: where states X (..., 2) are, `lift` (...) [m] above the plate."""
        middle = 0.5 * (self.lower + self.upper)
        above = np.multiply.outer(np.asarray(lift, float), self.normal)
        return np.asarray(self.center + (X - middle) @ self.axes + above)

    def state_at(self, point: tuple[float, float, float] | np.ndarray) -> np.ndarray:
        """(2,): the state of the window that is nearest to a point (3,) [m]: what a dragged handle
        stands for."""
        ways = self.axes / np.square(np.linalg.norm(self.axes, axis=1, keepdims=True))
        x = 0.5 * (self.lower + self.upper) + ways @ (np.asarray(point, float) - self.center)
        return np.asarray(np.clip(x, self.lower, self.upper))

    def grid(self, rows: int, columns: int) -> np.ndarray:
        """(rows, columns, 2): states evenly over the window, x_2 along rows, x_1 along columns, as
        `paint` and `surface` take them."""
        ways = zip(self.lower, self.upper, (columns, rows), strict=True)
        return np.stack(np.meshgrid(*(np.linspace(a, b, n) for a, b, n in ways)), axis=-1)

    # What is around ---------------------------------------------------------------------------

    def draw_axes(self, scene: Scene) -> None:
        """The camera, the plate with its frame, both axes and their ends in numbers."""
        (low_1, low_2), (high_1, high_2) = self.lower, self.upper
        scene.camera(*self.camera)
        corners = np.array([[low_1, low_2], [high_1, low_2], [high_1, high_2], [low_1, high_2]])
        scene.polygon("plane", self.place(corners, -LAYER), "muted", 0.12)
        scene.trail("frame of plane", self.place(np.vstack([corners, corners[:1]])), "muted")
        zero = np.clip(np.zeros(2), self.lower, self.upper)
        cross = np.array(
            [[[low_1, zero[1]], [high_1, zero[1]]], [[zero[0], low_2], [zero[0], high_2]]]
        )
        scene.trail("axes of plane", self.place(cross), "muted", 0.6)
        names, units = self.system.names, self.system.units
        out = np.array([0.05, 0.07]) * (self.upper - self.lower)
        ends = {
            "left": (f"{low_1:.3g}", (low_1, low_2 - out[1])),
            "right": (f"{names[0]} = {high_1:.3g} {units[0]}", (high_1, low_2 - out[1])),
            "bottom": (f"{low_2:.3g}", (low_1 - out[0], low_2 + 0.3 * out[1])),
            "top": (f"{names[1]} = {high_2:.3g} {units[1]}", (low_1, high_2 + out[1])),
        }
        if self.lying:  # A surface may hide the far end.
            ends["bottom"] = f"{names[1]} = {low_2:.3g} {units[1]}", ends["bottom"][1]
            del ends["top"]
        for end, (text, x) in ends.items():
            scene.label(f"{end} of plane", text, self.place(np.array(x)))

    def draw_body(
        self,
        scene: Scene,
        x: np.ndarray,
        name: str = "body",
        *,
        ghost: bool = False,
        color: Vector3 = BLUE,
    ) -> None:
        """What moves, at the state x (2,)."""
        scene.arm(
            name, self.system.placed_body(self.body_place, color), self.system.pose(x), ghost=ghost
        )

    # In the plane -----------------------------------------------------------------------------

    def fill(
        self,
        scene: Scene,
        name: str,
        vertices: np.ndarray,
        color: Color | Vector3 = "actual",
        opacity: float = 0.3,
        *,
        layer: int = 0,
        outline: Color | None = None,
    ) -> None:
        """A convex set, by its corners (k, 2) in order, k from 0; with an outline of its own
        colour, or of the one given."""
        corners = clip(vertices, box(self.lower, self.upper))
        if len(corners) >= 3:
            scene.polygon(name, self.place(corners, LAYER * layer), color, opacity)
        edge = outline or (color if isinstance(color, str) else None)
        if edge and len(vertices) >= 2:
            closed = np.vstack([vertices, vertices[:1]])
            self.path(scene, f"edge of {name}", closed, edge, layer=layer)

    def path(
        self,
        scene: Scene,
        name: str,
        X: np.ndarray,
        color: Color = "actual",
        strength: float = 1.0,
        *,
        layer: int = 0,
    ) -> None:
        """A line through X (k, 2), or m of them through (m, k, 2)."""
        a, b = (part.reshape(-1, 2) for part in (X[..., :-1, :], X[..., 1:, :]))
        starts, ends = clip_segments(a, b, self.lower, self.upper)
        if len(starts):
            ways = self.place(np.stack([starts, ends], axis=1), LAYER * (layer + 0.5))
            scene.trail(name, ways, color, strength)

    def dots(
        self,
        scene: Scene,
        name: str,
        X: np.ndarray,
        color: Color = "actual",
        *,
        diameter: float = 0.025,
        layer: int = 0,
    ) -> None:
        """Many states (k, 2) at once; those beside the window are left out."""
        with np.errstate(invalid="ignore"):
            inside = ((self.lower <= X) & (self.upper >= X)).all(axis=1)
        if inside.any():
            scene.dots(name, self.place(X[inside], LAYER * (layer + 1)), diameter, color)

    def arrows(
        self,
        scene: Scene,
        name: str,
        X: np.ndarray,
        ahead: np.ndarray,
        color: Color = "muted",
        *,
        layer: int = 0,
    ) -> None:
        """Arrows from states X (k, 2) to `ahead` (k, 2), cut off at the window."""
        starts, ends = clip_segments(X, ahead, self.lower, self.upper)
        if len(starts):
            lift = LAYER * (layer + 1)
            scene.arrows(name, self.place(starts, lift), self.place(ends, lift), color)

    def paint(self, scene: Scene, name: str, colors: np.ndarray) -> None:
        """Colours (rows, columns, 3), sRGB, at the states of `grid`; below all layers."""
        points = self.place(self.grid(*colors.shape[:2]), -0.5 * LAYER)
        scene.surface(name, points, colors)

    def surface(self, scene: Scene, name: str, heights: np.ndarray, colors: np.ndarray) -> None:
        """Over the states of `grid`, at `heights` (rows, columns) [m], in colours of that shape;
        put paths on it by `place(X, lift)`."""
        scene.surface(name, self.place(self.grid(*heights.shape), heights), colors)

    def ball(
        self, scene: Scene, name: str, x: np.ndarray, color: Color = "actual", radius: float = 0.03
    ) -> None:
        """A state (2,), at the edge if it is beyond."""
        scene.sphere(name, self.place(np.clip(x, self.lower, self.upper)), radius, color)

    def handle(self, scene: Scene, name: str, x: np.ndarray, radius: float = HANDLE_RADIUS) -> None:
        """The state (2,), at the edge if it is beyond, as a ball that is dragged."""
        scene.handle(name, self.place(np.clip(x, self.lower, self.upper)), radius)

    def label(self, scene: Scene, name: str, text: str, x: np.ndarray) -> None:
        """A short text at a state (2,)."""
        scene.label(name, text, self.place(np.clip(x, self.lower, self.upper), LAYER))
