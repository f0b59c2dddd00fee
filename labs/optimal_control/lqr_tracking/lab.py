"""Tracking with the linear quadratic regulator (notes, 2.4.3 to 2.4.5): gains that vary with time,
the affine term k_t, and what it is worth to know the reference before it moves."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from labs.algorithms.riccati import prepare
from labs.lab import Action, Inputs, Lab, Measurement, State
from labs.models.cart_pole import HEIGHT
from labs.models.discrete import Discrete
from labs.models.mechanisms import Mechanism, mechanism
from labs.optimal_control.lqr_tracking.laps import (
    FEED_FORWARDS,
    METHOD,
    Course,
    H,
    Lap,
    side_force,
    tracked,
)
from labs.optimal_control.lqr_tracking.tracking import CHOSEN, Setting, View, known, lap_of, view
from labs.params import Group, Knob, Params, Value
from labs.plots import Curves, Line, Matrix, Readout, TimeSeries, Trace
from labs.scene import Scene

FARTHEST = np.pi / 2
"""[rad; m] off its reference a joint is lost: a linearisation says nothing there."""
PUSH_STEPS = 10
"""World steps a push lasts: 0.2 s."""
LONGEST_LAP = 6.0
"""[s]"""
TRAIL, SHORT_TRAIL = 150, 50
"""Points of a cart's trail and of an arm's, one a step: 3 s and 1 s."""
RISE, BEHIND = 0.25, -0.35
"""[m/s] a cart's reference comes down on its screen, and where that stands behind the rail [m]."""
ARROW = 1.0 / 100.0
"""[m/N] length of the force's arrow."""
MOST_MOTORS = 6
GAINS: tuple[tuple[str, Literal["line", "dash"]], ...] = (("q", "line"), ("v", "dash"))
"""What a gain multiplies, and the style of its lines."""
ACROSS, UPWARD = 1, 2
"""The world's axes of a cart and of a path in the horizontal plane, and of the others."""
CAMERAS = {
    "ur5": ((1.1, -0.42, 0.56), (0.29, 0.08, 0.35)),
    "cart-pole": ((2.1, 0.25, 1.1), (0.0, 0.0, 0.72)),
}


REFERENCE = Group("Reference")
POLICY = Group("Policy")
LINEAR_COSTS = Group("Linear costs")
WORLD = Group("World")


class TrackingParams(Params):
    """What the user can turn."""

    robot: str = REFERENCE.choice(
        "ur5", {"ur5": "UR5", "cart-pole": "Cart-pole"}, "Robot", effect="restart"
    )
    """An arm with six motors, or a pole kept upright on a cart with one."""
    path: str = REFERENCE.choice("circle", {"circle": "Circle", "square": "Square"}, "Path")
    """Of the end-effector. The cart follows the circle's shadow, or jumps to and fro."""
    radius: float = REFERENCE.knob(0.15, 0.0, 0.2, "A", "m", "Radius", step=0.005)
    """Of the UR5's circle, or of the one round its square. Drag the ball on it, too."""
    stroke: float = REFERENCE.knob(0.4, 0.0, 0.7, "A_p", "m", "Stroke", step=0.01)
    """How far the cart's reference goes to either side. Drag the ball, too."""
    plane: str = REFERENCE.choice(
        "frontal", {"frontal": "Frontal", "horizontal": "Horizontal", "side": "Side"}, "Plane"
    )
    """Of the UR5's path."""
    lap_time: float = REFERENCE.knob(3.0, 1.0, LONGEST_LAP, "T", "s", "Period", step=0.1)
    """Of one lap. A change keeps the phase."""
    feed_forward: str = REFERENCE.choice("none", FEED_FORWARDS, "Feed-forward", "u^{ref}")
    """What the reference control holds. What it lacks is left to the feedback and to k."""
    preview: float = POLICY.knob(60.0, 0.0, 100.0, "N", "steps", "Preview", step=1.0)
    """Steps of 20 ms that the policy sees ahead. With none it is the ghost's."""
    position_weight: float = POLICY.knob(
        100.0, 1.0, 1e4, "Q_q", "1/rad², 1/m²", "Position weight", scale="log"
    )
    """Cost of a squared error of position, the same for all joints."""
    velocity_weight: float = POLICY.knob(
        1.0, 0.01, 100.0, "Q_v", "s²/rad², s²/m²", "Velocity weight", scale="log"
    )
    """Cost of a squared error of velocity, the same for all joints."""
    effort_weight: float = POLICY.knob(20.0, 0.1, 1e4, "R", "", "Effort weight", scale="log")
    """Cost of a control that differs from the reference control by the motor's limit."""
    lean: float = LINEAR_COSTS.knob(0.0, -20.0, 20.0, "q", "1/rad, 1/m", "Lean", step=0.1)
    """Linear cost of the place of the shoulder, or of the cart: positive pushes it back."""
    price: float = LINEAR_COSTS.knob(0.0, -20.0, 20.0, "s", "", "Price", step=0.1)
    """Linear cost of the effort at the shoulder, or the cart: positive favours negative."""
    wind: float = WORLD.knob(0.0, -20.0, 20.0, "f_y", "N", "Wind", step=0.5)
    """A steady force on the end-effector, or on the cart, along the world's y axis."""
    wind_known: bool = WORLD.toggle(True, "Wind known")
    """Whether the policy's model has the wind, as part of the defect c."""
    payload: float = WORLD.knob(0.0, 0.0, 2.0, "m_{load}", "kg", "Payload", step=0.05)
    """A point mass at the tip that no policy knows of."""
    push_force: float = WORLD.knob(20.0, -60.0, 60.0, "f_{push}", "N", "Push force", step=1.0)
    """Of a push: along the y axis like the wind, for 0.2 s, known to nobody."""

    @property
    def samples(self) -> int:
        """Steps of a lap."""
        return round(self.lap_time / H)

    @property
    def course(self) -> Course:
        if self.robot == "cart-pole":
            return Course(self.robot, self.path, self.stroke, self.samples)
        return Course(self.robot, self.path, self.radius, self.samples, self.plane)

    @property
    def setting(self) -> Setting:
        return Setting(
            self.course,
            self.feed_forward,
            self.wind if self.wind_known else 0.0,
            (self.position_weight, self.velocity_weight, self.effort_weight),
            (self.lean, self.price),
        )


@dataclass(kw_only=True)
class TrackingState(State):
    """The robot and its ghost. Arrays are never written after they are made."""

    x: np.ndarray
    ghost: np.ndarray
    """(nx,) each: under u_ref + K dx + k, and under u_ref + K dx."""
    phase: float = 0.0
    """Of the lap [cycles]."""
    setting: str = ""
    """What the costs below were paid for."""
    costs: np.ndarray
    """(2, steps) paid for by robot and ghost in the last steps, at most those of a lap."""
    push_left: int = 0
    """World steps the push still lasts."""
    force: float = 0.0
    """[N] along y in the last step: wind and push."""
    trails: np.ndarray
    """(2, k, 3) [m] where robot and ghost were, the newest last."""


class LqrTracking(Lab[TrackingParams, TrackingState]):
    """A robot follows a reference that it sees some way ahead; its ghost, only the present."""

    title = "LQR along a reference"
    section = "2.4.3"
    summary = (
        "Linearise along a motion and follow it: time-varying gains, the affine term, and a "
        "policy that moves before its reference does."
    )
    Params = TrackingParams
    period = H
    plots = (
        TimeSeries("Tracking error", "m", Line("error", "e"), Line("ghost_error", "e^{ghost}")),
        TimeSeries(
            "Position",
            "m",
            Line("p", "p"),
            Line("p_ghost", "p^{ghost}"),
            Line("p_ref", "p^{ref}", "dash"),
        ),
        TimeSeries(
            "Control",
            "N·m, N",
            Line("u", "u", "dash"),
            Line("feedback", r"K_t (x - x^{ref})"),
            Line("u_ref", "u^{ref}"),
            Line("affine", "k_t"),
            select="motor",
        ),
        TimeSeries(
            "Joints", "rad, m", Line("q", "q"), Line("q_ref", "q^{ref}", "dash"), select="joint"
        ),
        TimeSeries(
            "Cost of a lap",
            "",
            Line("lap_cost", "J"),
            Line("ghost_lap_cost", "J^{ghost}"),
            Line("optimum", "J^*", "dash"),
        ),
        Curves(
            "Affine term over the preview",
            "time ahead [s]",
            "k [N·m, N]",
            *tuple(
                Trace("ahead", f"k_{i}", f"k, motor {i}", series=i)
                for i in range(1, MOST_MOTORS + 1)
            ),
        ),
        Curves(
            "Gains over the preview",
            "time ahead [s]",
            "K of the shoulder, or the cart",
            *tuple(
                Trace("ahead", f"K_{kind}{i}", f"by {kind}{i}", style, series=i)
                for kind, style in GAINS
                for i in range(1, MOST_MOTORS + 1)
            ),
        ),
        Matrix("Gain now, by position", "K_position", "K_t", shade=True),
        Matrix("Gain now, by velocity", "K_velocity", "K_t", shade=True),
        Readout("lap_paid", "Cost of a lap", ""),
        Readout("ghost_lap_paid", "Cost of a lap, ghost", ""),
        Readout("optimum", "Predicted optimum", ""),
        Readout("error", "Tracking error", "m"),
        Readout("ghost_error", "Tracking error, ghost", "m"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Square with cut corners": {
            "path": "square",
            "feed_forward": "inverse-dynamics",
            "effort_weight": 300.0,
        },
        "Inverse dynamics": {"feed_forward": "inverse-dynamics", "lap_time": 1.5},
        "Cart-pole, jumping reference": {"robot": "cart-pole", "path": "square", "lap_time": 4.0},
        "Cart-pole, sine": {"robot": "cart-pole"},
    }
    actions = (
        Action("push", "Push", "Pushes robot and ghost for 0.2 s; nobody knows before.", "World"),
    )

    @classmethod
    def prepare(cls) -> None:
        """Compiles the recursion and loads both robots."""
        prepare()
        for robot in CHOSEN:
            known(TrackingParams(robot=robot).setting)

    def init(self, params: TrackingParams, rng: np.random.Generator) -> TrackingState:
        """Robot and ghost on the reference."""
        along = lap_of(params.setting)
        x = along.x_ref[0].copy()
        return TrackingState(
            x=x,
            ghost=x.copy(),
            setting=str(params.setting),
            costs=np.zeros((2, 0)),
            trails=np.tile(along.points[0], (2, 1, 1)),
        )

    def step(self, params: TrackingParams, inputs: Inputs, state: TrackingState) -> TrackingState:
        """One control period. Who is lost stays where it was last, and the world stops."""
        if state.trouble:
            return state
        now = _now(params, state.phase)
        world = mechanism(params.robot, params.payload)
        push_left = PUSH_STEPS if "push" in inputs.actions else state.push_left
        force = params.wind + (params.push_force if push_left > 0 else 0.0)
        after, costs = [], []
        for x, k in ((state.x, now.k), (state.ghost, np.zeros_like(now.k))):
            dx = x - now.x_ref
            du = now.gain @ dx + k
            after.append(_moved(world, x, now.u_ref + du, force))
            costs.append(now.cost(dx, du))
        phase = now.index + 1
        x_ref = now.lap.x_ref[phase % params.samples]
        if trouble := _lost(params, state.t, after, x_ref):
            stopped = copy.deepcopy(state)
            stopped.trouble = trouble
            return stopped

        setting = str(params.setting)
        paid = state.costs if setting == state.setting else np.zeros((2, 0))
        tips = np.stack([tracked(world, x[: world.nq]) for x in after])
        return TrackingState(
            t=state.t + self.period,
            x=after[0],
            ghost=after[1],
            phase=phase / params.samples % 1.0,
            setting=setting,
            costs=np.column_stack([paid, costs])[:, -params.samples :],
            push_left=max(push_left - 1, 0),
            force=force,
            trails=np.concatenate([state.trails, tips[:, None]], axis=1)[:, -TRAIL:],
        )

    def measure(self, params: TrackingParams, state: TrackingState) -> Measurement:
        """At the state's time, with the control of the step to come. Errors are those of the
        end-effector, or the cart; p is its height, or y where it stays at one height. Costs are
        sums over the last lap, or as much of it as was driven since the setting changed."""
        now = _now(params, state.phase)
        world = mechanism(params.robot)
        q, ghost, q_ref = (x[: world.nq] for x in (state.x, state.ghost, now.x_ref))
        goal = now.lap.points[now.index]
        tip, ghost_tip = tracked(world, q), tracked(world, ghost)
        axis = UPWARD if params.robot == "ur5" and params.plane != "horizontal" else ACROSS
        feedback = now.gain @ (state.x - now.x_ref)
        cost, ghost_cost = state.costs.sum(axis=1)
        measured: dict[str, float | np.ndarray] = {
            "q": q,
            "q_ref": q_ref,
            "p": float(tip[axis]),
            "p_ref": float(goal[axis]),
            "p_ghost": float(ghost_tip[axis]),
            "error": float(np.linalg.norm(tip - goal)),
            "ghost_error": float(np.linalg.norm(ghost_tip - goal)),
            "u": now.u_ref + feedback + now.k,
            "u_ref": now.u_ref,
            "feedback": feedback,
            "affine": now.k,
            "lap_cost": float(cost),
            "ghost_lap_cost": float(ghost_cost),
            "optimum": known(params.setting).lap_cost,
        }
        if state.costs.shape[1] == params.samples:
            measured |= {"lap_paid": float(cost), "ghost_lap_paid": float(ghost_cost)}
        return measured

    def fields(self, params: TrackingParams, state: TrackingState) -> Mapping[str, np.ndarray]:
        """The gain now, and over the preview k and the gains of one motor."""
        now = _now(params, state.phase)
        gains, offsets = now.policy.gains, now.policy.offsets
        shown = gains[:, CHOSEN[params.robot]]
        nq, none = shown.shape[1] // 2, np.zeros(0)
        found = {"K_position": now.gain[:, :nq], "K_velocity": now.gain[:, nq:]}
        found["ahead"] = H * np.arange(len(gains))
        for i in range(MOST_MOTORS):
            found[f"k_{i + 1}"] = offsets[:, i] if i < offsets.shape[1] else none
            found[f"K_q{i + 1}"] = shown[:, i] if i < nq else none
            found[f"K_v{i + 1}"] = shown[:, nq + i] if i < nq else none
        return found

    def edit(
        self, params: TrackingParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The ball on the path makes it larger or smaller."""
        if handle != "size":
            return {}
        if params.robot == "cart-pole":
            return {"stroke": _within(params, "stroke", abs(point[1]))}
        arm = mechanism("ur5")
        away = np.linalg.norm(np.array(point) - arm.tip(arm.arm.home))
        return {"radius": _within(params, "radius", float(away))}

    def draw(self, scene: Scene, params: TrackingParams, state: TrackingState) -> None:
        """Robot and ghost, the reference with the part in view brighter, the plan, and the past."""
        robot = mechanism(params.robot)
        now = _now(params, state.phase)
        nq = robot.nq
        u = now.u_ref + now.gain @ (state.x - now.x_ref) + now.k
        effort = np.zeros(nq)
        effort[list(robot.driven)] = np.abs(u) / robot.control_limit
        scene.camera(*CAMERAS[params.robot])
        scene.arm("robot", robot.arm, state.x[:nq], effort=effort)
        scene.arm("ghost", robot.arm, state.ghost[:nq], ghost=True)

        samples, steps = params.samples, int(params.preview)
        ahead = now.lap.points[(now.index + np.arange(max(samples, steps) + 1)) % samples]
        deviations, _ = now.window.follow(now.policy, state.x - now.x_ref)
        planned = now.lap.x_ref[(now.index + np.arange(steps + 1)) % samples]
        rows = planned + deviations[: steps + 1]
        plan = np.array([tracked(robot, row[:nq]) for row in rows])
        past, ghost_past = state.trails[:, -SHORT_TRAIL:]
        if params.robot == "cart-pole":
            ahead, plan = _unrolled(ahead[:TRAIL]), _unrolled(plan)
            past, ghost_past = (_unrolled(trail[::-1], -1.0) for trail in state.trails)
        scene.trail("reference", ahead, "reference", 0.35)
        if steps > 0:
            scene.trail("preview", ahead[: steps + 1], "reference")
            scene.trail("plan", plan, "actual", 0.45)
        if len(past) > 1:
            scene.trail("past", past)
            scene.trail("ghost's past", ghost_past, "muted")
        goal = now.lap.points[now.index]
        scene.sphere("goal", goal, 0.014, "reference")
        scene.handle("size", _handle(params, now.lap), 0.018)
        if state.force != 0.0:
            tip = tracked(robot, state.x[:nq])
            scene.arrow("force", tip, tip + np.array([0.0, ARROW * state.force, 0.0]))


def _now(params: TrackingParams, phase: float) -> View:
    index = round(phase * params.samples) % params.samples
    return view(params.setting, index, int(params.preview))


def _moved(world: Mechanism, x: np.ndarray, u: np.ndarray, force: float) -> np.ndarray:
    """x+ under the control and a force [N] along y."""
    return Discrete(world, H, METHOD).step(x, u + side_force(world, x[: world.nq], force))


def _lost(params: TrackingParams, t: float, after: list[np.ndarray], x_ref: np.ndarray) -> str:
    """A sentence once robot or ghost are too far off for any linearisation; else empty."""
    nq = len(x_ref) // 2
    for name, x in zip(("robot", "ghost"), after, strict=True):
        off = np.abs(x - x_ref)[:nq]
        if not (np.isfinite(x).all() and off.max() <= FARTHEST):
            joint = int(np.argmax(off)) + 1
            return (
                f"Lost at t = {t:.2f} s: joint {joint} of the {name} is more than "
                f"{FARTHEST:.2f} rad or m off its reference, where the linearisation says nothing. "
                "Make the reference slower or smaller, the forces weaker, or the weight of the "
                "effort lower, and reset."
            )
    return ""


def _unrolled(points: np.ndarray, direction: float = 1.0) -> np.ndarray:
    """Where a cart will be, on a screen behind the rail: the future above it and coming down; the
    past, newest first and with direction -1, below."""
    z = HEIGHT + direction * RISE * H * np.arange(len(points))
    return np.column_stack([np.full(len(points), BEHIND), points[:, 1], z])


def _handle(params: TrackingParams, along: Lap) -> np.ndarray:
    """Where the ball is that sets the size: on the lap's first point, or on the rail."""
    if params.robot == "cart-pole":
        return np.array([-0.1, params.stroke, HEIGHT])
    start: np.ndarray = along.points[0]
    return start


def _within(params: TrackingParams, name: str, value: float) -> float:
    """The value a slider takes nearest to this one."""
    tunable = params.tunables[name]
    assert isinstance(tunable, Knob)
    return float(round(min(max(value, tunable.low), tunable.high), 3))
