"""Simple and double pendulums of uniform rods, in any number side by side.

With viscous friction b [N m s/rad] at every hinge and no motor,

    M(q) q'' + h(q, q') = -b q',    x = (q, v),    x' = f(x) = (v, M^-1 (-b v - h))

One rod of mass m and length L is the pendulum q'' = -(3 g / 2 L) sin q - (3 b / m L^2) q'.
All rods: 0.5 m, 2 kg, radius 0.02 m. At q = 0 they hang; they swing in vertical planes x = const.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import pinocchio as pin

from labs.algorithms.runge_kutta import VectorField
from labs.models.arms import Arm
from labs.shapes import Box, Cylinder, Sphere, Vector3, primitive, translation

ROD_LENGTH, ROD_RADIUS, ROD_MASS = 0.5, 0.02, 2.0
"""Of a rod [m], [m], [kg]."""
GRAY: Vector3 = (0.36, 0.39, 0.44)


@dataclass(frozen=True, eq=False)
class Pendulum:
    """A pendulum as numbers. `data` is a workspace: its contents mean nothing between calls."""

    model: pin.Model
    data: pin.Data
    friction: float

    def acceleration(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """v' (nv,) [rad/s^2]."""
        a: np.ndarray = pin.aba(self.model, self.data, q, v, -self.friction * v)
        return a

    def f(self, x: np.ndarray, t: float) -> np.ndarray:
        """x' (2 nv,)."""
        n = len(x) // 2
        v = x[n:]
        return np.concatenate([v, self.acceleration(x[:n], v)])

    def jacobian(self, x: np.ndarray, t: float) -> np.ndarray:
        """df/dx (2 nv, 2 nv), by Pinocchio's derivatives of the articulated-body algorithm."""
        n = len(x) // 2
        v = x[n:]
        by_q, by_v, by_tau = pin.computeABADerivatives(
            self.model, self.data, x[:n], v, -self.friction * v
        )
        derivative = np.zeros((2 * n, 2 * n))
        derivative[:n, n:] = np.eye(n)
        derivative[n:, :n] = by_q
        derivative[n:, n:] = by_v - self.friction * by_tau
        return derivative

    @property
    def vector_field(self) -> VectorField:
        return VectorField(self.f, self.jacobian)

    def energy(self, x: np.ndarray) -> float:
        """Kinetic and potential energy [J], zero at rest at x = 0."""
        n = len(x) // 2
        kinetic = pin.computeKineticEnergy(self.model, self.data, x[:n], x[n:])
        potential = pin.computePotentialEnergy(self.model, self.data, x[:n])
        return float(kinetic + potential - self.rest_potential_energy)

    @cached_property
    def rest_potential_energy(self) -> float:
        """Potential energy [J] at rest at x = 0, by Pinocchio's zero."""
        return float(pin.computePotentialEnergy(self.model, self.data, np.zeros(self.model.nv)))

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """(2 nv,) complex [1/s]: lambda of df/dx at rest at x = 0."""
        values: np.ndarray = np.linalg.eigvals(self.jacobian(np.zeros(2 * self.model.nv), 0.0))
        return values.astype(complex)


@cache
def pendulum(rods: int, friction: float = 0.0) -> Pendulum:
    """A pendulum of this many rods."""
    model = pendulum_arm(rods).model
    return Pendulum(model, model.createData(), friction)


@cache
def pendulum_arm(rods: int, place: tuple[float, float] = (0.0, 0.0), color: Vector3 = GRAY) -> Arm:
    """The same as a robot to draw, hung up at (*place, 0.25 + rods L) [m]."""
    model = pin.Model()
    model.name = f"pendulum{rods}"
    middle = translation(0.0, 0.0, -ROD_LENGTH / 2)
    parent, hinge = 0, translation(*place, 0.25 + rods * ROD_LENGTH)
    visuals = [primitive(0, hinge, Box((0.05, 0.07, 0.05)), GRAY)]
    for rod in range(rods):
        parent = model.addJoint(parent, pin.JointModelRX(), hinge, f"hinge{rod + 1}")
        model.appendBodyToJoint(
            parent, pin.Inertia.FromCylinder(ROD_MASS, ROD_RADIUS, ROD_LENGTH), middle
        )
        visuals.append(primitive(parent, middle, Cylinder(ROD_RADIUS, ROD_LENGTH), color))
        hinge = translation(0.0, 0.0, -ROD_LENGTH)
        visuals.append(primitive(parent, hinge, Sphere(2.2 * ROD_RADIUS), color))
    tip = model.addFrame(pin.Frame("tip", parent, hinge, pin.FrameType.OP_FRAME))
    return Arm(
        name=model.name,
        title=f"Pendulum of {rods}",
        model=model,
        home=np.zeros(rods),
        torque_limit=np.full(rods, np.inf),
        tip=tip,
        visuals=tuple(visuals),
        collisions=tuple(visuals),
        camera=((2.6, 1.6, 1.2), (0.0, 0.0, 0.6)),
    )
