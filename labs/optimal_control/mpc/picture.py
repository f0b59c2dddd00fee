"""The robot in its scene, with what it predicts and what it predicted before."""

import numpy as np
import pinocchio as pin

from labs.optimal_control.mpc.history import KEPT_PREDICTIONS, PlanningHistory
from labs.optimal_control.mpc.params import MpcParams
from labs.scene import Scene

SPACING = 0.02
"""[m] by which an earlier prediction of a motion in a plane stands behind the next."""
ARROW_SCALE = 0.06
"""[m/(N s)] length of the arrow of a push."""
GHOST_DISTANCE = 0.05
"""[m] between the tip and where it will be, from which on the robot is also drawn there."""
NEAR_LIMIT = 1.0 - 1e-3
"""Part of a limit from which on it is called reached."""
SUBSCRIPTS = "₀₁₂₃₄₅₆₇₈₉"


def draw_robot(scene: Scene, params: MpcParams, x: np.ndarray, u: np.ndarray) -> None:
    """The robot, rings about the joints that are near a limit of any kind."""
    at = params.robot
    scene.camera(*at.camera)
    scene.arm("robot", at.mechanism.arm, x[: at.n], effort=limit_usage(params, x, u).max(axis=0))


def limit_usage(params: MpcParams, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(3, nq): what position, velocity and control are of their limits at each joint."""
    at = params.robot
    _, upper, u_max = params.bounds
    part = np.abs(x - at.x0) / (upper - at.x0)
    return np.stack([part[: at.n], part[at.n :], at.mechanism.S @ (np.abs(u) / u_max)])


def draw_predictions(scene: Scene, params: MpcParams, history: PlanningHistory) -> None:
    """The path ahead and where it ends, the predictions before it, fading, and the path behind."""
    at = params.robot
    planar = params.system != "ur5"
    if len(history.past) > 1:
        scene.trail("past", at.mechanism.tip_positions(history.past[::2]))
    for i, old in enumerate(history.predictions):
        age = len(history.predictions) - i
        behind = np.array([-SPACING * age * planar, 0.0, 0.0])
        path = at.mechanism.tip_positions(old.X[::2]) + behind
        if len(path) > 1:
            scene.trail(
                f"before {age}",
                path,
                "muted",
                (KEPT_PREDICTIONS + 1 - age) / (KEPT_PREDICTIONS + 1),
            )
    now = history.latest
    if now is None:
        return
    path = at.mechanism.tip_positions(now.X)
    scene.trail("prediction", path, "reference")
    scene.sphere("end of the horizon", path[-1], 0.012, "reference")
    if np.linalg.norm(path[-1] - at.mechanism.tip(history.past[-1, : at.n])) > GHOST_DISTANCE:
        scene.arm("at the end of the horizon", at.mechanism.arm, now.X[-1, : at.n], ghost=True)


def draw_limits(scene: Scene, params: MpcParams, x: np.ndarray, u: np.ndarray) -> None:
    """At each joint the names of the limits that it is at."""
    at = params.robot
    reached = limit_usage(params, x, u) >= NEAR_LIMIT
    if not reached.any():
        return
    body = at.mechanism
    pin.forwardKinematics(body.model, body.data, x[: at.n])
    for i in map(int, np.flatnonzero(reached.any(axis=0))):
        kinds = [kind for kind, is_at in zip("qvu", reached[:, i], strict=True) if is_at]
        names = [f"{kind}{SUBSCRIPTS[i + 1]}" for kind in kinds]
        place = body.data.oMi[i + 1].translation + np.array([0.0, 0.0, 0.12])
        scene.label(f"limits of joint {i + 1}", " ".join(names) + " max", place)


def draw_goal(
    scene: Scene, params: MpcParams, aim: np.ndarray, x: np.ndarray, pushed: bool
) -> None:
    """The target to drag, where a moving one is, the obstacle, and a push."""
    at = params.robot
    scene.handle("target", params.target, 0.04)
    if params.system == "ur5" and params.turns:
        angles = np.linspace(0.0, 1.0 / params.turns, 41)
        scene.trail("circle", np.array([params.target_at(t) for t in angles]), "muted")
        scene.sphere("moving target", aim, 0.025, "reference")
    ball = params.ball
    if ball:
        scene.ellipsoid("around obstacle", ball.center, ball.radius * np.eye(3), "warning")
        scene.handle("obstacle", ball.center, 0.03)
    if pushed:
        tip = at.mechanism.tip(x[: at.n])
        scene.arrow("push", tip, tip + np.array([0.0, ARROW_SCALE * params.push, 0.0]))
