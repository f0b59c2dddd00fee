"""Differential kinematics (notes, 1.1.3): from joint velocities to the end-effector's, and back."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from labs.algorithms.inverse_kinematics import (
    METHODS,
    joint_rates,
    manipulability,
    pose_error,
    shortened,
    slowed,
)
from labs.algorithms.jacobian import Chain, Kinematics, analytical, geometric, geometric_rate
from labs.lab import Handle, Inputs, Lab, Measurement, State
from labs.models.arms import Arm, load
from labs.params import Group, Params, Value
from labs.plots import Bars, Line, Matrix, Readout, TimeSeries
from labs.scene import Scene

NEAR = 0.05
"""A smallest singular value below this is called near a singularity."""
FASTEST, FASTEST_TURN = 0.5, 1.0
"""[m/s], [rad/s] what the feedback of the error may ask of the end-effector."""
LAP = 8.0
"""[s] the target's way out and back."""
WORST_CONDITION = 1e6
"""Shown for any condition number beyond it."""
AXIS, COLUMN, TWIST = 0.3, 0.4, 0.8
"""[m] length of an axis; of a column of J_p per m/rad; of the velocity per m/s."""
VELOCITY_BALL, FORCE_BALL, LONGEST = 0.25, 0.06, 0.4
"""[m] per unit singular value of J_p, and of its inverse; longest half-axis drawn."""

CAMERA = ((0.92, 1.0, 0.87), (0.36, 0.08, 0.4))
"""Where a viewer stands and what it looks at [m]: reaching arms stay in view."""
UP = np.array([0.0, 0.0, 1.0])

ROBOTS = {"ur5": "UR5", "panda": "Franka Panda", "scara": "SCARA"}
FRAMES = {
    "end-effector": "End-effector",
    **{f"joint-{i}": f"Frame of joint {i}" for i in range(2, 8)},
}
MODES = {
    "posture": "Pose by sliders",
    "velocity": "Joint velocities",
    "follow": "Follow a target",
}
TASKS = {"position": "Position", "pose": "Full pose"}
ELLIPSOIDS = {"velocity": "Velocity", "force": "Force", "both": "Both", "none": "None"}
COLUMNS = {"all": "All", "none": "None"} | {str(i): f"Joint {i}, lever" for i in range(1, 8)}


POSTURE = Group("Posture")
JOINT_VELOCITIES = Group("Joint velocities")
ROBOT = Group("Robot", effect="restart")
SHOW = Group("Show")
INVERSE_KINEMATICS = Group("Inverse kinematics")


def _angle(i: int) -> Any:
    return POSTURE.knob(
        0.0,
        -3.14,
        3.14,
        f"q_{i} - q_{i}^{{home}}",
        "rad",
        f"Joint {i}",
        step=0.01,
        help="Angle from the home posture, cut at the joint's limits. Ignored where the robot "
        "has no such joint, and by the sliding joint of the SCARA, which has a slider of its own.",
    )


def _rate(i: int, value: float = 0.0) -> Any:
    return JOINT_VELOCITIES.knob(
        value,
        -2.0,
        2.0,
        f"\\dot q_{i}",
        "rad/s",
        f"Speed {i}",
        step=0.01,
        help="Velocity of the joint; m/s where it slides. Ignored where the robot has no such "
        "joint, and while a target is followed.",
    )


class DifferentialParams(Params):
    """What the user can turn."""

    robot: str = ROBOT.choice("ur5", ROBOTS, "Robot")
    """The arm."""
    frame: str = ROBOT.choice("end-effector", FRAMES, "Frame")
    """Whose velocity the Jacobian gives; the last one where the robot has no such joint."""
    mode: str = ROBOT.choice("posture", MODES, "Motion", effect="live")
    """Stand as posed, move at the joint velocities below, or follow the target."""
    q1: float = _angle(1)
    q2: float = _angle(2)
    q3: float = _angle(3)
    q4: float = _angle(4)
    q5: float = _angle(5)
    q6: float = _angle(6)
    q7: float = _angle(7)
    lift: float = POSTURE.knob(0.0, -0.15, 0.15, "d", "m", "Slide", step=0.001)
    """The sliding joint of the SCARA; ignored by the other robots."""
    dq1: float = _rate(1, 0.5)
    dq2: float = _rate(2)
    dq3: float = _rate(3)
    dq4: float = _rate(4)
    dq5: float = _rate(5)
    dq6: float = _rate(6)
    dq7: float = _rate(7)
    columns: str = SHOW.choice("all", COLUMNS, "Columns")
    """The Jacobian's columns as arrows: axes z in grey, columns of its linear rows in blue."""
    ellipsoid: str = SHOW.choice("velocity", ELLIPSOIDS, "Ellipsoid")
    """All velocities for joint velocities of length 1, or all forces for joint torques of length
    1."""
    task: str = INVERSE_KINEMATICS.choice("position", TASKS, "Task", effect="restart")
    """What must follow the target, the position alone or the orientation too; singular values are
    those of its rows of J."""
    method: str = INVERSE_KINEMATICS.choice("damped", METHODS, "Method")
    """How the wanted velocity of the end-effector becomes joint velocities."""
    damping: float = INVERSE_KINEMATICS.knob(
        0.1, 0.001, 1.0, "\\lambda", "m", "Damping", scale="log"
    )
    """Of damped least squares: below this a singular value counts as small."""
    gain: float = INVERSE_KINEMATICS.knob(5.0, 0.0, 50.0, "k", "1/s", "Gain", scale="log")
    """Velocity asked per error. The error's part is cut at 0.5 m/s and 1 rad/s."""
    fastest: float = INVERSE_KINEMATICS.knob(
        3.14, 0.5, 50.0, "\\dot q_{max}", "rad/s", "Speed limit", scale="log"
    )
    """What a motor gives (m/s where it slides). All joints slow down by one factor."""
    reach: float = INVERSE_KINEMATICS.knob(0.0, 0.0, 0.8, "A", "m", "Reach out", step=0.01)
    """The target moves this far away from the base axis and back, in 8 s."""

    @property
    def arm(self) -> Arm:
        return load(self.robot)

    @property
    def posture(self) -> np.ndarray:
        """(n,) what the sliders say, within the joints' limits."""
        arm = self.arm
        offsets = np.array([getattr(self, f"q{i + 1}") for i in range(arm.model.nv)])
        if self.robot == "scara":
            offsets[2] = self.lift
        model = arm.model
        clipped: np.ndarray = np.clip(
            arm.home + offsets, model.lowerPositionLimit, model.upperPositionLimit
        )
        return clipped

    @property
    def rates(self) -> np.ndarray:
        """(n,) the joint velocities on the sliders."""
        return np.array([getattr(self, f"dq{i + 1}") for i in range(self.arm.model.nv)])

    @property
    def rows(self) -> int:
        """Of the Jacobian, that the task has."""
        return 3 if self.task == "position" else 6


@dataclass(kw_only=True)
class DifferentialState(State):
    """The arm and its target. Arrays are never written after they are made."""

    q: np.ndarray
    posture: np.ndarray
    """(n,) what the sliders last said: when they say something else, the arm goes there."""
    asked: np.ndarray
    """(n,) [rad/s] what inverse kinematics asked for."""
    given: np.ndarray
    """(n,) [rad/s] what of it the motors and end stops let through."""
    wanted: float = 0.0
    """|v| of the task velocity [m/s, with rad/s]."""
    anchor: np.ndarray
    """(3,) [m] where the target was put last."""
    facing: np.ndarray
    """(3, 3) the target's orientation."""
    clock: float = 0.0
    """Time since the target was put there [s]."""
    peak: float = 0.0
    """Largest |q'| asked so far [rad/s]."""


class DifferentialKinematics(Lab[DifferentialParams, DifferentialState]):
    """An arm, its Jacobians, and a target it follows."""

    title = "Differential kinematics"
    section = "1.1.3"
    summary = (
        "See how every joint moves the end-effector: geometric and analytical Jacobian, "
        "manipulability, and inverse kinematics near a singularity."
    )
    Params = DifferentialParams
    period = 0.01
    plots = (
        Matrix("Geometric Jacobian", "geometric", "J", shade=True),
        Matrix("Analytical Jacobian", "analytical", "J_A", shade=True),
        Matrix("Their difference", "difference", "J_A - J", shade=True),
        Matrix("Twist beside rate of the pose", "twist", r"(J\dot q,\; J_A\dot q)", shade=True),
        Bars("Singular values", "sigma", r"\sigma_k", ""),
        TimeSeries(
            "Distance to singularity",
            "",
            Line("sigma_min", r"\sigma_{min}"),
            Line("near", r"\text{warning}", "limit"),
        ),
        TimeSeries(
            "Joint speed",
            "rad/s",
            Line("speed", r"\lVert\dot q\rVert"),
            Line("speed_given", r"\lVert\dot q\rVert_{given}", "dash"),
            Line("bound", r"\lVert v\rVert/(2\lambda)", "limit"),
        ),
        TimeSeries("Joint velocities", "rad/s", Line("rates", r"\dot q"), select="joint"),
        TimeSeries("Task error", "m", Line("error", r"\lVert p^* - p_e\rVert")),
        TimeSeries(
            "Speed of orientation",
            "rad/s",
            Line("omega", r"\lVert\omega\rVert"),
            Line("rpy", r"\lVert\dot\phi_o\rVert", "dash"),
        ),
        Readout("sigma_min", "Distance to singularity (warning below 0.05)", ""),
        Readout("manipulability", "Manipulability", ""),
        Readout("condition", "Condition number", ""),
        Readout("peak", "Fastest joint speed asked", "rad/s"),
        Readout("bias", "Acceleration at constant joint velocities", "m/s²"),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Follow the ball": {"mode": "follow", "columns": "none"},
        "Panda, seven joints": {"robot": "panda", "dq1": 0.0, "dq3": 0.5},
        "SCARA": {"robot": "scara", "dq3": 0.2},
        "Stretched arm": {"q2": 0.7, "q3": -1.55},
        "Wrist of the UR5 aligned": {"task": "pose", "q5": 1.57},
    }
    handles = (Handle("target", "The end-effector's target."),)

    def init(self, params: DifferentialParams, rng: np.random.Generator) -> DifferentialState:
        """As posed, the target at the frame."""
        q = params.posture
        here = _kinematics(params.robot, params.frame).at(q).placement
        still = np.zeros_like(q)
        return DifferentialState(
            q=q,
            posture=q,
            asked=still,
            given=still,
            anchor=here.translation.copy(),
            facing=here.rotation.copy(),
        )

    def step(
        self, params: DifferentialParams, inputs: Inputs, state: DifferentialState
    ) -> DifferentialState:
        """10 ms of resolved-rate inverse kinematics, or of the velocities on the sliders."""
        posture = params.posture
        q = _posture(params, state)
        chain = _kinematics(params.robot, params.frame).at(q)
        anchor, facing, clock = state.anchor, state.facing, state.clock
        held = inputs.handles.get("target")
        if params.mode != "follow" or q is not state.q:
            anchor, facing, clock = chain.placement.translation, chain.placement.rotation, 0.0
        elif held is not None:
            anchor, clock = np.array(held), 0.0

        v, asked = np.zeros(params.rows), np.zeros_like(q)
        if params.mode == "follow":
            v = _task_velocity(params, chain, anchor, facing, clock)[: params.rows]
            jacobian = geometric(chain)[: params.rows]
            asked = joint_rates(params.method, jacobian, v, params.damping)
        elif params.mode == "velocity":
            asked = params.rates
        given = slowed(asked, params.fastest) if params.mode == "follow" else asked
        given = _within_stops(params.arm, q, given)
        model = params.arm.model
        speed = float(np.linalg.norm(asked))
        return DifferentialState(
            t=state.t + self.period,
            q=np.clip(q + self.period * given, model.lowerPositionLimit, model.upperPositionLimit),
            posture=posture,
            asked=asked,
            given=given,
            wanted=float(np.linalg.norm(v)),
            anchor=anchor.copy(),
            facing=facing.copy(),
            clock=clock + self.period if params.mode == "follow" and held is None else 0.0,
            peak=max(state.peak, speed) if params.mode == "follow" else 0.0,
        )

    def measure(self, params: DifferentialParams, state: DifferentialState) -> Measurement:
        """Velocities are those on the sliders unless a target is followed. Singular values mix
        rows in m and in rad: they weigh 1 m as 1 rad."""
        chain = _kinematics(params.robot, params.frame).at(_posture(params, state))
        jacobian = geometric(chain)
        sigma, product = _singular_values(params, chain, jacobian)
        rates = _rates(params, state)
        follows = params.mode == "follow"
        asked = state.asked if follows else rates
        target, _ = _target(params, state.anchor, state.clock)
        bias = geometric_rate(chain, rates)[:3] @ rates
        return {
            "q": _posture(params, state),
            "rates": asked,
            "speed": float(np.linalg.norm(asked)),
            "speed_given": float(np.linalg.norm(rates)),
            "bound": state.wanted / (2.0 * params.damping),
            "error": float(np.linalg.norm(target - chain.placement.translation))
            if follows
            else 0.0,
            "omega": float(np.linalg.norm(jacobian[3:] @ rates)),
            "rpy": float(np.linalg.norm(analytical(chain, jacobian)[3:] @ rates)),
            "sigma_min": float(sigma[-1]),
            "near": NEAR,
            "manipulability": product,
            "condition": min(float(sigma[0]) / max(float(sigma[-1]), 1e-12), WORST_CONDITION),
            "peak": state.peak,
            "bias": float(np.linalg.norm(bias)),
        }

    def fields(
        self, params: DifferentialParams, state: DifferentialState
    ) -> Mapping[str, np.ndarray]:
        """The Jacobians, (6, n); the twist and the rate of the pose, (6, 2)."""
        chain = _kinematics(params.robot, params.frame).at(_posture(params, state))
        jacobian = geometric(chain)
        other, rates = analytical(chain, jacobian), _rates(params, state)
        return {
            "geometric": jacobian,
            "analytical": other,
            "difference": other - jacobian,
            "twist": np.stack([jacobian @ rates, other @ rates], axis=1),
            "sigma": _singular_values(params, chain, jacobian)[0],
        }

    def draw(self, scene: Scene, params: DifferentialParams, state: DifferentialState) -> None:
        """The arm, the Jacobian's columns, the twist, ellipsoids, the target and a warning."""
        q = _posture(params, state)
        chain = _kinematics(params.robot, params.frame).at(q)
        jacobian = geometric(chain)
        tip = chain.placement.translation
        scene.camera(*CAMERA)
        scene.arm("robot", params.arm, q)
        scene.frame("frame", chain.placement, 0.12)
        _draw_columns(scene, params.columns, chain, jacobian)
        _draw_twist(scene, tip, jacobian @ _rates(params, state))
        _draw_ellipsoids(scene, params.ellipsoid, tip, jacobian[:3])
        if params.mode == "follow":
            target, _ = _target(params, state.anchor, state.clock)
            scene.handle("target", target)
            if params.reach > 0.0:
                end, _ = _target(params, state.anchor, LAP / 2)
                scene.trail("path", np.array([state.anchor, end]), "reference")
        sigma, _ = _singular_values(params, chain, jacobian)
        if sigma[-1] < NEAR:
            scene.sphere("singular", tip, 0.03, "warning")
            scene.label("warning", f"Singularity near: σ = {sigma[-1]:.3f}", tip + 0.2 * UP)


@lru_cache(maxsize=32)
def _kinematics(robot: str, frame: str) -> Kinematics:
    arm = load(robot)
    if frame == "end-effector":
        return Kinematics(arm.model, arm.tip)
    joint = min(int(frame.removeprefix("joint-")), arm.model.njoints - 1)
    return Kinematics(arm.model, arm.model.getFrameId(arm.model.names[joint]))


def _posture(params: DifferentialParams, state: DifferentialState) -> np.ndarray:
    """Where the arm is: where a slider moved it if one has moved since the last step."""
    posture = params.posture
    return state.q if np.array_equal(posture, state.posture) else posture


def _rates(params: DifferentialParams, state: DifferentialState) -> np.ndarray:
    """(n,) [rad/s; m/s] the joint velocities the twist belongs to."""
    match params.mode:
        case "follow":
            return state.given
        case "velocity":
            return _within_stops(params.arm, _posture(params, state), params.rates)
        case _:
            return params.rates


def _within_stops(arm: Arm, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """`rates` (n,) but zero where a joint stands at its end stop and would go on."""
    model = arm.model
    stuck = (q >= model.upperPositionLimit) & (rates > 0.0)
    stuck |= (q <= model.lowerPositionLimit) & (rates < 0.0)
    return np.where(stuck, 0.0, rates)


def _target(
    params: DifferentialParams, anchor: np.ndarray, clock: float
) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and velocity [m/s] of the target, each (3,):
    p* = anchor + A (1 - cos(2 pi t / LAP)) / 2 d, with d pointing away from the base axis."""
    outward = np.array([anchor[0], anchor[1], 0.0])
    length = float(np.linalg.norm(outward))
    direction = outward / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
    phase = 2 * np.pi * clock / LAP
    way = params.reach * (1.0 - np.cos(phase)) / 2.0
    speed = params.reach * np.pi / LAP * np.sin(phase)
    return anchor + way * direction, speed * direction


def _task_velocity(
    params: DifferentialParams, chain: Chain, anchor: np.ndarray, facing: np.ndarray, clock: float
) -> np.ndarray:
    """v (6,) = (p*' + k e_p, k e_o), what the error adds cut at FASTEST and FASTEST_TURN."""
    target, velocity = _target(params, anchor, clock)
    error = params.gain * pose_error(chain.placement, pin.SE3(facing, target))
    linear = velocity + shortened(error[:3], FASTEST)
    return np.concatenate([linear, shortened(error[3:], FASTEST_TURN)])


def _singular_values(
    params: DifferentialParams, chain: Chain, jacobian: np.ndarray
) -> tuple[np.ndarray, float]:
    """Of the task's rows, for the joints that carry the frame; and their product."""
    return manipulability(jacobian[: params.rows, chain.carries])


def _draw_columns(scene: Scene, columns: str, chain: Chain, jacobian: np.ndarray) -> None:
    """Axes z_i and columns J_pi: all at their joints, or one with the lever p_e - p_i."""
    tip = chain.placement.translation
    for i, (z, p, column) in enumerate(zip(chain.axes, chain.points, jacobian[:3].T, strict=True)):
        alone = columns == str(i + 1)
        if not (alone or columns == "all") or not chain.carries[i]:
            continue
        scene.arrow(f"axis {i + 1}", p - AXIS / 2 * z, p + AXIS / 2 * z, "muted")
        if alone:
            scene.trail("lever", np.array([p, tip]), "actual")
        start = tip if alone else p
        if np.linalg.norm(column) > 0.02:
            scene.arrow(f"column {i + 1}", start, start + COLUMN * column, "actual")


def _draw_twist(scene: Scene, tip: np.ndarray, twist: np.ndarray) -> None:
    """The velocity of the frame as an arrow, its angular velocity as an arc around it."""
    linear, angular = shortened(TWIST * twist[:3], LONGEST), twist[3:]
    if np.linalg.norm(linear) > 0.01:
        scene.arrow("velocity", tip, tip + linear, "reference")
    omega = float(np.linalg.norm(angular))
    if omega > 0.02:
        scene.arc("angular velocity", tip, angular, min(2.0 * omega, 5.5), 0.15, "reference")


def _draw_ellipsoids(scene: Scene, which: str, tip: np.ndarray, linear: np.ndarray) -> None:
    """J_p maps the unit ball of joint velocities to half-axes sigma_k u_k; J_p^T f of length 1
    takes forces on half-axes u_k / sigma_k."""
    u, sigma, _ = np.linalg.svd(linear, full_matrices=False)
    if which in ("velocity", "both"):
        scene.ellipsoid("velocities", tip, u * (VELOCITY_BALL * sigma), "actual")
    if which in ("force", "both"):
        lengths = np.minimum(FORCE_BALL / np.maximum(sigma, 1e-9), LONGEST)
        scene.ellipsoid("forces", tip, u * lengths, "force")
