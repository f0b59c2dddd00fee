"""The four motions in their scene, and where they go on the value function's surface.

Under the surface lies the plane of states: q along the world's y, v away from the viewer. Its
height is V / (V + J) with J the least cost from the start, so that what is far dearer does not
tower above.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labs.colors import sequential
from labs.models.mass_on_a_line import mass_on_a_line
from labs.models.pendulums import pendulum_arm
from labs.optimal_control.families.motion import MethodMotion
from labs.optimal_control.families.params import FamiliesParams
from labs.optimal_control.families.side_by_side import FAMILY_NAMES, Results
from labs.scene import Color, Scene
from labs.shapes import Vector3

COLORS: Mapping[str, Color] = {
    "hjb": "actual",
    "dp": "reference",
    "pontryagin": "force",
    "direct": "muted",
}
BODIES: Mapping[str, Vector3] = {
    "hjb": (0.15, 0.39, 0.92),
    "dp": (0.92, 0.5, 0.11),
    "pontryagin": (0.75, 0.09, 0.51),
    "direct": (0.55, 0.6, 0.66),
}
MESH = 51
"""Points of the surface along one side, about."""
ABOVE = np.array([0.0, 0.0, 0.03])
"""[m] Lines float this far above the surface."""


@dataclass(frozen=True)
class PanelLayout:
    """Where things are [m]."""

    camera: tuple[Vector3, Vector3]
    window: tuple[tuple[float, float], tuple[float, float]]
    """Least and largest q and v that are shown."""
    size: tuple[float, float]
    """Of the surface, along q and along v."""
    center: Vector3
    """Of its window, where V = 0."""
    height: float
    """Of the surface where V is endless."""
    first: float
    """x of the first body; the others stand behind it."""
    spacing: float


LAYOUTS: Mapping[str, PanelLayout] = {
    "pendulum": PanelLayout(
        ((1.55, 0.5, 1.75), (0.0, -0.1, 0.62)),
        ((-1.5, -6.6), (5.0, 6.6)),
        (1.6, 1.25),
        (0.0, 0.3, 0.4),
        0.5,
        0.35,
        0.3,
    ),
    "mass": PanelLayout(
        ((2.6, 0.0, 2.0), (-0.75, 0.0, 0.3)),
        ((-1.6, -4.0), (1.6, 4.0)),
        (3.2, 1.7),
        (0.0, 0.0, 0.05),
        0.4,
        -1.1,
        0.4,
    ),
}
HINGE = -0.85
"""[m] y of the pendulums."""


@dataclass(frozen=True, eq=False)
class CostToGoSurface:
    """V over the plane of states, to draw and to put states on."""

    params: FamiliesParams
    q: np.ndarray
    v: np.ndarray
    heights: np.ndarray
    """(q, v) in [0, 1)."""

    @classmethod
    def of(cls, params: FamiliesParams, at: Results) -> "CostToGoSurface":
        """What is known of V."""
        V = at.values[params.surface]
        costs = [motion.cost for motion in at.motions.values() if motion.known]
        size = max(min(costs, default=1.0), 1e-9)
        (lower, upper), axes = LAYOUTS[params.system].window, params.grid(len(V)).axes
        some = []
        for axis, low, high in zip(axes, lower, upper, strict=True):
            first, last = np.flatnonzero((axis > low - 1e-9) & (axis < high + 1e-9))[[0, -1]]
            some.append(np.unique(np.round(np.linspace(first, last, MESH)).astype(int)))
        V = np.maximum(V[np.ix_(*some)], 0.0)
        return cls(params, axes[0][some[0]], axes[1][some[1]], V / (V + size))

    @cached_property
    def points(self) -> np.ndarray:
        """(q, v, 3) [m]"""
        points = floor_points(
            self.params, np.stack(np.meshgrid(self.q, self.v, indexing="ij"), axis=-1)
        )
        points[..., 2] += LAYOUTS[self.params.system].height * self.heights
        return points

    def on_surface(self, X: np.ndarray) -> np.ndarray:
        """(k, 3) [m]: states X (k, 2) on the surface."""
        points = self.points
        axes = zip((self.q, self.v), X.T, strict=True)
        cells = [np.interp(x, axis, np.arange(len(axis))) for axis, x in axes]
        i, j = (
            np.minimum(c.astype(int), n - 2) for c, n in zip(cells, self.heights.shape, strict=True)
        )
        s, r = (cells[0] - i)[:, None], (cells[1] - j)[:, None]
        near = (1.0 - r) * points[i, j] + r * points[i, j + 1]
        far = (1.0 - r) * points[i + 1, j] + r * points[i + 1, j + 1]
        return np.asarray((1.0 - s) * near + s * far + ABOVE)


def draw_bodies(scene: Scene, params: FamiliesParams, at: Results, now: float) -> None:
    """Four bodies one behind another, each by its method's motion at t = now [s]."""
    layout = LAYOUTS[params.system]
    scene.camera(*layout.camera)
    for i, (name, motion) in enumerate(at.motions.items()):
        x, q = layout.first - layout.spacing * i, motion.at(now)[:1]
        if params.system == "pendulum":
            body, q, label = (
                pendulum_arm(1, (x, HINGE), BODIES[name]),
                q + np.pi,
                (x, HINGE + 0.14, 0.78),
            )
        else:
            body, label = mass_on_a_line(x, BODIES[name]), (x, -1.7, 0.62)
        scene.arm(name, body, q, ghost=not motion.known)
        scene.label(f"name of {name}", FAMILY_NAMES[name], label)


def draw_values(scene: Scene, params: FamiliesParams, at: Results, now: float) -> None:
    """The surface, the motions on it, the state to start from, and the tail from M."""
    surface = CostToGoSurface.of(params, at)
    scene.surface("surface", surface.points, sequential(surface.heights, 0.0, 0.9))
    for name, motion in reversed(list(at.motions.items())):
        if motion.known:
            scene.trail(f"path of {name}", surface.on_surface(motion.X), COLORS[name])
            place = surface.on_surface(motion.at(now)[None])[0]
            scene.sphere(f"state of {name}", place, 0.028, COLORS[name])
    up = np.array([0.0, 0.0, 0.1])
    scene.handle("start", surface.on_surface(params.x0[None])[0], 0.04)
    goal = "upright" if params.system == "pendulum" else "middle"
    scene.label("goal", goal, surface.on_surface(np.zeros((1, 2)))[0] + up)
    _draw_tail(scene, surface, at.tail if params.moment else None)


def _draw_tail(scene: Scene, surface: CostToGoSurface, tail: MethodMotion | None) -> None:
    if tail and tail.converged:
        path = surface.on_surface(tail.X) + ABOVE
        scene.trail("tail", path, "warning")
        scene.label("moment", "M", path[0] + np.array([0.0, 0.0, 0.1]))


def floor_points(params: FamiliesParams, X: np.ndarray) -> np.ndarray:
    """(..., 3) [m]: where states X (..., 2) are on the floor, cut to the window shown."""
    layout = LAYOUTS[params.system]
    middle, scale = _floor_scale(params)
    y, x = np.moveaxis((np.clip(X, *layout.window) - middle) * scale, -1, 0)
    return np.stack([x, y, np.zeros_like(x)], axis=-1) + layout.center


def state_at(params: FamiliesParams, point: tuple[float, float, float]) -> tuple[float, float]:
    """q and v of a point over the floor: the inverse of `floor`."""
    middle, scale = _floor_scale(params)
    x, y, _ = LAYOUTS[params.system].center
    q, v = middle + np.array([point[1] - y, point[0] - x]) / scale
    return float(q), float(v)


def _floor_scale(params: FamiliesParams) -> tuple[np.ndarray, np.ndarray]:
    """The state in the middle of the window, and metres along y and x for each unit of q and v."""
    layout = LAYOUTS[params.system]
    lower, upper = (np.array(corner) for corner in layout.window)
    return 0.5 * (lower + upper), np.array(layout.size) * [1.0, -1.0] / (upper - lower)
