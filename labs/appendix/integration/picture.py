"""The scene of integration: a pendulum for each method, in echelon behind the exact one."""

import numpy as np

from labs.appendix.integration.params import METHOD_TITLES
from labs.models.pendulums import GRAY, ROD_LENGTH, pendulum_arm
from labs.scene import Scene

COLORS = tuple(
    tuple(int(code[i : i + 2], 16) / 255 for i in (0, 2, 4))
    for code in ["215694", "b54300", "578e55", "be5791", "b7931f", "5b5fd0", "959a99", "0097c1"]
)
"""Close to those of the plots' eight lines, and seen on white and on dark."""
SPACING = (-0.04, 0.36, 0.0)
"""[m] from the hinge of one pendulum to the next: behind and beside it."""


def draw_pendulums(
    scene: Scene, reference: np.ndarray, angles: np.ndarray, stopped: np.ndarray
) -> None:
    """At `reference` (nq,) and, for each method, `angles` (8, nq) [rad], with a line through all
    the places where the tip would be; those that are `stopped` (8,) are marked."""
    rods = len(reference)
    top = 0.25 + ROD_LENGTH * rods
    scene.camera((1.75 + 0.6 * rods, 0.0, 0.35 + 0.5 * rods), (0.0, -0.04, 0.15 + 0.35 * rods))
    many = len(angles) + 1
    hinges = np.outer(np.arange(many) - (many - 1) / 2, SPACING)
    hinges[:, 2] = top
    scene.trail("beam", hinges, "muted")
    scene.trail("exact", hinges + tip_position(reference), "reference")
    scene.arm("pendulum exact", pendulum_arm(rods, _xy(hinges[0]), GRAY), reference)
    scene.label("name exact", "Exact", hinges[0] + [0.0, 0.0, 0.1])
    for i, (name, title) in enumerate(METHOD_TITLES.items()):
        q, lost, hinge = angles[i], bool(stopped[i]), hinges[i + 1]
        scene.arm(f"pendulum {name}", pendulum_arm(rods, _xy(hinge), COLORS[i]), q)
        above = [0.0, 0.0, (0.22, 0.1)[i % 2]]
        scene.label(f"name {name}", f"{title} ✗" if lost else title, hinge + above)
        if lost:
            scene.sphere(f"lost {name}", hinge + tip_position(q), 0.06, "warning")


def tip_position(q: np.ndarray) -> np.ndarray:
    """(3,) [m] from the hinge to the end of the last rod."""
    angles = np.cumsum(q)
    return ROD_LENGTH * np.array([0.0, np.sin(angles).sum(), -np.cos(angles).sum()])


def _xy(point: np.ndarray) -> tuple[float, float]:
    return float(point[0]), float(point[1])
