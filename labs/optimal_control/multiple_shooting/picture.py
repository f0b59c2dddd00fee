"""The segments in their scene: an arc each, from its start, and what parts them."""

from itertools import pairwise

import numpy as np

from labs.optimal_control.multiple_shooting.structure import ShootingStructure
from labs.scene import Color, Scene
from labs.tasks.direct.history import IterationHistory
from labs.tasks.direct.picture import GAP_TOLERANCE

COLORS: tuple[Color, Color] = ("reference", "actual")
"""Of segments in turn."""


def draw_segments(
    scene: Scene, history: IterationHistory, at: ShootingStructure, failed: bool, bead: float
) -> None:
    """Each from a bead of this radius [m] at its start; a line to the next where there is a gap."""
    tips = history.tips[-1]
    for i, (begin, end) in enumerate(pairwise(at.cuts)):
        color = "warning" if failed else COLORS[i % 2]
        path = tips[begin:end].reshape(-1, 3)
        scene.trail(f"segment {i + 1}", path, color)
        scene.sphere(f"start {i + 1}", path[0], bead, color)
        if end < len(tips) and np.linalg.norm(tips[end, 0] - path[-1]) > GAP_TOLERANCE:
            scene.trail(f"gap {i + 1}", np.stack([path[-1], tips[end, 0]]), "muted")
