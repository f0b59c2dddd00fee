"""The race in its scene: the vertical plane x = 0, seen from the front."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin

from labs.colors import sequential
from labs.optimal_control.brachistochrone.curves import cycloid
from labs.optimal_control.brachistochrone.history import KEPT_CURVES, DescentHistory
from labs.optimal_control.brachistochrone.params import NO_FLOOR, BrachistochroneParams
from labs.optimal_control.brachistochrone.race import BEAD_COUNT, CURVE_NAMES, YOURS, BeadRace
from labs.scene import Scene
from labs.shapes import Sphere, Vector3, Visual, primitive, translation

BEAD_COLORS: tuple[Vector3, ...] = (
    (0.24, 0.48, 0.78),
    (0.86, 0.42, 0.1),
    (0.13, 0.62, 0.44),
    (0.8, 0.36, 0.58),
    (0.76, 0.6, 0.14),
    (0.4, 0.38, 0.82),
)
"""As the plots' series, on white and on dark."""
BEAD_RADIUS, HALF_WIDTH, HANDLE_RADIUS = 0.032, 0.011, 0.04
"""[m] of a bead, of the ribbon of a curve, of a handle."""
LAYER, BEHIND = 0.012, -0.08
"""[m] by which one ribbon lies before the next, and where the handles are: behind the beads."""
RIBBON_POINTS, RIBBON_NODES = 40, 60
"""On a ribbon: evenly along it, and of its nodes, at most about."""
COLOR_SPAN = (-0.2, 1.1)
"""Of the colours, in parts of the greatest speed: the palest is hardly seen on white, the darkest
on black."""
LABEL_PLACES = (0.42, 0.3, 0.62, 0.72, 0.5, 0.86)
"""Where on its way a curve has its name."""


@dataclass(frozen=True, eq=False)
class Beads:
    """Balls of different colours that move in the plane, as a robot of sliding joints."""

    model: pin.Model
    visuals: tuple[Visual, ...]

    @property
    def collisions(self) -> tuple[Visual, ...]:
        """The same."""
        return self.visuals


@cache
def _beads() -> Beads:
    model, visuals = pin.Model(), []
    model.name = "beads"
    for i, color in enumerate(BEAD_COLORS):
        start = translation(i * LAYER, 0.0, 0.0)
        along = model.addJoint(0, pin.JointModelPY(), start, f"across{i}")
        up = model.addJoint(along, pin.JointModelPZ(), pin.SE3.Identity(), f"up{i}")
        visuals.append(primitive(up, pin.SE3.Identity(), Sphere(BEAD_RADIUS), color))
    return Beads(model, tuple(visuals))


def draw_race(
    scene: Scene, params: BrachistochroneParams, race: BeadRace, beads: np.ndarray, t: float
) -> None:
    """The curves, and beads at (6, 2) [m] from A, t seconds after they were let go."""
    middle = 0.5 * (params.x_a + params.x_b), 0.5 * (params.z_a + params.z_b)
    scene.camera((5.0, middle[0], middle[1] + 0.3), (0.0, *middle))
    points, colors = _ribbons(params, race)
    scene.surface("curves", points, colors)
    places = params.world_points(beads)[:, 1:]
    scene.arm("beads", _beads(), places.ravel())
    for i, name in enumerate(CURVE_NAMES):
        text = name if params.race == "curves" else ""
        if race.times[i] <= t:
            place = f"{race.rank(i)}. " if text else ""
            text = f"{place}{text} {race.times[i]:.3f} s".strip()
        elif not race.descents[i].arrived and race.descents[i].clock[-1] <= t:
            text = f"{text}: stuck" if text else "stuck"
        if text:
            scene.label(f"of {name}", text, _label_place(params, race, i))


def draw_handles(scene: Scene, params: BrachistochroneParams, race: BeadRace) -> None:
    """What can be dragged, and the polygon of the control points."""
    ends_apart = params.across, params.depth
    ends = params.world_points(np.array([[0.0, 0.0], ends_apart]), BEHIND)
    for name, place in zip(("A", "B"), ends, strict=True):
        scene.handle(name, place, HANDLE_RADIUS)
        scene.label(f"name of {name}", name, place)
    if params.race == "starts":
        if params.shape == "cycloid":
            whole = params.world_points(cycloid(*ends_apart)[::20], BEHIND)
            scene.trail("on to B", whole, "muted", 0.5)
        scene.handle("release", params.world_points(race.starts[YOURS], BEHIND)[0], HANDLE_RADIUS)
        return
    scene.handle("knee", params.world_points(params.knee, BEHIND)[0], HANDLE_RADIUS)
    polygon = params.world_points(params.control_points, BEHIND)
    scene.trail("control polygon", polygon, "muted", 0.5)
    for k in (1, 2, 3):
        scene.handle(f"control {k}", polygon[k], HANDLE_RADIUS)


def draw_optimiser(scene: Scene, params: BrachistochroneParams, history: DescentHistory) -> None:
    """The curves of earlier iterations, fading, and the floor."""
    if params.race == "curves":
        for k, curve in enumerate(history.curves[:-1]):
            if not np.array_equal(curve, history.curves[k + 1]):
                points = params.world_points(curve, 0.5 * BEHIND)
                scene.trail(f"before {KEPT_CURVES - 1 - k}", points, "muted", (k + 1) / KEPT_CURVES)
    if params.floor < NO_FLOOR:
        depth = max(params.floor, params.depth)
        ends = np.array([[0.0, depth], [params.across, depth]])
        scene.trail("floor", params.world_points(ends, 0.5 * BEHIND), "warning")


def _label_place(params: BrachistochroneParams, race: BeadRace, i: int) -> np.ndarray:
    """(3,) on its curve, or at its start where all share one."""
    point = race.starts[i]
    if params.race == "curves":
        path = race.paths[i]
        along = _arc_lengths(path)
        at = LABEL_PLACES[i] * along[-1]
        point = np.array([np.interp(at, along, axis) for axis in path.T])
    place: np.ndarray = params.world_points(point)[0]
    return place


def _ribbons(params: BrachistochroneParams, race: BeadRace) -> tuple[np.ndarray, np.ndarray]:
    """Points and colours (2, k, 3) of one ribbon that goes along all curves, there and back."""
    paths = race.paths if params.race == "curves" else race.paths[:1]
    pieces = [_ribbon(params, path, i) for i, path in enumerate(paths)]
    speeds = np.concatenate([speed for _, speed in pieces])
    sides = np.concatenate([points for points, _ in pieces], axis=1)
    if params.colors == "speed" or params.race == "starts":
        low, high = COLOR_SPAN
        colors = sequential(speeds, low * float(speeds.max()), high * float(speeds.max()))
    else:
        counts = [len(speed) for _, speed in pieces]
        colors = np.repeat(np.array(BEAD_COLORS[: len(paths)]), counts, axis=0)
    return sides, np.stack([colors, colors])


def _ribbon(
    params: BrachistochroneParams, path: np.ndarray, i: int
) -> tuple[np.ndarray, np.ndarray]:
    """Both sides (2, k, 3) of the i-th, and (k,) [m/s] how fast a bead is. Every other one runs
    backwards."""
    along = _arc_lengths(path)
    nodes = along[:: max(1, len(along) // RIBBON_NODES)]
    at = np.union1d(nodes, np.linspace(0.0, along[-1], RIBBON_POINTS))
    points = np.stack([np.interp(at, along, axis) for axis in path.T], axis=1)
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-9)[:, None]
    normal = HALF_WIDTH * tangent[:, ::-1] * np.array([-1.0, 1.0])
    layer = (i - BEAD_COUNT) * LAYER * 0.25
    sides = np.stack([params.world_points(points + s * normal, layer) for s in (1.0, -1.0)])
    work = params.mu * np.concatenate([[0.0], np.cumsum(np.abs(np.diff(points[:, 0])))])
    speed = np.sqrt(2.0 * params.g * np.maximum(points[:, 1] - work, 0.0))
    return (sides[:, ::-1], speed[::-1]) if i % 2 else (sides, speed)


def _arc_lengths(path: np.ndarray) -> np.ndarray:
    """(k,) [m] length of the polyline up to each node."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
