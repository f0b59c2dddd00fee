"""The arms: UR5, Panda, a double pendulum and a SCARA, as Pinocchio models with what draws them.

The equation of motion of each is M(q) q'' + h(q, q') = tau (notes, 1.2), SI units, world frame
with z up, the floor at z = 0. The URDFs leave out what a gear adds to the inertia felt at a
joint, gear^2 J_rotor; in geared arms it dominates, so `model.armature` carries it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from labs.errors import LabError
from labs.shapes import (
    BLUE,
    DARK_GRAY,
    LIGHT_GRAY,
    ORANGE,
    STEEL_COLORS,
    Box,
    Cylinder,
    Shape,
    Sphere,
    Vector3,
    Visual,
    primitive,
    translation,
)


@dataclass(frozen=True, eq=False)
class Arm:
    """A robot arm: how it moves, how strong it is and what it looks like."""

    name: str
    title: str
    model: pin.Model
    home: np.ndarray
    """(nq,) [rad; m where a joint slides]: a bent posture, away from singularities and from the
    floor."""
    torque_limit: np.ndarray
    """(nv,) [N m; N where a joint slides]: what each motor can give, in either direction."""
    tip: int
    """The end-effector, as the index of a frame of the model."""
    visuals: tuple[Visual, ...]
    """What to draw when there is time to: detailed meshes with their materials."""
    collisions: tuple[Visual, ...]
    """Light-weight shapes, for ghosts and for machines that draw slowly."""
    camera: tuple[Vector3, Vector3]
    """Where a viewer stands and what it looks at [m]."""


ARM_TITLES = {
    "ur5": "UR5",
    "panda": "Franka Panda",
    "double-pendulum": "Double pendulum",
    "scara": "SCARA",
}
JOINT_COUNTS = {"ur5": 6, "panda": 7, "double-pendulum": 2, "scara": 4}
"""Known before an arm is loaded, which takes its meshes with it; so are the titles."""


@cache
def ur5() -> Arm:
    """UR5, 6 joints. Reflected rotor inertia: gear 101 with J = 2.5e-5 kg m^2 gives
    0.255 kg m^2 at the three large joints; the wrists' smaller motors give 0.061 kg m^2."""
    model, collision, visual = _load_urdf("ur_description/urdf/ur5_robot.urdf")
    model.armature = np.array([0.255, 0.255, 0.255, 0.061, 0.061, 0.061])
    return Arm(
        name="ur5",
        title=ARM_TITLES["ur5"],
        model=model,
        home=np.array([0.0, -1.5, 1.6, -1.67, -1.57, 0.0]),
        torque_limit=model.effortLimit.copy(),
        tip=model.getFrameId("tool0"),
        visuals=_visuals(visual),
        collisions=_color_as_steel(_visuals(collision)),
        camera=((1.05, -0.85, 0.75), (0.22, 0.05, 0.36)),
    )


@cache
def panda() -> Arm:
    """Franka Panda, 7 joints, its fingers locked closed. Reflected rotor inertia 0.1 kg m^2 at
    every joint, the order of what identifications of this arm find."""
    full, collision, visual = _load_urdf("panda_description/urdf/panda.urdf")
    fingers = [full.getJointId(f"panda_finger_joint{i}") for i in (1, 2)]
    model, (collision, visual) = pin.buildReducedModel(
        full, [collision, visual], fingers, pin.neutral(full)
    )
    model.armature = np.full(model.nv, 0.1)
    return Arm(
        name="panda",
        title=ARM_TITLES["panda"],
        model=model,
        home=np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]),
        torque_limit=model.effortLimit.copy(),
        tip=model.getFrameId("panda_hand_tcp"),
        visuals=_visuals(visual),
        collisions=_color_as_steel(_visuals(collision)),
        camera=((1.1, -0.95, 0.85), (0.14, 0.03, 0.42)),
    )


@cache
def double_pendulum() -> Arm:
    """Two uniform rods (0.5 m, 2 kg, radius 0.03 m) on horizontal hinges, driven directly (no
    reflected inertia). At q = 0 it hangs straight down; a positive angle swings a rod towards
    +y, and the second angle is relative to the first rod. It moves in the plane x = 0."""
    length, radius, mass, height = 0.5, 0.03, 2.0, 1.3
    model = pin.Model()
    model.name = "double_pendulum"
    hanging = pin.SE3(np.eye(3), np.array([0.0, 0.0, -length / 2]))
    parent, hinge = 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
    visuals = [
        primitive(0, hinge * translation(-0.06, 0.0, 0.0), Box((0.06, 0.14, 0.14)), DARK_GRAY)
    ]
    for name, color in (("shoulder", BLUE), ("elbow", ORANGE)):
        parent = model.addJoint(parent, pin.JointModelRX(), hinge, name)
        model.appendBodyToJoint(parent, pin.Inertia.FromCylinder(mass, radius, length), hanging)
        visuals += [
            primitive(parent, hanging, Cylinder(radius, length), color),
            primitive(parent, pin.SE3.Identity(), Sphere(1.5 * radius), DARK_GRAY),
        ]
        hinge = translation(0.0, 0.0, -length)
    visuals.append(primitive(parent, hinge, Sphere(1.2 * radius), color))
    tip = model.addFrame(pin.Frame("tip", parent, hinge, pin.FrameType.OP_FRAME))
    return Arm(
        name="double-pendulum",
        title=ARM_TITLES["double-pendulum"],
        model=model,
        home=np.array([0.9, 0.6]),
        torque_limit=np.array([100.0, 50.0]),
        tip=tip,
        visuals=tuple(visuals),
        collisions=tuple(visuals),
        camera=((1.9, 0.7, 1.2), (0.0, 0.25, 0.85)),
    )


@cache
def scara() -> Arm:
    """A SCARA arm, 4 joints: two that turn links of 0.4 m and 0.3 m in the horizontal plane, a
    quill that slides along the vertical by 0.15 m either way, and its turn about the vertical.
    All axes are the world's z. At q = 0 the arm is stretched along x. Uniform links; reflected
    inertia of the order of small gear motors."""
    model = pin.Model()
    model.name = "scara"
    shoulder = model.addJoint(0, pin.JointModelRZ(), translation(0.0, 0.0, 0.5), "shoulder")
    elbow = model.addJoint(shoulder, pin.JointModelRZ(), translation(0.4, 0.0, 0.09), "elbow")
    quill = model.addJoint(elbow, pin.JointModelPZ(), translation(0.3, 0.0, -0.1), "quill")
    tool = model.addJoint(quill, pin.JointModelRZ(), translation(0.0, 0.0, -0.16), "tool")
    for joint in (shoulder, elbow, quill, tool):
        model.addJointFrame(joint)
    links = {shoulder: (5.0, 0.4), elbow: (3.5, 0.3)}
    visuals = [
        primitive(0, translation(0.0, 0.0, 0.01), Box((0.3, 0.3, 0.02)), DARK_GRAY),
        primitive(0, translation(0.0, 0.0, 0.23), Cylinder(0.07, 0.46), LIGHT_GRAY),
    ]
    for (joint, (mass, length)), color in zip(links.items(), (BLUE, ORANGE), strict=True):
        middle, size = translation(length / 2, 0.0, 0.0), (length, 0.11, 0.08)
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(mass, *size), middle)
        visuals += [
            primitive(joint, middle, Box(size), color),
            primitive(joint, pin.SE3.Identity(), Cylinder(0.075, 0.085), DARK_GRAY),
        ]
    model.appendBodyToJoint(
        quill, pin.Inertia.FromCylinder(1.0, 0.018, 0.45), translation(0, 0, 0.06)
    )
    model.appendBodyToJoint(
        tool, pin.Inertia.FromBox(0.5, 0.1, 0.04, 0.03), translation(0, 0, -0.03)
    )
    visuals += [
        primitive(elbow, translation(0.3, 0.0, 0.0), Cylinder(0.06, 0.14), DARK_GRAY),
        primitive(quill, translation(0.0, 0.0, 0.07), Cylinder(0.018, 0.46), LIGHT_GRAY),
        primitive(tool, translation(0.0, 0.0, -0.015), Cylinder(0.03, 0.03), DARK_GRAY),
        primitive(tool, translation(0.0, 0.0, -0.04), Box((0.1, 0.03, 0.02)), BLUE),
    ]
    model.armature = np.array([0.3, 0.15, 5.0, 0.01])
    model.lowerPositionLimit = np.array([-np.pi, -2.6, -0.15, -np.pi])
    model.upperPositionLimit = -model.lowerPositionLimit
    limit = np.array([100.0, 60.0, 150.0, 10.0])
    model.effortLimit = limit.copy()
    tip = model.addFrame(pin.Frame("tip", tool, translation(0, 0, -0.05), pin.FrameType.OP_FRAME))
    return Arm(
        name="scara",
        title=ARM_TITLES["scara"],
        model=model,
        home=np.array([-0.4, 1.2, 0.0, -0.8]),
        torque_limit=limit,
        tip=tip,
        visuals=tuple(visuals),
        collisions=tuple(visuals),
        camera=((1.15, -0.95, 0.95), (0.2, 0.05, 0.36)),
    )


ARMS: Mapping[str, Callable[[], Arm]] = {
    "ur5": ur5,
    "panda": panda,
    "double-pendulum": double_pendulum,
    "scara": scara,
}


def load_arm(name: str) -> Arm:
    """The arm of this name; the same object every time. Raises LabError, listing those there
    are."""
    try:
        return ARMS[name]()
    except KeyError:
        raise LabError(f"no arm is named {name!r}; there are {', '.join(ARMS)}") from None


def _load_urdf(urdf: str) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
    """Model, collision and visual geometry of a URDF of example-robot-data."""
    share = Path(pin.__file__).parents[4] / "share"
    path = share / "example-robot-data" / "robots" / urdf
    if not path.is_file():
        raise LabError(
            f"the robot description robots/{urdf} is not installed beside Pinocchio; "
            "install the package example-robot-data"
        )
    model, collision, visual = pin.buildModelsFromUrdf(str(path), [str(share)])
    return model, collision, visual


def _visuals(geometry: pin.GeometryModel) -> tuple[Visual, ...]:
    return tuple(
        Visual(
            joint=int(piece.parentJoint),
            placement=piece.placement.copy(),
            mesh="" if (shape := _primitive_shape(piece.geometry)) else str(piece.meshPath),
            scale=_vector3(piece.meshScale),
            shape=shape,
            color=_vector3(piece.meshColor),
        )
        for piece in geometry.geometryObjects
    )


def _color_as_steel(pieces: tuple[Visual, ...]) -> tuple[Visual, ...]:
    """Light-weight shapes bring no material."""
    return tuple(replace(piece, color=STEEL_COLORS[piece.joint % 2]) for piece in pieces)


def _primitive_shape(geometry: Any) -> Shape | None:
    """The primitive this collision geometry is; None for a mesh."""
    match type(geometry).__name__:
        case "Box":
            return Box(_vector3(2 * geometry.halfSide))
        case "Cylinder":
            return Cylinder(float(geometry.radius), float(2 * geometry.halfLength))
        case "Sphere":
            return Sphere(float(geometry.radius))
        case _:
            return None


def _vector3(values: Any) -> Vector3:
    return float(values[0]), float(values[1]), float(values[2])
