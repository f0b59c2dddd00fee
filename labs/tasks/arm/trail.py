"""Where an end-effector was in the last 3 s of a lab whose period is 10 ms.

A trail is an array (TRAIL_POINTS, 3) [m], the newest point last, one for every TRAIL_STRIDE steps.
"""

import numpy as np

from labs.scene import Color, Scene

TRAIL_POINTS, TRAIL_STRIDE = 150, 2


def append_row(rows: np.ndarray, newest: np.ndarray) -> np.ndarray:
    """The rows (k, n) moved up by one, the newest (n,) last: a new array."""
    moved = np.empty_like(rows)
    moved[:-1] = rows[1:]
    moved[-1] = newest
    return moved


def draw_trail(
    scene: Scene, name: str, trail: np.ndarray, steps: int, color: Color = "actual"
) -> None:
    """What the trail holds after so many steps, from two points on."""
    points = min(steps // TRAIL_STRIDE + 1, TRAIL_POINTS)
    if points > 1:
        scene.trail(name, trail[-points:], color)
