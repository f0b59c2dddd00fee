"""A mechanism as the world has it: with what its controller need not know of.

    M(q) q'' + h(q, q') = tau - b q' + J(q)^T f

M and h include a payload, a point mass at the tip; b [N m s/rad] is viscous friction, the same at
every joint; f [N] is a force at the tip in the world's axes, whose position it may depend on,
and J its translational Jacobian.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from labs.algorithms.integrators import Acceleration
from labs.models.arms import Arm, load_arm

Force = Callable[[np.ndarray], np.ndarray]
"""The tip's position (3,) [m] to the force on it (3,) [N]."""


@dataclass(frozen=True, eq=False)
class Plant:
    """An arm, a pendulum or a cart with its payload. `data` is a workspace: its contents mean
    nothing between calls."""

    arm: Arm
    """What draws it."""
    model: pin.Model
    data: pin.Data

    def acceleration(
        self, held: np.ndarray, friction: float = 0.0, force: Force | None = None
    ) -> Acceleration:
        """a(q, v) under the torque `held` (nv,) [N m]. It is read at every call, so whoever
        holds the array may write the next torque into it."""
        aba, model, data = pin.aba, self.model, self.data
        if force is not None:
            pushed = self.force_to_torque(force)
            return lambda q, v: aba(model, data, q, v, held - friction * v + pushed(q))
        if friction > 0.0:
            drag = np.full(model.nv, friction)
            return lambda q, v: aba(model, data, q, v, held - drag * v)
        return lambda q, v: aba(model, data, q, v, held)

    def tip(self, q: np.ndarray) -> np.ndarray:
        """Position of the tip (3,) [m]."""
        pin.framesForwardKinematics(self.model, self.data, q)
        position: np.ndarray = self.data.oMf[self.arm.tip].translation.copy()
        return position

    def tip_jacobian(self, q: np.ndarray) -> np.ndarray:
        """J(q), (3, nv): velocity of the tip in the world's axes is J(q) q'."""
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian: np.ndarray = pin.computeFrameJacobian(
            self.model, self.data, q, self.arm.tip, axes
        )
        # Of a single joint, Pinocchio gives a vector.
        return jacobian.reshape(6, -1)[:3]

    def energy(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        """Kinetic and potential energy [J]; the latter is zero at the height of the floor."""
        kinetic = pin.computeKineticEnergy(self.model, self.data, q, v)
        return float(kinetic), float(pin.computePotentialEnergy(self.model, self.data, q))

    def force_to_torque(self, force: Force) -> Callable[[np.ndarray], np.ndarray]:
        """q to J(q)^T f (nv,): the force as a torque [N m; N]."""

        def torque(q: np.ndarray) -> np.ndarray:
            applied = force(self.tip(q))
            return self.tip_jacobian(q).T @ applied

        return torque


@lru_cache(maxsize=16)
def plant(robot: str, payload: float = 0.0) -> Plant:
    """The arm of this name carrying `payload` [kg] at its end-effector."""
    arm = load_arm(robot)
    model = model_with_payload(arm, payload)
    return Plant(arm, model, model.createData())


def model_with_payload(arm: Arm, payload: float) -> pin.Model:
    """The arm's model with a point mass [kg] at its tip."""
    model = arm.model.copy()
    if payload > 0.0:
        frame = model.frames[arm.tip]
        mass = pin.Inertia(payload, np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(frame.parentJoint, mass, frame.placement)
    return model
