"""The three plans in the scene, one robot behind another."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pinocchio as pin

from labs.models.arms import Arm
from labs.optimal_control.direct_methods.method_runs import MethodRun, MethodRuns
from labs.optimal_control.direct_methods.methods import TRANSCRIPTIONS
from labs.optimal_control.direct_methods.params import DirectMethodsParams
from labs.scene import Color, Scene
from labs.shapes import Vector3, translation
from labs.tasks.direct.history import shift_in_time
from labs.tasks.direct.picture import draw_goal, join_pieces
from labs.tasks.direct.systems import CAMERAS, rest_to_rest_task
from labs.tasks.motion.playback import SUBSTEP

COLORS: Mapping[str, Color] = {
    "single": "actual",
    "multiple": "reference",
    "collocation": "force",
}
BODIES: Mapping[str, Vector3] = {
    "single": (0.15, 0.39, 0.92),
    "multiple": (0.92, 0.5, 0.11),
    "collocation": (0.75, 0.09, 0.51),
}


@dataclass(frozen=True)
class RowLayout:
    """Where things are [m]."""

    camera: tuple[Vector3, Vector3]
    depth: float
    """From one robot to the one behind it; 0: all are in the same place."""
    label: Vector3
    """Where the name stands, by the robot's base; where all are in one place, above its tip."""


LAYOUTS: Mapping[str, RowLayout] = {
    "mass": RowLayout(((2.3, 0.5, 1.9), (-0.35, 0.3, 0.45)), 0.45, (0.0, -0.9, 0.72)),
    "pendulum": RowLayout(((1.3, 0.75, 1.2), (-0.4, 0.0, 0.72)), 0.4, (0.0, 0.0, 0.12)),
    "double-pendulum": RowLayout(((2.2, 1.1, 2.0), (-0.5, 0.0, 1.15)), 0.6, (0.0, 0.0, 0.1)),
    "cart-pole": RowLayout(((2.2, 0.6, 2.0), (-0.45, 0.0, 0.6)), 0.6, (0.0, -1.0, 0.72)),
    "ur5": RowLayout(CAMERAS["ur5"], 0.0, (0.0, 0.0, 0.07)),
}


def draw_plans(scene: Scene, params: DirectMethodsParams, race: MethodRuns, clock: int) -> None:
    """Each at the same time of its own plan, with the path of its tip, parted where it does not
    join. Who has failed is a ghost."""
    layout = LAYOUTS[params.task.motion]
    scene.camera(*layout.camera)
    for i, (name, at) in enumerate(race.items()):
        offset = np.array([-layout.depth * i, 0.0, 0.0])
        _draw_plan(scene, params, name, at, clock, offset)
        if len(params.task.goal):
            scene.sphere(f"goal of {name}", params.goal_position + offset, 0.022, "muted")
    if not len(params.task.goal):
        draw_goal(scene, params)


def _draw_plan(
    scene: Scene,
    params: DirectMethodsParams,
    name: str,
    at: MethodRun,
    clock: int,
    offset: np.ndarray,
) -> None:
    task, layout = params.task, LAYOUTS[params.task.motion]
    q = at.motion.state(clock * SUBSTEP)[: task.mechanism.nq]
    body = _colored_arm(params.system, name) if layout.depth else task.mechanism.arm
    ghost = at.failed or (not layout.depth and name != "collocation")
    scene.arm(f"robot of {name}", body, q, ghost=ghost)
    tips = at.history.tips[-1]
    times = np.linspace(0.0, at.motion.T, len(tips) + 1)[:-1, None]
    times = times + np.linspace(0.0, at.motion.T / len(tips), tips.shape[1])
    paths = tips - shift_in_time(params.task, np.zeros_like(tips), times) + offset
    for i, run in enumerate(join_pieces(paths), 1):
        scene.trail(f"path of {name}, piece {i}", run, "warning" if at.failed else COLORS[name])
    place = np.array(layout.label) + offset
    if not layout.depth:
        place = task.mechanism.tip(q) + place * (1 + list(TRANSCRIPTIONS).index(name))
    scene.label(f"name of {name}", TRANSCRIPTIONS[name] + (": failed" if at.failed else ""), place)


@cache
def _colored_arm(system_name: str, method: str) -> Arm:
    """The robot of a system, in the colour and at the place of a method."""
    task = rest_to_rest_task(system_name)
    arm, depth = task.mechanism.arm, LAYOUTS[task.motion].depth
    moved = translation(-depth * list(TRANSCRIPTIONS).index(method), 0.0, 0.0)
    model = pin.Model(arm.model)
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = moved * model.jointPlacements[joint]
    visuals = tuple(
        replace(v, color=BODIES[method]) if v.joint else replace(v, placement=moved * v.placement)
        for v in arm.visuals
    )
    return replace(arm, model=model, visuals=visuals, collisions=visuals)
