"""Torques at the joints of an arm, drawn as circular arrows about their axes."""

import numpy as np
import pinocchio as pin

from labs.models.plant import Plant
from labs.scene import Color, Scene, arc_point

FULL_ARC, LONGEST_ARC = 4.5, 6.0
"""[rad] what an arc spans for a torque at its motor's limit, and at most."""
SHORTEST_ARC = 0.03
"""[rad] shorter ones are not drawn."""
NAMED_ARC = 0.4
"""[rad] from here on an arc has its name."""
SUBSCRIPTS = "₀₁₂₃₄₅₆₇₈₉"
RADIUS = 0.14
"""[m]"""


def draw_torque_arcs(scene: Scene, world: Plant, q: np.ndarray, tau: np.ndarray) -> None:
    """An arc "torque i" for each of tau (nv,) [N m] at q (nq,) [rad], in its sense, red from the
    motor's limit on."""
    axes = pin.computeJointJacobians(world.model, world.data, q)[3:]  # it places the joints, too
    for i, share in enumerate(tau / world.arm.torque_limit):
        angle = float(np.clip(FULL_ARC * share, -LONGEST_ARC, LONGEST_ARC))
        if abs(angle) > SHORTEST_ARC:
            color: Color = "warning" if abs(share) >= 1.0 else "force"
            center = world.data.oMi[i + 1].translation
            scene.arc(f"torque {i + 1}", center, axes[:, i], angle, RADIUS, color)
            if abs(angle) > NAMED_ARC:
                end = arc_point(center, axes[:, i], angle, 1.3 * RADIUS)
                scene.label(f"name of torque {i + 1}", f"τ{SUBSCRIPTS[i + 1]}", end)
