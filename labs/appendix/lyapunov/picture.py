"""The plane in its scene: where V decreases, its level sets, the set that is asked about, and many
states that run."""

from functools import lru_cache

import numpy as np

from labs.appendix.lyapunov.analysis import NODES, LyapunovAnalysis, interpolate_value
from labs.appendix.lyapunov.contours import level_lines
from labs.appendix.lyapunov.params import LyapunovParams
from labs.appendix.lyapunov.plots import relative_change
from labs.appendix.lyapunov.state_ensemble import StateEnsemble
from labs.colors import NO_VALUE, from_oklab, to_oklab
from labs.scene import Color, Scene
from labs.tasks.phase_plane.picture import LAYER, PhasePlane

DECREASE_COLORS = ((0.82, 0.92, 0.90), (0.10, 0.45, 0.46))
INCREASE_COLORS = ((0.98, 0.88, 0.76), (0.78, 0.34, 0.10))
"""sRGB, where V changes little and where by much: teal and amber."""
SATURATED_CHANGE = 0.3
"""Of V, a change that has the full colour."""
LEVELS = (0.1, 0.3, 0.6)
"""Of V that are drawn, in parts of the largest inside the window."""
ROUND = np.linspace(0.0, 4.0, 81)
BOX = np.stack(
    [np.interp(ROUND, range(5), way) for way in ([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1])], axis=1
)
"""(81, 2): round the box from -1 to 1."""
HEIGHT = 0.75
"""[m] of the bowl where V is endless."""


def draw_phase_plane(
    scene: Scene,
    params: LyapunovParams,
    found: LyapunovAnalysis | None,
    runs: StateEnsemble | None,
    x: np.ndarray,
) -> None:
    """The plane with all in it; the body, at the state x (2,)."""
    plane = params.plane
    plane.draw_axes(scene)
    plane.draw_body(scene, np.clip(x, plane.lower, plane.upper))
    if found is None:
        plane.handle(scene, "state", x)
        return
    picture = _value_surface(found, plane)
    scene.surface("V", picture.points, picture.colors)
    _draw_sets(scene, params, found, picture)
    if runs is not None:
        _draw_runs(scene, runs, picture)
    scene.handle("state", picture.place(np.clip(x, plane.lower, plane.upper), 0.0), 0.045)


class _ValueSurface:
    """Where states are on the flat plate, or on V as a surface over it; and what of the picture
    stays while V does."""

    def __init__(self, plane: PhasePlane, found: LyapunovAnalysis) -> None:
        self.plane = plane
        V = np.maximum(found.V, 0.0)
        size = found.level_max if found.level_max > 0.0 else float(np.median(V))
        self._heights = HEIGHT * V / (V + 2.0 * max(size, 1e-12))
        self._grid = plane.grid(NODES, NODES)
        self.points = self.place(self._grid, -0.5 * LAYER)
        self.colors = change_colors(relative_change(found))
        highest = float(found.V.max())
        some = [level_lines(self._grid, found.V, share**2 * highest) for share in LEVELS]
        self.levels = np.concatenate(some) if highest > 0.0 else np.empty((0, 2, 2))
        self.level = level_lines(self._grid, found.V, found.level)
        self.border = level_lines(self._grid, found.change, 0.0)

    def place(self, X: np.ndarray, lift: float) -> np.ndarray:
        """(..., 3) [m] of states X (..., 2), `lift` [m] above."""
        if not self.plane.lying:
            return self.plane.place(X, lift)
        flat = X.reshape(-1, 2)
        heights = interpolate_value(self._grid, self._heights, flat).reshape(X.shape[:-1])
        return self.plane.place(X, heights + 3.0 * lift)

    def lines(
        self, scene: Scene, name: str, lines: np.ndarray, color: Color, strength: float, lift: float
    ) -> None:
        """Segments (m, 2, 2) of the window."""
        if len(lines):
            scene.trail(name, self.place(lines, lift), color, strength)


@lru_cache(maxsize=4)
def _value_surface(found: LyapunovAnalysis, plane: PhasePlane) -> _ValueSurface:
    return _ValueSurface(plane, found)


def _draw_sets(
    scene: Scene, params: LyapunovParams, found: LyapunovAnalysis, picture: _ValueSurface
) -> None:
    """Level lines, the border of where V falls, the set that is asked about, and of a box the
    largest level set within."""
    picture.lines(scene, "levels", picture.levels, "muted", 0.7, LAYER)
    picture.lines(scene, "border of decrease", picture.border, "warning", 0.7, LAYER)
    if params.set == "box":
        corner = np.array([params.box_1, params.box_2]) * picture.plane.upper
        scene.trail("box", picture.place(BOX * corner, 2 * LAYER), "actual")
        scene.handle("corner", picture.place(corner, 0.0), 0.03)
    if found.level > 0.0:
        color: Color = "reference" if params.set == "box" else "actual"
        picture.lines(scene, "level set", picture.level, color, 1.0, 2 * LAYER)
    if params.candidate == "drawn":
        for i, end in enumerate(params.V_axes, 1):
            spoke = np.linspace(-1.0, 1.0, 40)[:, None] * end
            scene.trail(f"spoke {i}", picture.place(spoke, 3 * LAYER), "force", 0.7)
            scene.handle(f"axis {i}", picture.place(end, 0.0), 0.03)


def _draw_runs(scene: Scene, runs: StateEnsemble, picture: _ValueSurface) -> None:
    """All states, those that have left the set in red, with the last steps of each."""
    plane = picture.plane
    inside = ((plane.lower <= runs.X) & (plane.upper >= runs.X)).all(axis=1)
    ways = np.concatenate([runs.tail, runs.X[None]])
    parts = np.stack([ways[:-1], ways[1:]], axis=2)
    seen = ((parts >= plane.lower) & (parts <= plane.upper)).all(axis=(2, 3))
    kinds: tuple[tuple[str, np.ndarray, Color], ...] = (
        ("staying", ~runs.left, "actual"),
        ("leaving", runs.left, "warning"),
    )
    for name, which, color in kinds:
        dots = runs.X[inside & which]
        if len(dots):
            scene.dots(f"states {name}", picture.place(dots, 3 * LAYER), 0.032, color)
        picture.lines(scene, f"ways {name}", parts[seen & which], color, 0.6, 2.5 * LAYER)


def change_colors(change: np.ndarray) -> np.ndarray:
    """(..., 3) sRGB of the relative change (...) of V in a step: teal where it falls, amber where
    it grows, the stronger the more; grey where V = 0."""
    share = np.sqrt(np.minimum(np.abs(np.nan_to_num(change)) / SATURATED_CHANGE, 1.0))[..., None]
    colors = np.empty((*change.shape, 3))
    for ends, some in ((DECREASE_COLORS, change < 0.0), (INCREASE_COLORS, change >= 0.0)):
        pale, full = to_oklab(np.array(ends))
        colors[some] = from_oklab(pale + share[some] * (full - pale))
    colors[np.isnan(change)] = NO_VALUE
    return colors
