"""A body in two rings that turns to and fro near the lock of its Euler angles (notes, 1.1.2)."""

from dataclasses import dataclass

import numpy as np

from labs.algorithms.orientation import (
    angle_axis_to_matrix,
    euler_axes,
    euler_to_matrix,
    gimbal_lock_direction,
    matrix_to_euler,
)

CIRCLE_ANGLES = np.linspace(0.0, 2.0 * np.pi, 49)


@dataclass(frozen=True)
class Gimbal:
    """R(phase) = exp(A sin(2 pi phase) [u]x) R_b(theta_0): from the Euler angles (0, theta_0, 0) of
    `sequence`, a rotation of A = `size` [rad] about the world's fixed axis u. theta_0 is `distance`
    [rad] short of the lock. `direction` names u: "first" and "second" are axes of the sequence,
    "lost" is perpendicular to both."""

    sequence: str
    distance: float
    direction: str
    size: float

    @property
    def middle(self) -> float:
        """theta_0 [rad]: the lock is at pi/2 with three different axes, at 0 with two."""
        three = self.sequence[2] != self.sequence[0]
        return np.pi / 2 - self.distance if three else self.distance

    @property
    def axis(self) -> np.ndarray:
        """u (3,)."""
        if self.direction == "lost":
            return gimbal_lock_direction(self.sequence, 0.0)
        letter = self.sequence[0 if self.direction == "first" else 1]
        axis: np.ndarray = np.eye(3)["xyz".index(letter)]
        return axis

    def rotation(self, phase: float) -> np.ndarray:
        """R (3, 3) at a phase [cycles]."""
        middle = euler_to_matrix(self.sequence, np.array([0.0, self.middle, 0.0]))
        rotation: np.ndarray = self.turn(self.size * np.sin(2.0 * np.pi * phase)) @ middle
        return rotation

    def turn(self, angle: float) -> np.ndarray:
        """The rotation (3, 3) by an angle [rad] about u."""
        return angle_axis_to_matrix(angle, self.axis)

    def angles(self, rotation: np.ndarray) -> np.ndarray:
        """The Euler angles (phi, theta, psi) (3,) [rad] of R."""
        return matrix_to_euler(self.sequence, rotation)

    def axes(self, rotation: np.ndarray) -> np.ndarray:
        """(3, 3): as rows the axes in the world about which phi, theta and psi turn."""
        return euler_axes(self.sequence, self.angles(rotation)).T

    def rings(self, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Two unit circles (k, 3): the outer ring turns by phi about the first axis and carries
        the bearings of the second; the inner turns by theta in them and carries the third. At the
        lock the rings lie in one plane."""
        first, second, third = self.axes(rotation)
        return _unit_circle(first, second), _unit_circle(second, third)


def _unit_circle(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.outer(np.cos(CIRCLE_ANGLES), u) + np.outer(np.sin(CIRCLE_ANGLES), v)
