"""Drawing deep Q-learning: the robot under its greedy policy, and beside it the relief of its value
function with the policy as arrows and the robot's way on it."""

import numpy as np

from labs.colors import sequential
from labs.reinforcement_learning.dqn.driven_robot import DrivenRobot
from labs.reinforcement_learning.dqn.tasks import RobotTask, posture_at
from labs.scene import Scene
from labs.tasks.environments.reach import reach

HEIGHT = 0.5
"""[m] of the relief at its largest value."""
SIZE = np.array([1.6, 1.4])
"""[m] of the relief along the first coordinate and the second."""
ARROW, ARROW_STRIDE = 0.07, 3
"""[m] its length at full torque; every so many nodes."""
PATH_LIFT = 0.015
"""[m] Lines float so far above the relief."""


def draw_learned(
    scene: Scene, task: RobotTask, value: np.ndarray, policy: np.ndarray, at: DrivenRobot
) -> None:
    """`value` and `policy` as `plots.value_map` has them."""
    scene.camera(*task.camera)
    scene.arm("robot", task.arm, task.pose(at.x))
    low, high = float(value.min()), float(value.max())
    top = HEIGHT * task.relief[1]
    heights = top * (value - low) / max(high - low, 1e-9)
    across, up = np.meshgrid(task.map_axis(0), task.map_axis(1))
    nodes = np.stack([across, up], axis=-1)
    scene.surface("value", _map_points(task, nodes, heights), sequential(heights, 0.0, top))
    _draw_policy(scene, task, nodes, heights, policy)
    way = task.map_position(at.path)
    jumps = np.flatnonzero(np.abs(np.diff(way[:, 0])) > task.half_range[0])
    way = way[jumps[-1] + 1 :] if len(jumps) else way
    way = np.clip(way, -task.half_range, task.half_range)
    lifted = _map_points(task, way, _height_at(task, heights, way) + PATH_LIFT)
    if len(lifted) > 1:
        scene.trail("way", lifted, "reference")
    scene.sphere("state", lifted[-1], 0.03 * task.relief[1], "reference")


def _draw_policy(
    scene: Scene, task: RobotTask, nodes: np.ndarray, heights: np.ndarray, policy: np.ndarray
) -> None:
    some = (slice(1, None, ARROW_STRIDE),) * 2
    starts = _map_points(task, nodes[some], heights[some] + PATH_LIFT).reshape(-1, 3)
    along = ARROW * task.relief[1] * task.torques[policy[some].ravel(), 0] / task.max_torque
    ends = starts + along[:, None] * np.array([0.0, 1.0, 0.0])
    scene.arrows("policy", starts, ends, "muted")


def _map_points(task: RobotTask, at: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """(..., 3) [m] of places (..., 2) on the map, `heights` (...) above the floor."""
    (x, y, floor), size = task.relief
    x = x - 0.5 * size * SIZE[1] * at[..., 1] / task.half_range[1]
    y = y + 0.5 * size * SIZE[0] * at[..., 0] / task.half_range[0]
    return np.stack([x, y, floor + heights], axis=-1)


def _height_at(task: RobotTask, heights: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Of the relief at places (k, 2), by the nearest node."""
    rows, columns = heights.shape
    i = np.rint((at[:, 1] / task.half_range[1] + 1.0) * 0.5 * (rows - 1)).astype(int)
    j = np.rint((at[:, 0] / task.half_range[0] + 1.0) * 0.5 * (columns - 1)).astype(int)
    return np.asarray(heights[i, j])


def draw_target(scene: Scene, task: RobotTask, at: DrivenRobot, x: float, z: float) -> None:
    """The ball to drag, and where the tip goes: the nearest place within reach."""
    tip = reach().tips(posture_at(x, z)[None])[0]
    scene.handle("target", (x, tip[1], z), 0.05)
    scene.sphere("aim", tip, 0.025, "reference")
