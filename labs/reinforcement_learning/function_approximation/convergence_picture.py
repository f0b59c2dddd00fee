"""Drawing the table of convergence: nine panels, in each the curve of what a learner learned.

Time runs to the right, logarithmically; heights are compressed, and scaled to each panel."""

import numpy as np

from labs.scene import Color, Scene

WIDE, TALL, GAP = 0.86, 0.5, 0.12
"""[m] of a panel; between panels."""
LEFT, FLOOR = 0.62, 0.1
"""[m] for the names of the rows; z of the lowest panels."""


def draw_convergence_table(
    scene: Scene,
    rows: tuple[str, ...],
    columns: tuple[str, ...],
    time: np.ndarray,
    shown: np.ndarray,
    verdicts: list[tuple[str, Color]],
) -> None:
    """`shown` (9, k) over `time` (k,) in [0, 1]; a verdict with its colour for each, row by row."""
    middle = 0.5 * (_z(2) + _z(0) + TALL)
    scene.camera((-0.25, -4.1, middle + 0.5), (-0.25, 0.0, middle), _core())
    for r, row in enumerate(rows):
        scene.label(f"row {r + 1}", row, (_x(0) - 0.32, 0.0, _z(r) + 0.5 * TALL))
    for c, column in enumerate(columns):
        scene.label(f"column {c + 1}", column, (_x(c) + 0.5 * WIDE, 0.0, _z(0) + TALL + 0.14))
    for cell, (words, color) in enumerate(verdicts):
        r, c = divmod(cell, 3)
        x, z = _x(c), _z(r)
        corners = [(x, z), (x + WIDE, z), (x + WIDE, z + TALL), (x, z + TALL)]
        panel = np.array([(a, 0.02, b) for a, b in corners])
        scene.polygon(f"panel {cell + 1}", panel, "muted", 0.18)
        middle = z + 0.62 * TALL
        level = np.array([[x, 0.0, middle], [x + WIDE, 0.0, middle]])
        scene.trail(f"zero {cell + 1}", level, "muted", 0.5)
        if len(time) > 1:
            size = np.arcsinh(shown[cell])
            size /= max(float(np.abs(size).max()), 1e-9)
            across = x + 0.02 + (WIDE - 0.04) * time
            curve = np.stack([across, np.full(len(time), -0.01), middle + 0.32 * TALL * size], 1)
            scene.trail(f"curve {cell + 1}", curve, color)
        if words:
            scene.label(f"verdict {cell + 1}", words, (x + 0.5 * WIDE, 0.0, z + 0.06))


def _x(c: int) -> float:
    return -1.5 * WIDE - GAP + c * (WIDE + GAP)


def _z(r: int) -> float:
    return FLOOR + (2 - r) * (TALL + GAP)


def _core() -> np.ndarray:
    left, right, low, high = _x(0) - LEFT, _x(2) + WIDE, _z(2), _z(0) + TALL + 0.2
    return np.array([[left, 0.0, low], [right, 0.0, low], [right, 0.0, high], [left, 0.0, high]])
