"""The equation of motion of the lab's arm at one instant: its terms, and what drives it (1.1.5)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from labs.algorithms.equation_of_motion import (
    EquationTerms,
    direct_dynamics,
    equation_terms,
    inverse_dynamics,
)
from labs.models.plant import Plant, plant
from labs.reactive_control.dynamics.params import DynamicsParams


@lru_cache(maxsize=16)
def plant_under_gravity(robot: str, payload: float, gravity: bool) -> Plant:
    """The arm of this name with its payload [kg], under gravity or without."""
    world = plant(robot, payload)
    if gravity:
        return world
    model = world.model.copy()
    model.gravity = pin.Motion.Zero()
    return Plant(world.arm, model, model.createData())


def drive_torque(
    params: DynamicsParams, world: Plant, q: np.ndarray, v: np.ndarray, t: float
) -> np.ndarray:
    """tau (nv,) [N m]: the sliders, and what drives the joints."""
    model, data = world.model, world.data
    tau = params.torques(model.nv) - params.damping * v
    if params.drive == "balanced":
        tau += pin.computeGeneralizedGravity(model, data, q)
    elif params.drive == "inverse":
        tau += inverse_dynamics(model, data, q, v, params.accelerations(model.nv, t))
        if params.force.any():
            tau -= world.tip_jacobian(q).T @ params.force
    return tau


@dataclass(frozen=True, eq=False)
class InstantaneousDynamics:
    """All of the equation at one instant."""

    terms: EquationTerms
    torque: np.ndarray
    """tau (nv,) [N m]"""
    external: np.ndarray
    """J^T w (nv,) [N m]"""
    acceleration: np.ndarray
    """q'' (nv,) [rad/s^2], by direct dynamics."""

    @classmethod
    def of(
        cls, params: DynamicsParams, world: Plant, q: np.ndarray, v: np.ndarray, t: float
    ) -> "InstantaneousDynamics":
        """At q [rad], v [rad/s] and t [s]."""
        torque = drive_torque(params, world, q, v, t)
        external = world.tip_jacobian(q).T @ params.force
        return cls(
            equation_terms(world.model, world.data, q, v),
            torque,
            external,
            direct_dynamics(world.model, world.data, q, v, torque + external),
        )
