"""The regulated system in its scene."""

import numpy as np

from labs.arrays import clip_norm
from labs.optimal_control.lqr.linear_systems import LinearSystem
from labs.optimal_control.lqr.own_system import OwnSystem
from labs.optimal_control.lqr.params import LqrParams
from labs.scene import Scene

ARROW_SCALE, LONGEST_ARROW = 0.04, 0.6
"""[m/N] length of a force's arrow, up to so many [m]."""

FRONT = np.array([0.1, 0.0, 0.0])
"""[m] from the middle of the mass to its front: a handle within could not be seen."""


def draw_regulated(
    scene: Scene, params: LqrParams, x: np.ndarray, u: np.ndarray, force: np.ndarray
) -> None:
    """The system at x under the control u and a force on its tip, with a ghost at its rest."""
    system = params.linear_system
    assert isinstance(system, LinearSystem)
    mechanism, arm = system.mechanism, system.mechanism.arm
    q, rest = x[: mechanism.nq], system.x_eq[: mechanism.nq]
    scene.camera(*system.camera)
    scene.arm("rest", arm, rest, ghost=True)
    effort = np.abs(u) / params.control_limit if params.system == "ur5" else None
    scene.arm("system", arm, q, effort=effort)
    tip = mechanism.tip(q)
    scene.handle("pull", tip + FRONT if params.system == "mass" else tip, 0.05)
    if force.any():
        scene.arrow("force", tip, tip + _force_arrow(force))
    if params.system in ("cart-pole", "mass"):
        start = np.array([0.0, q[0], tip[2] if params.system == "mass" else arm.camera[1][2]])
        push = _force_arrow(np.array([0.0, u[0], 0.0]))
        if np.abs(push).max() > 1e-3:
            scene.arrow("control", start, start + push, "actual")


def draw_state_components(scene: Scene, system: OwnSystem, x: np.ndarray) -> None:
    """A bead for each number of x on a rail of its own, a muted one at 0; half the rail is the
    largest number of x0."""
    scene.camera((2.2, 0.0, 1.0), (0.0, 0.0, 0.45))
    scale = 0.5 / (float(np.abs(system.x0).max()) or 1.0)
    heights = 0.8 - 0.7 * (np.arange(system.nx) + 0.5) / system.nx
    for i, height in enumerate(heights):
        place = float(np.clip(scale * x[i], -1.0, 1.0))
        ends = np.array([[0.0, -1.0, height], [0.0, 1.0, height]])
        scene.trail(f"rail {i + 1}", ends, "reference", 0.4)
        scene.sphere(f"rest {i + 1}", (0.0, 0.0, height), 0.02, "muted")
        scene.sphere(f"state {i + 1}", (0.0, place, height), 0.045)
        scene.label(f"name {i + 1}", f"x{i + 1} = {x[i]:.3g}", (0.0, place, height + 0.07))


def _force_arrow(force: np.ndarray) -> np.ndarray:
    """[m] the arrow of a force (3,) [N]."""
    return clip_norm(ARROW_SCALE * force, LONGEST_ARROW)
