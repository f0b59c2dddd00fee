"""The plane of states with all its sets, and the body beside it."""

from functools import lru_cache

import numpy as np

from labs.algorithms.mpc import RecedingHorizonState
from labs.algorithms.polygons import vertices
from labs.models.pendulums import ROD_LENGTH
from labs.optimal_control.mpc_feasibility.params import MpcFeasibilityParams
from labs.optimal_control.mpc_feasibility.problem import (
    FeasibilitySettings,
    feasibility,
    feasibility_system,
)
from labs.optimal_control.mpc_feasibility.sets import AdmissibleSetGrowth, compute_sets
from labs.scene import Color, Scene
from labs.tasks.phase_plane.picture import PhasePlane
from labs.tasks.phase_plane.systems import PlaneSystem

MAX_DRAWN_SETS = 9
"""Sets drawn of a chain."""
ABOVE = MAX_DRAWN_SETS + 3
"""The layer above them."""
FIRST, LAST = np.array([0.66, 0.88, 0.88]), np.array([0.27, 0.63, 0.66])
"""sRGB, from X_0 to X_N."""
DOOMED_COLOR = (0.85, 0.35, 0.25)
"""sRGB: of states without a plan, now or later."""
WALL = 0.1
"""[m] half the cart."""


@lru_cache(maxsize=8)
def plane_of(system: PlaneSystem) -> PhasePlane:
    """Its plane, about its natural limits."""
    return PhasePlane.of(system)


def draw_feasibility(
    scene: Scene,
    params: MpcFeasibilityParams,
    z: np.ndarray,
    controller: RecedingHorizonState,
    path: np.ndarray,
    growth: AdmissibleSetGrowth,
) -> None:
    """One frame, at the deviation z (2,)."""
    setup, system = params.setup, feasibility_system(params.system)
    plane, rest = plane_of(system), np.array(system.x_eq)
    plane.draw_axes(scene)
    plane.draw_body(scene, rest + z)
    if params.state_limits:
        _draw_walls(scene, plane, params.p_max * system.x_max[0])
    if params.shown == "admissible":
        _draw_chain(scene, plane, rest, growth.polygons, "O")
    else:
        _draw_feasible_sets(scene, plane, rest, setup)
    _draw_run(scene, plane, rest, controller, path)
    plane.handle(scene, "state", rest + z)
    plane.handle(scene, "goal", rest + feasibility(setup).goal, 0.03)


def _draw_feasible_sets(
    scene: Scene, plane: PhasePlane, rest: np.ndarray, setup: FeasibilitySettings
) -> None:
    sets = compute_sets(setup)
    if not sets.chain:
        return
    plane.fill(scene, "X", rest + vertices(feasibility(setup).box), "muted", 0.15)
    # Without a terminal set the later ones hold the earlier, and say nothing of safety.
    shown = sets.chain[:1] if sets.terminal is None else sets.chain
    _draw_chain(scene, plane, rest, shown, "X")
    for i, piece in enumerate(sets.infeasible_regions):
        plane.fill(scene, f"doomed {i}", rest + piece, DOOMED_COLOR, 0.9, layer=MAX_DRAWN_SETS + 1)
    if sets.terminal is not None:
        closed = np.vstack([sets.terminal, sets.terminal[:1]])
        if len(sets.terminal) >= 2:
            plane.path(scene, "X_f", rest + closed, "reference", layer=MAX_DRAWN_SETS + 1)


def _draw_chain(
    scene: Scene,
    plane: PhasePlane,
    rest: np.ndarray,
    chain: tuple[np.ndarray, ...],
    name: str,
) -> None:
    """Some of the sets, the largest lowest, coloured by their places in the chain."""
    if not chain:
        return
    chosen = np.unique(np.linspace(0, len(chain) - 1, MAX_DRAWN_SETS).round().astype(int))
    spans = {
        int(i): float(np.ptp(chain[i], axis=0).prod()) if len(chain[i]) else 0.0 for i in chosen
    }
    for layer, i in enumerate(sorted(spans, key=lambda i: -spans[i])):
        share = i / max(len(chain) - 1, 1)
        r, g, b = FIRST + share * (LAST - FIRST)
        plane.fill(scene, f"{name} {i}", rest + chain[i], (r, g, b), 0.9, layer=layer + 1)


def _draw_run(
    scene: Scene,
    plane: PhasePlane,
    rest: np.ndarray,
    controller: RecedingHorizonState,
    path: np.ndarray,
) -> None:
    """The way so far, and the plan that acts."""
    if len(path) > 1:
        plane.path(scene, "way", rest + path, "actual", layer=ABOVE)
    plan = controller.plan
    if plan is not None and controller.age < len(plan.U):
        ahead = plan.X[controller.age :]
        color: Color = "warning" if controller.status else "reference"
        plane.path(scene, "prediction", rest + ahead, color, layer=ABOVE + 1)
        plane.dots(scene, "predicted states", rest + ahead, color, layer=ABOVE + 1)


def _draw_walls(scene: Scene, plane: PhasePlane, reach: float) -> None:
    """What the position must stay between."""
    x, y = plane.body_place
    if plane.system.body == "mass":
        for name, side in (("left", -1.0), ("right", 1.0)):
            at = side * (reach + WALL)
            corners = [
                (x + a, at, b) for a, b in ((-0.2, 0.4), (0.2, 0.4), (0.2, 0.8), (-0.2, 0.8))
            ]
            scene.polygon(f"{name} wall", np.array(corners), "warning", 0.5)
        return
    hinge = np.array([x, y, 0.25 + ROD_LENGTH])
    for name, side in (("left", -1.0), ("right", 1.0)):
        angle = plane.system.x_eq[0] + plane.system.offset + side * reach
        tip = hinge + 1.2 * ROD_LENGTH * np.array([0.0, np.sin(angle), -np.cos(angle)])
        scene.trail(f"{name} stop", np.array([hinge, tip]), "warning")


def draw_impact_speed(scene: Scene, params: MpcFeasibilityParams, z: np.ndarray) -> None:
    """At what speed it ran into the wall, beside the body."""
    system = feasibility_system(params.system)
    x, y = plane_of(system).body_place
    at = (x, y + z[0], 0.3) if system.body == "mass" else (x, y, 0.35 + ROD_LENGTH)
    text = f"{abs(z[1]):.2f} {system.units[1]}" if params.state_limits else "lost"
    scene.label("ending", text, at)
