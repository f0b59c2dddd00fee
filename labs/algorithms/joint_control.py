"""Joint motion control: four laws that turn a reference motion into torques (notes, 1.2).

With e = q_ref - q, e' = v_ref - v, z = integral of e, the robot M(q) a + h(q, v) = tau, and
h(q, 0) = g(q):

    open loop         tau = M(q_ref) a_ref + h(q_ref, v_ref)                          (1.2.1)
    PID               tau = k_p e + k_d e' + k_i z                                    (1.2.2)
    PD + gravity      tau = k_p e + k_d e' + g(q)                                     (1.2.3)
    computed torque   tau = M(q) (a_ref + k_p e + k_d e') + h(q, v)     (beyond the notes)

The gains are the same for every joint: k_p [N m/rad], k_i [N m/(rad s)], k_d [N m s/rad]. In
computed torque they act on accelerations, so there k_p is in 1/s^2 and k_d in 1/s, and with a
perfect model e'' + k_d e' + k_p e = 0 for every joint alone.

A law maps (q, v, z, q_ref, v_ref, a_ref), each (nv,), to tau (nv,) [N m].
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from labs.algorithms.equation_of_motion import mass_matrix

ControlLaw = Callable[
    [np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray
]


@dataclass(frozen=True)
class Gains:
    """k_p, k_i, k_d, each the same for every joint."""

    kp: float
    ki: float
    kd: float


def open_loop(model: pin.Model, data: pin.Data, gains: Gains) -> ControlLaw:
    """tau = M(q_ref) a_ref + h(q_ref, v_ref): the inverse dynamics of the reference, whatever
    the robot does."""
    inverse_dynamics = pin.rnea
    return lambda q, v, z, q_ref, v_ref, a_ref: inverse_dynamics(model, data, q_ref, v_ref, a_ref)


def pid(model: pin.Model, data: pin.Data, gains: Gains) -> ControlLaw:
    """tau = k_p e + k_d e' + k_i z: no model at all."""
    kp, ki, kd = _gain_vectors(model, gains)
    return lambda q, v, z, q_ref, v_ref, a_ref: kp * (q_ref - q) + kd * (v_ref - v) + ki * z


def pd_gravity_compensation(model: pin.Model, data: pin.Data, gains: Gains) -> ControlLaw:
    """tau = k_p e + k_d e' + g(q): of the model, its gravity only."""
    kp, _, kd = _gain_vectors(model, gains)
    gravity = pin.computeGeneralizedGravity
    return lambda q, v, z, q_ref, v_ref, a_ref: (
        kp * (q_ref - q) + kd * (v_ref - v) + gravity(model, data, q)
    )


def computed_torque(model: pin.Model, data: pin.Data, gains: Gains) -> ControlLaw:
    """tau = M(q) (a_ref + k_p e + k_d e') + h(q, v): all of the model, at the measured state."""
    kp, _, kd = _gain_vectors(model, gains)
    inverse_dynamics = pin.rnea
    return lambda q, v, z, q_ref, v_ref, a_ref: inverse_dynamics(
        model, data, q, v, a_ref + kp * (q_ref - q) + kd * (v_ref - v)
    )


CONTROL_LAWS: Mapping[str, Callable[[pin.Model, pin.Data, Gains], ControlLaw]] = {
    "open-loop": open_loop,
    "pid": pid,
    "pd-gravity": pd_gravity_compensation,
    "computed-torque": computed_torque,
}


@dataclass(frozen=True)
class LinearFeedback:
    """A law near a resting reference: d tau = -k_q dq - k_v dv + k_z dz, each (nv, nv)."""

    k_q: np.ndarray
    k_v: np.ndarray
    k_z: np.ndarray


def linearise_law(
    name: str, model: pin.Model, data: pin.Data, gains: Gains, q: np.ndarray
) -> LinearFeedback:
    """The law's derivatives at q = q_ref (nq,), v = v_ref = a_ref = 0, z = 0. There the
    derivative of g is dg/dq, and of M(q) a + h(q, v) it is M(q) da + (dg/dq) dq."""
    eye, zero = np.eye(model.nv), np.zeros((model.nv, model.nv))
    if name == "open-loop":
        return LinearFeedback(zero, zero, zero)
    if name == "pid":
        return LinearFeedback(gains.kp * eye, gains.kd * eye, gains.ki * eye)
    gravity = pin.computeGeneralizedGravityDerivatives(model, data, q)
    if name == "pd-gravity":
        return LinearFeedback(gains.kp * eye - gravity, gains.kd * eye, zero)
    mass = mass_matrix(model, data, q)
    return LinearFeedback(gains.kp * mass - gravity, gains.kd * mass, zero)


def _gain_vectors(model: pin.Model, gains: Gains) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The gains as arrays (nv,): NumPy multiplies two small arrays faster than an array by a
    number."""
    return (
        np.full(model.nv, gains.kp),
        np.full(model.nv, gains.ki),
        np.full(model.nv, gains.kd),
    )
