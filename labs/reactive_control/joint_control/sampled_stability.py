"""Why a sampled control loop diverges: the gains, the control period, or the integrator.

Near a resting reference the robot is x' = A x + B u, x = (dq, dv), and the controller
u = -K x + k_z z, z' = -dq (notes, 1.2; the rest is standard sampled-data control, e.g. Åström
and Wittenmark, Computer-Controlled Systems). Three loops are compared by their growth rate
sigma [1/s], the error going as exp(sigma t):

1. continuous control     eigenvalues s of [[A - B K, B k_z], [-C, 0]],   sigma = max Re s
2. torque held for T      x+ = Phi x + Gamma u, z+ = z - T C x with
                          Phi = exp(A T), Gamma = int_0^T exp(A s) ds B,
                          eigenvalues m of the closed loop,   sigma = log max |m| / T
3. as it is simulated     the same with Phi and Gamma made by T/h steps of the integrator

The integral z takes part only where the law has one. The first of the three that grows nearly
as fast as the last is at fault.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from labs.algorithms.discretisation import zero_order_hold, zero_order_hold_integrated
from labs.algorithms.equation_of_motion import mass_matrix
from labs.algorithms.joint_control import CONTROL_LAWS, Gains, linearise_law
from labs.reactive_control.joint_control.sampled_control import (
    TIME_UNIT,
    time_between_ticks,
    to_time_units,
)

GROWTH_TOLERANCE = 1e-3
"""[1/s] growth below this is not told from none: at a pole on the stability boundary, rounding
alone is worth that much."""

FAULT_SHARE = 0.6
"""A loop that grows at least this fast, as a share of the simulated one, explains it. With
k_d = 0 and T = h explicit Euler grows twice as fast as holding the torque alone would."""


@dataclass(frozen=True)
class LinearisedRobot:
    """The robot near a posture: M dq'' + F dq' + G dq = d tau, each (nv, nv), G = dg/dq."""

    mass: np.ndarray
    friction: np.ndarray
    gravity: np.ndarray
    load: np.ndarray
    """g (nv,) [N m]: the torque that holds it there."""

    @classmethod
    def near(
        cls, model: pin.Model, data: pin.Data, q: np.ndarray, friction: float
    ) -> "LinearisedRobot":
        """Linearised at rest at q (nq,), with viscous `friction` [N m s/rad] at every joint."""
        gravity = pin.computeGeneralizedGravityDerivatives(model, data, q)
        load = pin.computeGeneralizedGravity(model, data, q).copy()
        return cls(mass_matrix(model, data, q), friction * np.eye(model.nv), gravity.copy(), load)

    def dynamics(self) -> tuple[np.ndarray, np.ndarray]:
        """A (2n, 2n) and B (2n, n)."""
        n = len(self.mass)
        inverse = np.linalg.inv(self.mass)
        a = np.block(
            [
                [np.zeros((n, n)), np.eye(n)],
                [-inverse @ self.gravity, -inverse @ self.friction],
            ]
        )
        return a, np.vstack([np.zeros((n, n)), inverse])


@dataclass(frozen=True)
class LoopParameters:
    """What a loop consists of, besides the robot. Times in seconds."""

    controller: str
    gains: Gains
    control_period: float
    """As it is set, at least the time between two ticks."""
    integrator: str
    step: float

    @property
    def period(self) -> float:
        """Between two ticks: the control period rounded up to whole integration steps."""
        return (
            time_between_ticks(to_time_units(self.control_period), to_time_units(self.step))
            * TIME_UNIT
        )


@dataclass(frozen=True)
class Diagnosis:
    """The growth rates [1/s] of the three loops, and which is at fault: "gains", "period",
    "integrator", or "" when the simulated loop is stable near the reference."""

    continuous: float
    sampled: float
    simulated: float
    fault: str


@dataclass(frozen=True)
class LinearLoop:
    """A robot and its controller near a posture; `model` is the controller's."""

    robot: LinearisedRobot
    model: pin.Model
    data: pin.Data
    q: np.ndarray

    def poles(self, settings: LoopParameters) -> np.ndarray:
        """Eigenvalues [1/s] of the loop under continuous control."""
        a, b = self.robot.dynamics()
        return np.linalg.eigvals(self._closed_loop_matrix(settings, a, b, 1.0, sampled=False))

    def multipliers(self, settings: LoopParameters, *, exact: bool = False) -> np.ndarray:
        """Eigenvalues of the map over one control period, the robot's motion between ticks
        integrated as set, or exactly."""
        a, b = self.robot.dynamics()
        phi, gamma = (
            zero_order_hold(a, b, settings.period)
            if exact
            else zero_order_hold_integrated(
                settings.integrator, settings.step, a, b, settings.period
            )
        )
        return np.linalg.eigvals(
            self._closed_loop_matrix(settings, phi, gamma, settings.period, sampled=True)
        )

    def growth_rate(self, settings: LoopParameters, *, exact: bool = False) -> float:
        """sigma [1/s] of the sampled loop."""
        radius = float(np.abs(self.multipliers(settings, exact=exact)).max())
        return float(np.log(max(radius, 1e-300))) / settings.period

    def static_deviation(self, settings: LoopParameters) -> float:
        """[rad] how far from q a joint comes to rest: what the law's torque at q lacks of the
        load, over the stiffness, (K_q + G) dq = tau - g. None with an integral; infinite without
        any stiffness."""
        law = linearise_law(settings.controller, self.model, self.data, settings.gains, self.q)
        zero = np.zeros_like(self.q)
        torque = CONTROL_LAWS[settings.controller](self.model, self.data, settings.gains)
        lacking = torque(self.q, zero, zero, self.q, zero, zero) - self.robot.load
        if law.k_z.any() or np.abs(lacking).max() < 1e-9:
            return 0.0
        stiffness = law.k_q + self.robot.gravity
        if np.linalg.matrix_rank(stiffness) < len(zero):
            return np.inf
        return float(np.abs(np.linalg.solve(stiffness, lacking)).max())

    def diagnose(self, settings: LoopParameters) -> Diagnosis:
        """Which of the three loops is the first to be at fault."""
        continuous = float(self.poles(settings).real.max())
        sampled, simulated = self.growth_rate(settings, exact=True), self.growth_rate(settings)
        rates = {"gains": continuous, "period": sampled, "integrator": simulated}
        fault = ""
        if simulated > GROWTH_TOLERANCE:
            fault = next(name for name, rate in rates.items() if rate >= FAULT_SHARE * simulated)
        return Diagnosis(continuous, sampled, simulated, fault)

    def _closed_loop_matrix(
        self,
        settings: LoopParameters,
        phi: np.ndarray,
        gamma: np.ndarray,
        period: float,
        *,
        sampled: bool,
    ) -> np.ndarray:
        """x and z together: u = -K x + k_z z, and z' = -dq or z+ = z - T dq."""
        law = linearise_law(settings.controller, self.model, self.data, settings.gains, self.q)
        n = len(self.q)
        from_x = phi - gamma @ np.hstack([law.k_q, law.k_v])
        if not law.k_z.any():
            return np.asarray(from_x)
        to_z = np.hstack([-period * np.eye(n), np.zeros((n, n))])
        return np.block([[from_x, gamma @ law.k_z], [to_z, np.eye(n) * sampled]])
