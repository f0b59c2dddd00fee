"""Drawing random walks: a row of cells with the walker on it, and values as bars that stand behind.

Cells are named; the two ends wear their cost, green where it is a gain and red where it is not. A
bar reaches from the line of V = 0 to a value, and a short line across tells the truth.
"""

from collections.abc import Sequence

import numpy as np

from labs.scene import Color, Scene, cell_at
from labs.tasks.random_walk.walks import WalkShape

ROW = "walk"
"""The handle that a click on the row holds."""
WIDTH, MAX_CELL_SIZE = 3.0, 0.36
"""[m] of a row, and of a cell at most."""
HEIGHT, FLOOR = 0.7, 0.16
"""[m] of the bars from the least to the largest value, and where the least one is."""
CLIP_MARGIN = 0.25
"""Part of that range that a bar may reach beyond it."""
BAR_COLORS: tuple[Color, ...] = ("actual", "reference")
"""Of the first and the second learner of those side by side."""
INSIDE, FREE = (0.82, 0.84, 0.87), (0.62, 0.63, 0.65)
GAIN, LOSS = (0.20, 0.66, 0.33), (0.75, 0.22, 0.17)
"""sRGB of cells: between the ends; an end that costs nothing, one that gains, one that costs."""
LETTERS, MAX_NAMED_STATES = 26, 9
"""States that have a letter each, more of them have numbers; and names that stand under the row."""


def state_names(walk: WalkShape) -> tuple[str, ...]:
    """Of the n states between the ends: A, B, ... or numbers from 1."""
    letters = walk.states <= LETTERS
    return tuple(chr(65 + i) if letters else str(i + 1) for i in range(walk.states))


def cell_size(walk: WalkShape) -> float:
    """[m]"""
    return min(MAX_CELL_SIZE, WIDTH / (walk.states + 2))


def cell_places(walk: WalkShape) -> np.ndarray:
    """(n + 2, 3) [m]: the middle of every cell, from the left end to the right one."""
    n, size = walk.states, cell_size(walk)
    x = size * (np.arange(n + 2) - 0.5 * (n + 1))
    return np.stack([x, np.full(n + 2, -0.5 * size), np.full(n + 2, 0.02)], axis=1)


def state_at(walk: WalkShape, point: tuple[float, float, float]) -> int | None:
    """The state whose cell is at a point [m]: from 0, the left end, to n + 1; None beside the
    row."""
    size, places = cell_size(walk), cell_places(walk)
    corner = places[0] - [0.5 * size, 0.5 * size, 0.0]
    cell = cell_at(point, corner, size, 1, walk.states + 2)
    return None if cell is None else cell[1]


def value_heights(walk: WalkShape, V: np.ndarray) -> np.ndarray:
    """(...) [m] above the floor of values V (...); what is far beyond the ends' costs is cut."""
    low, high = min(walk.left, walk.right, 0.0), max(walk.left, walk.right, 0.0)
    part = (V - low) / ((high - low) or 1.0)
    return np.asarray(FLOOR + HEIGHT * np.clip(part, -CLIP_MARGIN, 1.0 + CLIP_MARGIN))


def draw_walk(
    scene: Scene,
    walk: WalkShape,
    place: float | None,
    colors: np.ndarray | None = None,
    *,
    clickable: bool = False,
) -> None:
    """The row, the cells between the ends in `colors` (n, 3), sRGB, if given; and the walker, if
    any, at `place` in [0, n + 1], which may lie between two cells. A click on a clickable row holds
    the handle ROW (`state_at`)."""
    n, size, places = walk.states, cell_size(walk), cell_places(walk)
    ends = (walk.left, walk.right)
    tints = np.array([FREE, *[INSIDE] * n, FREE])
    if colors is not None:
        tints[1:-1] = colors
    for end, cost in zip((0, -1), ends, strict=True):
        if cost:
            tints[end] = GAIN if cost < 0.0 else LOSS
    corner = places[0] - [0.5 * size, 0.5 * size, 0.0]
    scene.cells(ROW, corner, size, tints[None], clickable=clickable)
    front = np.array([0.0, -0.5 * size - 0.1, 0.0])
    every = -(-n // MAX_NAMED_STATES)
    for name, cell in zip(state_names(walk)[::every], places[1:-1:every], strict=True):
        scene.label(f"state {name}", name, cell + front)
    for side, end, cost in zip(("left", "right"), (0, -1), ends, strict=True):
        scene.label(f"{side} end", f"{cost:g}", places[end] + front)
    if place is not None:
        x = float(np.interp(place, np.arange(n + 2), places[:, 0]))
        radius = 0.28 * size
        scene.sphere("walker", (x, -0.5 * size, 0.02 + radius), radius, "force")
    half, top = 0.5 * size * (n + 2), FLOOR + HEIGHT
    scene.camera(
        (0.0, -3.0, 1.05),
        (0.0, 0.0, 0.42),
        core=np.array([[-half, -size - 0.1, 0.0], [half, 0.0, top]]),
    )


def draw_values(
    scene: Scene,
    walk: WalkShape,
    values: Sequence[np.ndarray],
    truth: np.ndarray | None = None,
    spread: Sequence[np.ndarray] = (),
) -> None:
    """Up to two sets of values (n + 2,) as bars side by side, of which the ends have none; the
    truth (n + 2,) across them; and the standard deviation of each set, (n + 2,), as a whisker."""
    n, size = walk.states, cell_size(walk)
    x, zero = cell_places(walk)[1:-1, 0], float(value_heights(walk, np.zeros(1))[0])
    width = 0.72 * size / max(len(values), 1)
    half = 0.5 * size * (n + 2)
    scene.trail("V = 0", np.array([[-half, 0.0, zero], [half, 0.0, zero]]), "muted")
    scene.label("zero", "V = 0", (half - 0.2, 0.0, zero + 0.1))
    for m, V in enumerate(values):
        left = x + width * (m - 0.5 * len(values)) + 0.01 * size
        right = left + width - 0.02 * size
        tops = value_heights(walk, V[1:-1])
        for name, a, b, z in zip(state_names(walk), left, right, tops, strict=True):
            corners = [(a, 0.0, zero), (b, 0.0, zero), (b, 0.0, z), (a, 0.0, z)]
            scene.polygon(f"value {m + 1} of {name}", np.array(corners), BAR_COLORS[m], 0.85)
        if m < len(spread):
            ends = [value_heights(walk, (V + s * spread[m])[1:-1]) for s in (-1.0, 1.0)]
            middle = 0.5 * (left + right)
            scene.trail(f"spread {m + 1}", _segments((middle, middle), ends, -0.008), "muted")
    if truth is not None:
        level = value_heights(walk, truth[1:-1])
        scene.trail(
            "truth", _segments((x - 0.46 * size, x + 0.46 * size), (level, level), -0.012), "force"
        )


def _segments(x: Sequence[np.ndarray], z: Sequence[np.ndarray], y: float) -> np.ndarray:
    """(n, 2, 3) [m]: a line for each state, from (x_0, z_0) to (x_1, z_1), `y` behind the bars."""
    starts, ends = (np.stack([a, np.full(len(a), y), b], axis=1) for a, b in zip(x, z, strict=True))
    return np.stack([starts, ends], axis=1)
