"""Drawing the counterexamples: states as balls on columns as high as their value, and the spiral.

Heights are compressed, so that what grows a millionfold stays in view."""

import numpy as np

from labs.reinforcement_learning.function_approximation import spiral
from labs.scene import Color, Scene

DECADE_HEIGHT = 0.28
"""[m] for a tenfold value."""
RING, DEEP = 1.25, 0.75
"""[m] half axes of the ring of states on the floor."""
SIZE = 0.11
"""[m] a value of ten on the floor of the spiral."""
ROOM, LOWEST = 0.08, np.array([0.0, 0.0, 0.4])
"""[m] kept in view around states and names, and above their middle at least."""
REACH = 20.0
"""The values of the spiral that are in view."""


def value_height(value: float) -> float:
    """[m]: linear about 0, then a tenfold value is DECADE_HEIGHT more."""
    return float(DECADE_HEIGHT * np.arcsinh(value) / np.log(10.0))


def draw_states(
    scene: Scene,
    values: np.ndarray,
    places: np.ndarray,
    at: int,
    formulas: tuple[str, ...],
    ways: tuple[tuple[int, int], ...],
) -> None:
    """`values` (X,) at `places` (X, 2) [m], the walker at a state, labels, arrows."""
    feet = np.column_stack([places, np.zeros(len(places))])
    tops = np.column_stack([places, [value_height(float(value)) for value in values]])
    names = feet + np.array([0.0, -0.2, -0.08])
    corners = np.array([*feet, *tops, *names, feet.mean(axis=0) + LOWEST])
    around = np.concatenate([corners - ROOM, corners + ROOM])
    scene.camera((0.0, -3.6, 1.9), (0.0, 0.0, 0.45), around)
    for x, (foot, top) in enumerate(zip(feet, tops, strict=True)):
        scene.dots(f"foot {x + 1}", foot[None], 0.09, "muted")
        if abs(top[2]) > 1e-3:
            scene.trail(f"column {x + 1}", np.stack([foot, top]), "actual")
        color: Color = "warning" if x == at else "actual"
        scene.sphere(f"value {x + 1}", top, 0.075, color)
        scene.label(f"name {x + 1}", formulas[x], names[x])
    for i, (x, y) in enumerate(ways):
        start, end = (np.array([*places[z], 0.0]) for z in (x, y))
        way = (end - start) / np.linalg.norm(end - start)
        scene.arrow(f"way {i + 1}", start + 0.12 * way, end - 0.12 * way, "muted")


def star_places() -> np.ndarray:
    """Six on a half ring behind, the seventh before them."""
    angle = np.linspace(np.pi, 0.0, 6)
    ring = np.stack([RING * np.cos(angle), DEEP * np.sin(angle)], axis=1)
    return np.vstack([ring, [0.0, -0.45]])


def pair_places() -> np.ndarray:
    """Two side by side."""
    return np.array([[-0.7, 0.0], [0.7, 0.0]])


def draw_spiral(scene: Scene, ways: np.ndarray) -> None:
    """The plane of values that sum to 0: the curve, the truth in its middle, and where the
    learners are; `ways` (k,) weights the one shown came along."""
    scene.camera((0.0, -2.6, 2.6), (0.0, 0.0, 0.0))
    now = float(ways[-1])
    w = np.linspace(now - 60.0, now + 12.0, 900)
    near = w[np.linalg.norm(spiral.spiral_values(w), axis=1) < 14.0 * REACH]
    scene.trail("curve", _floor_points(near), "muted")
    scene.sphere("truth", (0.0, 0.0, 0.0), 0.04, "reference")
    scene.label("truth here", "the truth, 0", (0.0, 0.0, 0.13))
    fine = np.interp(np.linspace(0.0, len(ways) - 1.0, 400), np.arange(len(ways)), ways)
    if len(ways) > 1:
        scene.trail("way", _floor_points(fine) + np.array([0.0, 0.0, 0.01]), "actual")
    scene.sphere("estimate", _floor_points(np.array([now]))[0], 0.05, "actual")


def _floor_points(w: np.ndarray) -> np.ndarray:
    """(k, 3) [m], compressed."""
    values = spiral.spiral_values(w)
    across, up = spiral.in_plane(values)
    size = np.hypot(across, up)
    scale = np.where(size > 0.0, 0.35 * np.log1p(size / 4.0) / np.maximum(size, 1e-12), 0.0)
    return np.stack([scale * across, scale * up, np.zeros(len(values))], axis=1)
