"""The plane lying beside the body, V*_N over it as a surface, and the run on that surface."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from labs.optimal_control.mpc_stability.closed_loop import ClosedLoopRun
from labs.optimal_control.mpc_stability.formulation import WINDOW, Formulation
from labs.optimal_control.mpc_stability.value_surface import ValueSurface
from labs.scene import Scene
from labs.shapes import Vector3
from labs.tasks.phase_plane.picture import PhasePlane
from labs.tasks.phase_plane.systems import plane_system

HEIGHT = 0.5
"""[m] of the highest value that is drawn."""
MAX_HEIGHT_RATIO = 4.0
"""Times the median value: what is higher is cut off."""
LEVELS = 6
"""Lines on the surface along which V* is the same."""
COLORS = np.array([[0.27, 0.53, 0.80], [0.93, 0.70, 0.25], [0.83, 0.30, 0.25], [0.46, 0.22, 0.40]])
"""sRGB: where V* falls by at least l, by less, rises; from where the next problem is infeasible."""
LIFT = 0.012
"""[m] of lines above the surface."""
CAMERAS: Mapping[str, tuple[Vector3, Vector3]] = {
    "cart": ((1.3, 0.0, 2.25), (-0.38, 0.0, 0.15)),
    "unstable": ((1.3, 0.0, 1.9), (0.05, 0.1, 0.2)),
}
"""From high above, to look into the valley."""
PENDULUM_PLACE = (0.0, -0.75)
"""(x, y) [m]"""


@cache
def plane_of(system: str) -> PhasePlane:
    """The plane of this system."""
    of = plane_system(system)
    reach = WINDOW * np.array(of.x_max)
    plane = PhasePlane.of(of, -reach, reach, lying=True)
    place = PENDULUM_PLACE if of.body == "pendulum" else plane.body_place
    return replace(plane, camera=CAMERAS[system], body_place=place)


def draw_stability(
    scene: Scene, formulation: Formulation, surface: ValueSurface, run: ClosedLoopRun
) -> None:
    """All of it."""
    plane = plane_of(formulation.settings.system)
    plane.draw_axes(scene)
    plane.draw_body(scene, run.x)
    scale = _Scale(surface, run)
    k = max(run.k, 0)
    past = formulation.reference.states(np.arange(k - max(len(run.path), 1), k) + 1)
    if formulation.settings.task != "track":
        plane.fill(scene, "X_0", formulation.feasible_polygon, "muted", 0.15, layer=0)
    terminal = formulation.terminal_polygon
    if len(terminal):
        plane.fill(scene, "X_f", terminal + past[-1], "reference", 0.35, layer=1)
    if surface.V.size:
        _draw_surface(scene, plane, surface, scale)
    if formulation.settings.task == "track":
        ahead = formulation.reference.states(np.arange(k, k + 200))
        plane.path(scene, "reference", ahead, "reference", 0.6, layer=1)
    _draw_run(scene, plane, run, scale, past)


def _draw_surface(scene: Scene, plane: PhasePlane, surface: ValueSurface, scale: "_Scale") -> None:
    """V*, coloured by what becomes of it, with level lines, and its largest value in numbers."""
    points, lifts = surface.points, scale.lift(surface.V)
    scene.surface("V", plane.place(points, lifts), COLORS[surface.change])
    if (np.diff(lifts, axis=0) >= 0.0).all():
        for number, height in enumerate(np.linspace(0.0, HEIGHT, LEVELS + 2)[1:-1], 1):
            ways = _level_line(points, lifts, height)
            if len(ways):
                lift = height + 0.3 * LIFT
                scene.trail(f"level {number}", plane.place(ways, lift), "muted", 0.8)
    top = np.unravel_index(int(lifts.argmax()), lifts.shape)
    text = f"V* = {surface.V[top]:.3g}"
    scene.label("top of V", text, plane.place(points[top], lifts[top] + 0.06))


def _draw_run(
    scene: Scene, plane: PhasePlane, run: ClosedLoopRun, scale: "_Scale", past: np.ndarray
) -> None:
    """The path on the surface, or where there is none in the plane, past the reference (k, 2);
    what is planned; and the ball that is dragged."""
    inside = ((run.path >= plane.lower) & (run.path <= plane.upper)).all(axis=1)
    on = inside & run.found
    path, V = run.path[on], run.V[on]
    if len(path) >= 2 and scale.known:
        scene.trail("path", plane.place(path, scale.lift(V) + LIFT), "force")
    elif len(run.path) >= 2 and not scale.known:
        plane.path(scene, "path", run.path + past, "force", layer=3)
    plan = run.controller.plan
    if plan is not None and not run.controller.status and not run.end_reason:
        plane.path(scene, "plan", plan.X + past[-1], "actual", layer=2)
    here = np.clip(run.x, plane.lower, plane.upper)
    lift = scale.lift(run.V[-1:])[0] if scale.known and len(run.V) and on[-1] else 0.0
    scene.handle("state", plane.place(here, lift + LIFT), 0.035)


def _level_line(points: np.ndarray, lifts: np.ndarray, height: float) -> np.ndarray:
    """(m, 2, 2) pieces of the line on which the surface, which rises along every ray, is so high:
    between neighbouring rays that both get there."""
    ring = np.array(
        [
            [np.interp(height, column, axis) for axis in ray.T]
            for column, ray in zip(lifts.T, points.transpose(1, 0, 2), strict=True)
        ]
    )
    there = lifts[-1] >= height
    pieces: np.ndarray = np.stack([ring[:-1], ring[1:]], axis=1)
    return np.asarray(pieces[there[:-1] & there[1:]])


class _Scale:
    """Heights of values."""

    def __init__(self, surface: ValueSurface, run: ClosedLoopRun) -> None:
        self.known = bool(surface.V.size)
        values = surface.V if self.known else np.zeros(1)
        self.low = min(float(values.min()), 0.0)
        ceiling = self.low + MAX_HEIGHT_RATIO * float(np.median(values) - self.low)
        self.high = min(float(values.max()), ceiling)
        self.span = max(self.high - self.low, 1e-9)

    def part(self, V: np.ndarray) -> np.ndarray:
        return np.clip((V - self.low) / self.span, 0.0, 1.0)

    def lift(self, V: np.ndarray) -> np.ndarray:
        return np.asarray(HEIGHT * self.part(V))
