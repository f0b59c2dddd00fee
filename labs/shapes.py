"""What a body looks like: meshes and primitives that move with the joints of its model."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pinocchio as pin

Vector3 = tuple[float, float, float]

DARK_GRAY: Vector3 = (0.36, 0.39, 0.44)
LIGHT_GRAY: Vector3 = (0.62, 0.65, 0.7)
BLUE: Vector3 = (0.16, 0.42, 0.76)
ORANGE: Vector3 = (0.88, 0.5, 0.16)
"""Colours of bodies that bring no material: mounts, rails, first and second links."""
STEEL_COLORS: tuple[Vector3, Vector3] = ((0.6, 0.65, 0.72), (0.42, 0.48, 0.57))
"""Of an arm's links in turn, so that one tells them apart; dark enough for a white background."""


@dataclass(frozen=True)
class Box:
    """A box centred at its frame; `size` is its full extent along x, y, z [m]."""

    size: Vector3


@dataclass(frozen=True)
class Cylinder:
    """A cylinder centred at its frame, its axis along z; radius and length [m]."""

    radius: float
    length: float


@dataclass(frozen=True)
class Sphere:
    """A ball centred at its frame; radius [m]."""

    radius: float


Shape = Box | Cylinder | Sphere


@dataclass(frozen=True)
class Visual:
    """One rigid piece of what a body looks like: a mesh file or a primitive, never both."""

    joint: int
    """The joint it moves with, as an index of the model; 0 is the world."""
    placement: pin.SE3
    """Where it sits in that joint's frame."""
    mesh: str
    """Path of its mesh; empty for a primitive."""
    scale: Vector3
    """Scale of the mesh along x, y, z."""
    shape: Shape | None
    """The primitive; None for a mesh."""
    color: Vector3
    """Red, green, blue in [0, 1], for whatever brings no material of its own."""


class Body(Protocol):
    """What a scene can draw: a Pinocchio model and the pieces that move with its joints."""

    @property
    def model(self) -> pin.Model: ...
    @property
    def visuals(self) -> tuple[Visual, ...]:
        """What to draw when there is time to: detailed meshes with their materials."""
        ...

    @property
    def collisions(self) -> tuple[Visual, ...]:
        """Light-weight shapes, for ghosts and for machines that draw slowly."""
        ...


def primitive(joint: int, placement: pin.SE3, shape: Shape, color: Vector3) -> Visual:
    """A piece of one colour that needs no mesh."""
    return Visual(joint, placement, "", (1.0, 1.0, 1.0), shape, color)


def translation(x: float, y: float, z: float) -> pin.SE3:
    """A placement without a turn [m]."""
    return pin.SE3(np.eye(3), np.array([x, y, z]))
