"""Robot, ghost and reference in their scene."""

import numpy as np

from labs.models.cart_pole import HINGE_HEIGHT
from labs.models.mechanisms import mechanism
from labs.optimal_control.lqr_tracking.laps import CONTROL_PERIOD, Lap, tracked_point
from labs.optimal_control.lqr_tracking.params import TrackingParams
from labs.optimal_control.lqr_tracking.tracking import LimitedPreview
from labs.scene import Scene

CART_TRAIL, ARM_TRAIL = 150, 50
"""Points of a cart's trail and of an arm's, one a step: 3 s and 1 s."""
SCROLL_SPEED, SCREEN_X = 0.25, -0.35
"""[m/s] a cart's reference comes down on its screen, and where that stands behind the rail [m]."""
ARROW_SCALE = 1.0 / 100.0
"""[m/N] length of the force's arrow."""
CAMERAS = {
    "ur5": ((1.1, -0.42, 0.56), (0.29, 0.08, 0.35)),
    "cart-pole": ((2.1, 0.25, 1.1), (0.0, 0.0, 0.72)),
}


def draw_tracking(
    scene: Scene,
    params: TrackingParams,
    now: LimitedPreview,
    states: tuple[np.ndarray, np.ndarray],
    force: float,
    trails: np.ndarray,
) -> None:
    """Robot and ghost at their states (nx,), what they follow, and the force [N] on the robot;
    `trails` (2, k, 3) [m] is where both were."""
    robot = mechanism(params.robot)
    nq, (x, ghost) = robot.nq, states
    u = now.u_ref + now.gain @ (x - now.x_ref) + now.k
    effort = np.zeros(nq)
    effort[list(robot.actuated_joints)] = np.abs(u) / robot.control_limit
    scene.camera(*CAMERAS[params.robot])
    scene.arm("robot", robot.arm, x[:nq], effort=effort)
    scene.arm("ghost", robot.arm, ghost[:nq], ghost=True)
    _draw_trails(scene, params, now, x, trails)
    scene.sphere("goal", now.lap.points[now.index], 0.014, "reference")
    scene.handle("size", _handle_position(params, now.lap), 0.018)
    if force != 0.0:
        tip = tracked_point(robot, x[:nq])
        scene.arrow("force", tip, tip + np.array([0.0, ARROW_SCALE * force, 0.0]))


def _draw_trails(
    scene: Scene, params: TrackingParams, now: LimitedPreview, x: np.ndarray, trails: np.ndarray
) -> None:
    """The reference with the part in view brighter, the plan from x (nx,), and the past."""
    robot, samples, steps = mechanism(params.robot), params.samples, int(params.preview)
    ahead = now.lap.points[(now.index + np.arange(max(samples, steps) + 1)) % samples]
    deviations, _ = now.window.rollout(now.policy, x - now.x_ref)
    planned = now.lap.x_ref[(now.index + np.arange(steps + 1)) % samples]
    rows = planned + deviations[: steps + 1]
    plan = np.array([tracked_point(robot, row[: robot.nq]) for row in rows])
    past, ghost_past = trails[:, -ARM_TRAIL:]
    if params.robot == "cart-pole":
        ahead, plan = _project_on_screen(ahead[:CART_TRAIL]), _project_on_screen(plan)
        past, ghost_past = (_project_on_screen(trail[::-1], -1.0) for trail in trails)
    scene.trail("reference", ahead, "reference", 0.35)
    if steps > 0:
        scene.trail("preview", ahead[: steps + 1], "reference")
        scene.trail("plan", plan, "actual", 0.45)
    if len(past) > 1:
        scene.trail("past", past)
        scene.trail("ghost's past", ghost_past, "muted")


def _project_on_screen(points: np.ndarray, direction: float = 1.0) -> np.ndarray:
    """Where a cart will be, on a screen behind the rail: the future above it and coming down; the
    past, newest first and with direction -1, below."""
    z = HINGE_HEIGHT + direction * SCROLL_SPEED * CONTROL_PERIOD * np.arange(len(points))
    return np.column_stack([np.full(len(points), SCREEN_X), points[:, 1], z])


def _handle_position(params: TrackingParams, lap: Lap) -> np.ndarray:
    """Where the ball is that sets the size: on the lap's first point, or on the rail."""
    if params.robot == "cart-pole":
        return np.array([-0.1, params.stroke, HINGE_HEIGHT])
    start: np.ndarray = lap.points[0]
    return start
