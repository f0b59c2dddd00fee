"""The tunables of differential kinematics: posture, velocities, what is shown, and a task."""

from functools import lru_cache
from typing import Any

import numpy as np

from labs.algorithms.inverse_kinematics import INVERSE_KINEMATICS_METHODS
from labs.algorithms.jacobian import ForwardKinematics
from labs.models.arms import JOINT_COUNTS, Arm, load_arm
from labs.params import Group, Params
from labs.tasks.arm.params import joint_values, robot_choice, where_joint_exists

ROBOTS = ("ur5", "panda", "scara")
FRAMES = {
    "end-effector": "End-effector",
    **{f"joint-{i}": f"Frame of joint {i}" for i in range(2, 8)},
}
MODES = {
    "posture": "Pose by sliders",
    "velocity": "Joint velocities",
    "follow": "Follow a target",
}
FOLLOWING = {"mode": "follow"}
TASKS = {"position": "Position", "pose": "Full pose"}
ELLIPSOIDS = {"velocity": "Velocity", "force": "Force", "both": "Both", "none": "None"}
COLUMNS = {"all": "All", "none": "None"} | {str(i): f"Joint {i}, lever" for i in range(1, 8)}

POSTURE = Group("Posture")
VELOCITIES = Group("Joint velocities")
ROBOT = Group("Robot", effect="restart")
SHOW = Group("Show")
INVERSE_KINEMATICS = Group("Inverse kinematics")


def _angle(i: int) -> Any:
    slides = ["scara"] if i == 3 else []
    turns = [name for name in ROBOTS if JOINT_COUNTS[name] >= i and name not in slides]
    return POSTURE.knob(
        0.0,
        -3.14,
        3.14,
        f"\\Delta q_{i}",
        "rad",
        f"Joint {i}",
        step=0.01,
        key=True,
        when={"robot": turns},
        help="Angle from the home posture, cut at the joint's limits.",
    )


def _rate(i: int, value: float = 0.0) -> Any:
    return VELOCITIES.knob(
        value,
        -2.0,
        2.0,
        f"\\dot q_{i}",
        "rad/s",
        f"Speed {i}",
        step=0.01,
        when={**where_joint_exists(i, ROBOTS), "mode": ["posture", "velocity"]},
        units={"robot": {"scara": "m/s"}} if i == 3 else {},
        help="Velocity of the joint, turning or sliding.",
    )


class DifferentialParams(Params):
    """What the user can turn."""

    robot: str = robot_choice(ROBOT, ROBOTS, key=True)
    """The arm."""
    frame: str = ROBOT.choice("end-effector", FRAMES, "Frame")
    """Whose velocity the Jacobian gives; the last one where the robot has no such joint."""
    mode: str = ROBOT.choice("posture", MODES, "Motion", effect="live", key=True)
    """Stand as posed, move at the joint velocities below, or follow the target."""
    q1: float = _angle(1)
    q2: float = _angle(2)
    q3: float = _angle(3)
    q4: float = _angle(4)
    q5: float = _angle(5)
    q6: float = _angle(6)
    q7: float = _angle(7)
    lift: float = POSTURE.knob(
        0.0, -0.15, 0.15, "d", "m", "Slide", step=0.001, key=True, when={"robot": "scara"}
    )
    """The sliding joint of the SCARA."""
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
    method: str = INVERSE_KINEMATICS.choice(
        "damped", INVERSE_KINEMATICS_METHODS, "Method", key=True, when=FOLLOWING
    )
    """How the wanted velocity of the end-effector becomes joint velocities."""
    damping: float = INVERSE_KINEMATICS.knob(
        0.1, 0.001, 1.0, "\\lambda", "m", "Damping", scale="log", key=True, when=FOLLOWING
    )
    """Of damped least squares: below this a singular value counts as small."""
    gain: float = INVERSE_KINEMATICS.knob(
        5.0, 0.0, 50.0, "k", "1/s", "Gain", scale="log", when=FOLLOWING
    )
    """Velocity asked per error. The error's part is cut at 0.5 m/s and 1 rad/s."""
    fastest: float = INVERSE_KINEMATICS.knob(
        3.14, 0.5, 50.0, "\\dot q_{max}", "rad/s", "Speed limit", scale="log", when=FOLLOWING
    )
    """What a motor gives (m/s where it slides). All joints slow down by one factor."""
    reach: float = INVERSE_KINEMATICS.knob(
        0.0, 0.0, 0.8, "A", "m", "Reach out", step=0.01, when=FOLLOWING
    )
    """The target moves this far away from the base axis and back, in 8 s."""

    @property
    def arm(self) -> Arm:
        return load_arm(self.robot)

    @property
    def kinematics(self) -> ForwardKinematics:
        """Up to the frame chosen."""
        return _forward_kinematics(self.robot, self.frame)

    @property
    def posture(self) -> np.ndarray:
        """(n,) what the sliders say, within the joints' limits."""
        arm = self.arm
        offsets = joint_values(self, "q", arm.model.nv)
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
        return joint_values(self, "dq", self.arm.model.nv)

    @property
    def rows(self) -> int:
        """Of the Jacobian, that the task has."""
        return 3 if self.task == "position" else 6


@lru_cache(maxsize=32)
def _forward_kinematics(robot: str, frame: str) -> ForwardKinematics:
    arm = load_arm(robot)
    if frame == "end-effector":
        return ForwardKinematics(arm.model, arm.tip)
    joint = min(int(frame.removeprefix("joint-")), arm.model.njoints - 1)
    return ForwardKinematics(arm.model, arm.model.getFrameId(arm.model.names[joint]))
