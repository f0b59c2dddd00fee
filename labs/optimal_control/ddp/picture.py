"""The motion in its scene: both robots, the plan and the iterations before it."""

import numpy as np

from labs.models.mechanisms import mechanism
from labs.optimal_control.ddp.history import KEPT_PATHS, DdpHistory, subsample
from labs.optimal_control.ddp.params import DdpParams
from labs.scene import Scene
from labs.tasks.motion.playback import FEEDBACK, OPEN_LOOP

PATH_SPACING = np.array([0.06, 0.0, 0.0])
"""[m] by which the path of an iteration stands behind the next, where all lie in one plane."""
ARROW_SCALE = 0.08
"""[m/(N s)] length of the arrow of a push."""
LABEL_DISTANCE = 0.1
"""[m] between the tips from which on the ghost says what it is."""


def draw_robots(scene: Scene, params: DdpParams, x: np.ndarray, u: np.ndarray) -> None:
    """The robot under feedback and its open-loop ghost, at their states x (2, nx) and under their
    controls u (2, nu)."""
    system = mechanism(params.system)
    scene.camera(*params.motion.camera)
    effort = None
    if params.bound is not None:
        effort = system.S @ (np.abs(u[FEEDBACK]) / params.bound)
    scene.arm("robot", system.arm, x[FEEDBACK, : system.nq], effort=effort)
    scene.arm("open loop", system.arm, x[OPEN_LOOP, : system.nq], ghost=True)


def draw_paths(
    scene: Scene, params: DdpParams, history: DdpHistory, failed: bool, played: np.ndarray
) -> None:
    """The path of the plan's tip, fading behind it those of earlier iterations, and that of the
    states played so far (k, nx)."""
    paths = history.tip_paths
    spacing = PATH_SPACING if params.motion.goal else 0.0
    for i in range(KEPT_PATHS - 1):
        if not np.array_equal(paths[i], paths[i + 1]):
            age = KEPT_PATHS - 1 - i
            scene.trail(f"before {age}", paths[i] - age * spacing, "muted", (i + 1) / KEPT_PATHS)
    scene.trail("plan", paths[-1], "warning" if failed else "reference")
    if len(played) > 1:
        scene.trail("played", mechanism(params.system).tip_positions(subsample(played)))


def draw_goal(
    scene: Scene, params: DdpParams, x: np.ndarray, goal: np.ndarray, pushed: bool
) -> None:
    """Where the tip should end (3,) [m], a push on both tips, and the name of the ghost."""
    ends = mechanism(params.system).tip_positions(x)
    if np.linalg.norm(ends[FEEDBACK] - ends[OPEN_LOOP]) > LABEL_DISTANCE:
        scene.label("of open loop", "open loop", ends[OPEN_LOOP])
    if pushed:
        impulse = np.array([0.0, ARROW_SCALE * params.push, 0.0])
        scene.arrow("push", ends[FEEDBACK], ends[FEEDBACK] + impulse)
    if params.motion.goal:
        scene.sphere("goal", goal, 0.03, "reference")
    else:
        scene.handle("target", params.target, 0.04)
