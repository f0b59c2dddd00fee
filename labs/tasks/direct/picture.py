"""The motion of a direct method in its scene, in collocation, multiple shooting and the race of
direct methods: the pieces of the path, parted where they do not join."""

import numpy as np

from labs.scene import Color, Scene
from labs.tasks.direct.history import KEPT_PATHS, IterationHistory, shift_in_time
from labs.tasks.direct.params import DirectParams
from labs.tasks.direct.plan_params import PlanParams
from labs.tasks.direct.player import DirectState
from labs.tasks.motion.playback import FEEDBACK, OPEN_LOOP

GAP_TOLERANCE = 2e-3
"""[m] A gap from which on a path is drawn as broken."""
MIN_PATH_DISTANCE = 0.01
"""[m] from the newest path, from which on an earlier one is drawn."""
SPACING = np.array([0.03, 0.0, 0.0])
"""[m] by which an earlier path of a plane motion stands behind the next."""
MIN_VELOCITY_GAP, ARROW_SCALE = 0.02, 0.05
"""[m/s] A gap of the tip's velocity from which on it has an arrow; its length [s]."""
LABEL_DISTANCE = 0.1
"""[m] between the tips from which on the ghost says what it is."""
MAX_PATH_POINTS = 200
"""Of a path, at most."""


def draw_robots(scene: Scene, params: DirectParams, state: DirectState) -> None:
    """The robot under feedback and its open-loop ghost."""
    at, playback = params.task, state.playback
    n, arm = at.mechanism.nq, at.mechanism.arm
    scene.camera(*at.camera)
    effort = None
    if params.bound is not None:
        effort = at.mechanism.S @ (np.abs(playback.u[FEEDBACK]) / params.bound)
    scene.arm("robot", arm, playback.x[FEEDBACK, :n], effort=effort)
    scene.arm("open loop", arm, playback.x[OPEN_LOOP, :n], ghost=True)
    tips = at.mechanism.tip_positions(playback.x)
    if np.linalg.norm(tips[FEEDBACK] - tips[OPEN_LOOP]) > LABEL_DISTANCE:
        scene.label("of open loop", "open loop", tips[OPEN_LOOP])


def draw_goal(scene: Scene, params: PlanParams) -> None:
    """Where the tip should end, and the ball it must stay out of."""
    if len(params.task.goal):
        scene.sphere("goal", params.goal_position, 0.025, "reference")
    else:
        scene.handle("target", params.target, 0.04)
    ball = params.ball
    if ball:
        scene.ellipsoid("around obstacle", ball.center, ball.radius * np.eye(3), "warning")
        scene.handle("obstacle", ball.center, 0.03)


def draw_paths(scene: Scene, params: DirectParams, state: DirectState) -> None:
    """The pieces of the newest path, each from a bead where it starts, joined where they meet;
    fading behind it the paths of iterations before; the velocity that is missing between pieces;
    and where on the path the motion is."""
    tips = state.history.tips
    color: Color = "warning" if state.failed else "reference"
    runs = join_pieces(tips[-1])
    for i, run in enumerate(runs, 1):
        scene.trail(f"piece {i}", run, color)
        if len(runs) > 1:
            scene.sphere(f"start {i}", run[0], 0.012, color)
    for i in range(KEPT_PATHS - 1):
        if np.abs(tips[i] - tips[-1]).max() > MIN_PATH_DISTANCE:
            age, path = KEPT_PATHS - 1 - i, tips[i].reshape(-1, 3)
            behind = path[:: 1 + len(path) // MAX_PATH_POINTS] - params.task.planar * age * SPACING
            scene.trail(f"before {age}", behind, "muted", (i + 1) / KEPT_PATHS)
    _draw_velocity_gaps(scene, params, state)
    draw_current_position(scene, params, state)


def draw_current_position(scene: Scene, params: DirectParams, state: DirectState) -> None:
    """Where on its path the motion is."""
    color: Color = "warning" if state.failed else "reference"
    plan, body = state.plan, params.task.mechanism
    k = min(state.playback.clock // plan.substeps, plan.N)
    place = body.tip(plan.X[k, : body.nq])
    scene.sphere("now", shift_in_time(params.task, place, np.array(k * plan.h)), 0.02, color)


def _draw_velocity_gaps(scene: Scene, params: DirectParams, state: DirectState) -> None:
    """At each state the velocity that the tip is short of there, coming from the piece before."""
    body, motion = params.task.mechanism, state.motion
    n, gaps = body.nq, motion.gaps[:, body.nq :]
    if np.abs(gaps).max() < MIN_VELOCITY_GAP:
        return
    X = motion.X[1:]
    jumps = np.array([body.tip_jacobian(x[:n]) @ gap for x, gap in zip(X, gaps, strict=True)])
    large = np.linalg.norm(jumps, axis=1) > MIN_VELOCITY_GAP
    tips = body.tip_positions(X[large])
    starts = shift_in_time(params.task, tips, motion.times[1:][large])
    scene.arrows("velocity gaps", starts, starts + ARROW_SCALE * jumps[large])


def join_pieces(arcs: np.ndarray) -> list[np.ndarray]:
    """Pieces (k, points, 3) [m] as paths (n, 3), parted where there is a gap to be seen."""
    gaps = np.linalg.norm(arcs[1:, 0] - arcs[:-1, -1], axis=1)
    cuts = np.flatnonzero(gaps > GAP_TOLERANCE) + 1
    return [np.concatenate(list(run)) for run in np.split(arcs, cuts)]


def phase_fields(history: IterationHistory) -> dict[str, np.ndarray]:
    """The newest motion in the phase plane, one curve a piece, and the one before it."""
    now, before = history.phases[-1], history.phases[-2]
    return {
        "piece_q": now[:, :, 0].T,
        "piece_v": now[:, :, 1].T,
        "before_q": before[:, :, 0].ravel(),
        "before_v": before[:, :, 1].ravel(),
    }
