"""The scene of differential kinematics: columns of the Jacobian, the twist and ellipsoids."""

import numpy as np

from labs.algorithms.jacobian import PosedChain
from labs.arrays import clip_norm
from labs.scene import Scene

CAMERA = ((0.92, 1.0, 0.87), (0.36, 0.08, 0.4))
"""Where a viewer stands and what it looks at [m]: reaching arms stay in view."""
AXIS, COLUMN, TWIST = 0.3, 0.4, 0.8
"""[m] length of an axis; of a column of J_p per m/rad; of the velocity per m/s."""
VELOCITY_ELLIPSOID_SCALE, FORCE_ELLIPSOID_SCALE, MAX_HALF_AXIS = 0.25, 0.06, 0.4
"""[m] per unit singular value of J_p, and of its inverse; longest half-axis drawn."""


def draw_columns(scene: Scene, columns: str, chain: PosedChain, jacobian: np.ndarray) -> None:
    """Axes z_i and columns J_pi: all at their joints, or one with the lever p_e - p_i."""
    tip = chain.placement.translation
    for i, (z, p, column) in enumerate(zip(chain.axes, chain.points, jacobian[:3].T, strict=True)):
        alone = columns == str(i + 1)
        if not (alone or columns == "all") or not chain.supports[i]:
            continue
        scene.arrow(f"axis {i + 1}", p - AXIS / 2 * z, p + AXIS / 2 * z, "muted")
        if alone:
            scene.trail("lever", np.array([p, tip]), "actual")
        start = tip if alone else p
        if np.linalg.norm(column) > 0.02:
            scene.arrow(f"column {i + 1}", start, start + COLUMN * column, "actual")


def draw_twist(scene: Scene, tip: np.ndarray, twist: np.ndarray) -> None:
    """The velocity of the frame as an arrow, its angular velocity as an arc around it."""
    linear, angular = clip_norm(TWIST * twist[:3], MAX_HALF_AXIS), twist[3:]
    if np.linalg.norm(linear) > 0.01:
        scene.arrow("velocity", tip, tip + linear, "reference")
    omega = float(np.linalg.norm(angular))
    if omega > 0.02:
        scene.arc("angular velocity", tip, angular, min(2.0 * omega, 5.5), 0.15, "reference")


def draw_ellipsoids(scene: Scene, which: str, tip: np.ndarray, linear: np.ndarray) -> None:
    """J_p maps the unit ball of joint velocities to half-axes sigma_k u_k; J_p^T f of length 1
    takes forces on half-axes u_k / sigma_k."""
    u, sigma, _ = np.linalg.svd(linear, full_matrices=False)
    if which in ("velocity", "both"):
        scene.ellipsoid("velocities", tip, u * (VELOCITY_ELLIPSOID_SCALE * sigma), "actual")
    if which in ("force", "both"):
        lengths = np.minimum(FORCE_ELLIPSOID_SCALE / np.maximum(sigma, 1e-9), MAX_HALF_AXIS)
        scene.ellipsoid("forces", tip, u * lengths, "force")


def draw_out_of_reach(scene: Scene, place: np.ndarray, distance: float) -> None:
    """That no posture brings the frame nearer to a place (3,) [m] than this distance [m]."""
    above = place + np.array([0.0, 0.0, 0.1])
    scene.label("out of reach", f"Out of reach by {distance:.2f} m", above)


def draw_warning(scene: Scene, tip: np.ndarray, sigma_min: float) -> None:
    """That a singularity is near the end-effector at `tip` (3,) [m]."""
    scene.sphere("singular", tip, 0.03, "warning")
    above = tip + np.array([0.0, 0.0, 0.2])
    scene.label("warning", f"Singularity near: σ = {sigma_min:.3f}", above)
