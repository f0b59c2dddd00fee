"""The three carts before their wall, and above them the plane with all runs."""

from dataclasses import replace

import numpy as np

from labs.models.mass_on_a_line import mass_on_a_line
from labs.optimal_control.mpc_uncertainty.controllers import (
    CONTROLLER_NAMES,
    NOMINAL,
    ROBUST,
    Controllers,
)
from labs.optimal_control.mpc_uncertainty.params import UncertaintyParams
from labs.scene import Color, Scene
from labs.shapes import BLUE, ORANGE, Vector3
from labs.tasks.phase_plane.picture import PhasePlane
from labs.tasks.phase_plane.systems import plane_system

COLORS: tuple[Color, ...] = ("actual", "reference", "force")
BODIES: tuple[Vector3, ...] = (BLUE, ORANGE, (0.7, 0.16, 0.5))
RAIL_POSITIONS = (0.9, 0.45, 0.0)
"""[m] their places along x."""
NAME_POSITIONS = (-1.3, -0.8, -0.3)
"""[m] where their names stand along y: one behind the other they would lie on each other."""
LOWER, UPPER = np.array([-1.5, -1.1]), np.array([1.25, 1.1])
"""Of the plane."""
CLOSE_BELOW, CLOSE_ABOVE = np.array([0.55, 0.6]), np.array([0.25, 0.6])
"""From the wall, when zoomed in."""
MIDDLE, HEIGHT = 1.4, 1.2
"""[m] of the plate."""
CAMERA = ((4.2, -0.1, 2.1), (0.0, -0.1, 0.95))
HALF_CART, SLAB, FLOOR, TOP = 0.1, 0.05, 0.48, 0.78
"""[m] of the cart, and of the slab of wall before it."""
UNIT_CIRCLE = np.stack(
    [f(np.linspace(0.0, 2.0 * np.pi, 33)[:-1]) for f in (np.cos, np.sin)], axis=1
)


def phase_plane(params: UncertaintyParams) -> PhasePlane:
    """The plane behind the rails: of all states, to the rails' scale, or of those at the wall."""
    plane = PhasePlane.of(plane_system("cart"), LOWER, UPPER)
    size, middle = (plane.size[0], HEIGHT), np.array([0.0, plane.center[1], MIDDLE])
    if params.zoom:
        wall = np.array([params.wall, 0.0])
        plane = replace(plane, lower=wall - CLOSE_BELOW, upper=wall + CLOSE_ABOVE)
    return replace(plane, center=middle, size=size)


def draw_carts(scene: Scene, params: UncertaintyParams, first: np.ndarray) -> None:
    """The first run of each controller, at its state (3, 2), each with a wall of its own."""
    for name, x, place, color, along in zip(
        CONTROLLER_NAMES, first, RAIL_POSITIONS, BODIES, NAME_POSITIONS, strict=True
    ):
        scene.arm(f"{name} cart", mass_on_a_line(place, color), x[:1])
        near = params.wall + HALF_CART
        corners = [(near, FLOOR), (near + SLAB, FLOOR), (near + SLAB, TOP), (near, TOP)]
        scene.polygon(f"wall of {name}", np.array([(place, y, z) for y, z in corners]), "warning")
        scene.label(f"name of {name}", name, (place, along, 0.6))


def draw_limits(scene: Scene, plane: PhasePlane, params: UncertaintyParams) -> None:
    """X in the plane, and the start that is dragged."""
    low, high = plane.lower, plane.upper
    wall = np.array([[params.wall, low[1]], [params.wall, high[1]]])
    plane.path(scene, "wall", wall, "warning", layer=3)
    for name, v in (("fastest", params.v_max), ("slowest", -params.v_max)):
        plane.path(scene, name, np.array([[low[0], v], [params.wall, v]]), "muted", layer=3)
    if not params.zoom:
        plane.handle(scene, "start", params.start)


def draw_sets(scene: Scene, plane: PhasePlane, chosen: Controllers, shown: list[int]) -> None:
    """From where there are plans."""
    for i in shown:
        opacity = 0.12 if len(shown) == 1 else 0.05
        plane.fill(
            scene, f"feasible, {CONTROLLER_NAMES[i]}", chosen.feasible[i], COLORS[i], opacity
        )


def draw_plan(
    scene: Scene,
    plane: PhasePlane,
    chosen: Controllers,
    i: int,
    plan: np.ndarray,
) -> None:
    """The first run's plan (N + 1, 2), with what the controller keeps clear of the limits."""
    plane.path(scene, f"plan, {CONTROLLER_NAMES[i]}", plan, COLORS[i], layer=2)
    if i == NOMINAL:
        return
    for k, z in enumerate(plan):
        around = chosen.tube if i == ROBUST else UNIT_CIRCLE @ chosen.ellipses[k].T
        if len(around) and around.any():
            plane.fill(
                scene, f"tube {k}, {CONTROLLER_NAMES[i]}", z + around, BODIES[i], 0.06, layer=1
            )
            if k == 1:  # where the next state is expected
                edge = np.vstack([z + around, z + around[:1]])
                plane.path(scene, f"edge of tube, {CONTROLLER_NAMES[i]}", edge, "muted", layer=7)


def draw_runs(scene: Scene, plane: PhasePlane, states: np.ndarray, shown: list[int]) -> None:
    """All runs at their states (3, runs, 2)."""
    for i in shown:
        plane.dots(
            scene, f"runs, {CONTROLLER_NAMES[i]}", states[i], COLORS[i], diameter=0.02, layer=3 + i
        )
