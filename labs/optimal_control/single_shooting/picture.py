"""The motion in its scene. Time runs away from the viewer: the path of a tip is drawn as it would
be if the world moved back, so that motions along one circle part."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from labs.optimal_control.single_shooting.control_changes import changed_motions
from labs.optimal_control.single_shooting.history import KEPT_PATHS
from labs.optimal_control.single_shooting.params import SingleShootingParams
from labs.optimal_control.single_shooting.plan import ShootingPlan, interpolate_state
from labs.params import Value
from labs.scene import Scene
from labs.shapes import Vector3
from labs.tasks.direct.history import shift_in_time
from labs.tasks.direct.systems import CAMERAS as TASK_CAMERAS
from labs.tasks.direct.systems import RestToRestTask, rest_to_rest_task

CAMERAS: Mapping[str, tuple[Vector3, Vector3]] = {
    "mass": ((2.2, 0.7, 1.45), (-0.1, 0.35, 0.4)),
    "pendulum": ((1.5, 0.8, 1.05), (-0.1, 0.2, 0.7)),
    "double-pendulum": ((2.6, 1.4, 1.9), (-0.1, 0.3, 1.2)),
    "cart-pole": ((2.4, 0.8, 1.4), (-0.1, 0.0, 0.65)),
    "ur5": TASK_CAMERAS["ur5"],
}
"""By motion: where a viewer stands and what it looks at [m], so that time is seen to run back."""
STRIP_POSITIONS: Mapping[str, Vector3] = {
    "mass": (0.2, 0.0, 0.2),
    "pendulum": (0.0, 0.65, 0.6),
    "double-pendulum": (0.0, 1.15, 1.0),
    "cart-pole": (0.2, -0.4, 0.12),
    "ur5": (-0.3, 0.0, 0.5),
}
"""Where the strip of the control's change begins [m]: beside what swings, below what slides."""
PATH_POINTS = 80
"""Of a path."""
WIDTH, HEIGHT = 0.8, 0.12
"""[m] of the strip of the control's change: of the whole time, and of u_0."""
MIN_PATH_DISTANCE = 0.01
"""[m] Paths that differ by no more lie on one another."""
HANDLE_RADIUS = 0.03
"""[m] radius of the ball that changes a control."""
LABEL_DISTANCE = 0.1
"""[m] between the tips from which on the ghost says what it is."""


def draw_robots(scene: Scene, params: SingleShootingParams, plan: ShootingPlan, t: float) -> None:
    """The robot as the simulation has it at t [s], and as the ghost where the changed control
    would have it; without a change, where the plan has it."""
    at = params.task
    arm, n = at.mechanism.arm, at.mechanism.nq
    scene.camera(*CAMERAS[at.motion])
    x = interpolate_state(plan.simulated_run(params.feedback)[0], plan.T, t)
    piece = _changed_piece(params, plan)
    changed = changed_motions(params.system, plan, piece, params.delta).states[-1]
    ghost = interpolate_state(changed, plan.T, t)
    scene.arm("robot", arm, x[:n])
    scene.arm("ghost", arm, ghost[:n], ghost=True)
    tips = at.mechanism.tip_positions(np.array([x, ghost]))
    if np.linalg.norm(tips[0] - tips[1]) > LABEL_DISTANCE:
        word = "planned" if params.delta == 0.0 else "changed"
        scene.label("of ghost", word, tips[1])


def draw_paths(
    scene: Scene,
    params: SingleShootingParams,
    plan: ShootingPlan,
    paths: np.ndarray,
    t: float,
    failed: bool,
) -> None:
    """The plan's path, the last of `paths`, and where along it t [s] is; fading behind it those of
    the iterations before, or the fan of what a changed control makes of it."""
    scene.trail("plan", paths[-1], "warning" if failed else "reference")
    place = params.task.mechanism.tip(
        interpolate_state(plan.X, plan.T, t)[: params.task.mechanism.nq]
    )
    scene.sphere("now", shift_in_time(params.task, place, np.array(t)), 0.02, "reference")
    if params.delta == 0.0:
        for i in range(KEPT_PATHS - 1):
            if np.abs(paths[i] - paths[i + 1]).max() > MIN_PATH_DISTANCE:
                scene.trail(f"before {KEPT_PATHS - 1 - i}", paths[i], "muted", (i + 1) / KEPT_PATHS)
        return
    *fan, chosen = _fan_lines(params.system, plan, _changed_piece(params, plan), params.delta)
    for i, line in enumerate(fan, 1):
        scene.trail(f"fan {i}", line, "force", 0.3)
    scene.trail("changed", chosen, "force")


def draw_change(scene: Scene, params: SingleShootingParams) -> None:
    """The change of the control over time, as a strip with a ball to drag."""
    begin, end = (np.array([params.chosen_piece, params.chosen_piece + 1]) / params.N) * WIDTH
    y = np.array([0.0, begin, begin, end, end, WIDTH])
    z = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) * HEIGHT * params.delta
    points = np.array(STRIP_POSITIONS[params.task.motion]) + np.stack([np.zeros(6), y, z], axis=1)
    scene.trail("change", points, "force")
    scene.handle("control", (points[2] + points[3]) / 2.0, HANDLE_RADIUS)
    scene.label("of change", "change of u(t)", points[0] + np.array([0.0, 0.5 * WIDTH, -0.1]))


def dragged_control(
    params: SingleShootingParams, point: tuple[float, float, float]
) -> dict[str, Value]:
    """What the ball of the strip at `point` [m] says: which control, and its change."""
    _, y, z = np.array(point) - STRIP_POSITIONS[params.task.motion]
    return {
        "piece": params.nearest("piece", min(max(np.floor(y / WIDTH * params.N) + 1, 1), params.N)),
        "delta": params.nearest("delta", z / HEIGHT),
    }


def drawn_path(at: RestToRestTask, X: np.ndarray, T: float) -> np.ndarray:
    """(PATH_POINTS, 3) [m] of the tip along X (k + 1, nx) over T [s], as it is drawn."""
    t = np.linspace(0.0, T, PATH_POINTS)
    tips = at.mechanism.tip_positions(np.array([interpolate_state(X, T, time) for time in t]))
    return shift_in_time(at, tips, t)


@lru_cache(maxsize=4)
def _fan_lines(name: str, plan: ShootingPlan, k: int, change: float) -> tuple[np.ndarray, ...]:
    """Of the motions with other controls u_k, the last as chosen."""
    fan = changed_motions(name, plan, k, change).states
    return tuple(drawn_path(rest_to_rest_task(name), X, plan.T) for X in fan)


def _changed_piece(params: SingleShootingParams, plan: ShootingPlan) -> int:
    """The changed piece, in a plan that may have fewer than are asked for now."""
    return min(params.chosen_piece, plan.N - 1)
