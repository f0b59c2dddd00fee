"""Laps: periodic references for a mechanism, and the linear system seen along them (notes, 2.4.3
to 2.4.5).

A lap has M samples, h [s] apart; what follows the last is the first. The UR5's end-effector goes
round a circle or a square in a plane, its orientation kept: q_ref by inverse kinematics (Newton's
method), and its derivatives from the Jacobian,

    J q' = (p', 0),    J q'' = (p'', 0) - J' q'.

The cart-pole keeps its pole upright while the cart's p_ref is the circle's shadow, A sin(2 pi phi),
or jumps between A and -A, which nothing can follow. Of inverse dynamics u_ref takes the rows of
the driven joints, all of them, those of gravity or none. With x+ = f(x, u) the dynamics of the
deviations dx = x - x_ref, du = u - u_ref are to first order

    dx+ = A_t dx + B_t du + c_t,    c_t = f(x_ref_t, u_ref_t) - x_ref_(t+1);

the defect c_t says by how much the reference is no motion of the mechanism under u_ref. A known
horizontal force on the end-effector or the cart is part of f.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from labs.algorithms.inverse_kinematics import pose_error
from labs.errors import LabError
from labs.models.cart_pole import HINGE_HEIGHT
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import Mechanism, mechanism

CONTROL_PERIOD = 0.02
"""h [s] between two samples."""
INTEGRATION_METHOD = "rk4"
"""Integrates the mechanism over one control period."""
POSE_TOLERANCE, MAX_NEWTON_STEPS = 1e-10, 30
"""Newton's method ends where the pose is off by less, in m and rad; steps it may take."""

PlanePath = tuple[np.ndarray, np.ndarray, np.ndarray]
"""s, ds/dphi and d2s/dphi2 of a path in a plane, each (M, 2), at phases phi (M,) [cycles]."""

PLANES: Mapping[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "frontal": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "horizontal": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
"""The two directions of a path's plane."""
FEED_FORWARDS: Mapping[str, str] = {
    "inverse-dynamics": "Inverse dynamics",
    "gravity": "Gravity only",
    "none": "None",
}


def circle(phase: np.ndarray) -> PlanePath:
    """(cos, sin)(2 pi phi)."""
    turn = 2.0 * np.pi
    s = np.stack([np.cos(turn * phase), np.sin(turn * phase)], axis=1)
    return s, turn * np.stack([-s[:, 1], s[:, 0]], axis=1), -(turn**2) * s


def square(phase: np.ndarray) -> PlanePath:
    """The square inscribed in the unit circle, from the middle of its right side up and round, at
    constant speed; at a corner the side that begins there counts."""
    half = np.sqrt(0.5)
    along = (4.0 * phase + 0.5) % 4.0
    side = along.astype(int) % 4
    normal = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])[side]
    ahead = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    done = (along - side)[:, None]
    return half * (normal + (2.0 * done - 1.0) * ahead), 8.0 * half * ahead, np.zeros_like(ahead)


PATHS: Mapping[str, Callable[[np.ndarray], PlanePath]] = {"circle": circle, "square": square}


@dataclass(frozen=True)
class ReferencePath:
    """Where a mechanism is sent: one lap of `samples` control periods."""

    robot: str
    """"ur5" or "cart-pole"."""
    path: str
    """One of PATHS."""
    size: float
    """[m] radius of the circle, of that round the square, or how far the cart goes."""
    samples: int
    plane: str = "frontal"
    """One of PLANES, for the UR5."""


@dataclass(frozen=True, eq=False)
class Lap:
    """A reference of M samples and the linear system along it."""

    x_ref: np.ndarray
    """(M, nx)."""
    u_ref: np.ndarray
    """(M, nu)."""
    a: np.ndarray
    """A (M, nx, nx)."""
    b: np.ndarray
    """B (M, nx, nu)."""
    c: np.ndarray
    """c (M, nx): the defect."""
    points: np.ndarray
    """(M, 3) [m] where the end-effector, or the cart's hinge, should be."""


@lru_cache(maxsize=32)
def lap(course: ReferencePath, feed_forward: str = "inverse-dynamics", force: float = 0.0) -> Lap:
    """The lap of a course with one of FEED_FORWARDS, under a `force` [N] along the world's y axis
    that is known. Raises LabError where the arm does not reach, or a name is none."""
    for name, names in ((course.path, PATHS), (feed_forward, FEED_FORWARDS)):
        if name not in names:
            raise LabError(f"there is no {name!r}; there are {', '.join(names)}")
    robot = mechanism(course.robot)
    q, v, a = _joint_motion(course)
    u_ref = np.stack(
        [_feed_forward(robot, feed_forward, *row) for row in zip(q, v, a, strict=True)]
    )
    x_ref = np.hstack([q, v])
    pushed = u_ref + np.stack([side_force(robot, row, force) for row in q])
    after, A, B = DiscreteMechanism(robot, CONTROL_PERIOD, INTEGRATION_METHOD).linearize(
        x_ref, pushed
    )
    points = np.stack([tracked_point(robot, row) for row in q])
    return Lap(x_ref, u_ref, A, B, after - np.roll(x_ref, -1, axis=0), points)


def side_force(robot: Mechanism, q: np.ndarray, force: float) -> np.ndarray:
    """What motors (nu,) would do that push as a force [N] along the world's y axis does, on the
    cart or else on the end-effector."""
    if force == 0.0:
        return np.zeros(robot.nu)
    if robot.name == "cart-pole":
        return np.array([force])
    return force * robot.tip_jacobian(q)[1, list(robot.actuated_joints)]


def tracked_point(robot: Mechanism, q: np.ndarray) -> np.ndarray:
    """Position (3,) [m] of what is to follow the path: the end-effector, or the cart's hinge."""
    return np.array([0.0, q[0], HINGE_HEIGHT]) if robot.name == "cart-pole" else robot.tip(q)


def _feed_forward(
    robot: Mechanism, name: str, q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> np.ndarray:
    model, data, driven = robot.model, robot.data, list(robot.actuated_joints)
    if name == "none":
        return np.zeros(robot.nu)
    if name == "gravity":
        return np.asarray(pin.computeGeneralizedGravity(model, data, q)[driven])
    return np.asarray(pin.rnea(model, data, q, v, a)[driven])


@lru_cache(maxsize=32)
def _joint_motion(course: ReferencePath) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, q' and q'' (M, nq) along the course."""
    flat = PATHS[course.path](np.arange(course.samples) / course.samples)
    rate = 1.0 / (course.samples * CONTROL_PERIOD)
    s, ds, dds = (course.size * rate**k * part for k, part in enumerate(flat))
    if course.robot == "cart-pole":
        return _cart_pole_motion(course, s, ds, dds)
    return _inverse_kinematics(
        course, *(part @ np.array(PLANES[course.plane]) for part in (s, ds, dds))
    )


def _cart_pole_motion(
    course: ReferencePath, s: np.ndarray, ds: np.ndarray, dds: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q, v, a = np.zeros((3, course.samples, 2))
    q[:, 1] = np.pi
    if course.path == "circle":
        q[:, 0], v[:, 0], a[:, 0] = s[:, 1], ds[:, 1], dds[:, 1]
    else:
        q[:, 0] = np.where(2 * np.arange(course.samples) < course.samples, 1.0, -1.0) * course.size
    return q, v, a


def _inverse_kinematics(
    course: ReferencePath, p: np.ndarray, dp: np.ndarray, ddp: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inverse kinematics from one sample to the next; p is seen from where the arm's end-effector
    is at home."""
    robot = mechanism(course.robot)
    model, data, tip = robot.model, robot.data, robot.arm.tip
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    q = robot.arm.home.copy()
    pin.framesForwardKinematics(model, data, q)
    home = data.oMf[tip].copy()
    Q, V, A = np.empty((3, course.samples, robot.nq))
    for i in range(course.samples):
        target = pin.SE3(home.rotation, home.translation + p[i])
        for _ in range(MAX_NEWTON_STEPS):
            jacobian = pin.computeFrameJacobian(model, data, q, tip, axes)
            error = pose_error(data.oMf[tip], target)
            if np.abs(error).max() < POSE_TOLERANCE:
                break
            q = q + np.linalg.solve(jacobian, error)
        else:
            raise LabError(
                f"the arm does not reach {np.round(target.translation, 2)} m: make the path smaller"
            )
        v = np.linalg.solve(jacobian, np.concatenate([dp[i], np.zeros(3)]))
        pin.forwardKinematics(model, data, q, v, np.zeros(robot.nq))
        drift = pin.getFrameClassicalAcceleration(model, data, tip, axes).vector
        a = np.linalg.solve(jacobian, np.concatenate([ddp[i], np.zeros(3)]) - drift)
        Q[i], V[i], A[i] = q, v, a
        q = q + CONTROL_PERIOD * v + 0.5 * CONTROL_PERIOD**2 * a
    return Q, V, A
