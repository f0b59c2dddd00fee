"""What dynamics plots, and the arrays behind it."""

from collections.abc import Mapping

import numpy as np

from labs.algorithms.equation_of_motion import inverse_dynamics
from labs.models.plant import Plant
from labs.plots import Bars, Line, Matrix, Readout, TimeSeries
from labs.reactive_control.dynamics.equation import InstantaneousDynamics
from labs.reactive_control.dynamics.params import DynamicsParams

PLOTS = (
    TimeSeries(
        "What the torque of a joint is spent on",
        "N·m",
        Line("inertia", r"M \ddot q"),
        Line("coriolis", r"C \dot q"),
        Line("gravity", "g"),
        Line("applied", r"\tau + J^T w", "dash"),
        select="joint",
        stacked=True,
        lead=1,
    ),
    Matrix("Mass matrix", "mass", "M(q)", "kg·m²", shade=True),
    Bars("Eigenvalues of the mass matrix", "eigenvalues", r"\lambda(M)", "kg·m²"),
    Matrix("Coriolis matrix", "coriolis_matrix", r"C(q, \dot q)", "kg·m²/s", shade=True),
    Matrix("Bias torques, column by column", "bias", r"C \dot q, \; g, \; h", "N·m"),
    Bars(
        "Torque for the accelerations asked for",
        "asked_torque",
        r"\tau = M a + h - J^T w",
        "N·m",
        limit="torque_limit",
    ),
    TimeSeries("Energy", "J", Line("kinetic", "T"), Line("potential", "U"), Line("total", "T + U")),
    TimeSeries("Acceleration", "rad/s²", Line("acceleration", r"\ddot q"), select="joint"),
    TimeSeries("Velocity", "rad/s", Line("v", r"\dot q"), select="joint"),
    Readout("first_inertia", "Inertia about the first axis, M₁₁", "kg·m²"),
    Readout("apart", "Force and acceleration apart by", "°"),
    Readout("there_and_back", "Inverse, then direct", "rad/s²"),
    Readout("back_and_there", "Direct, then inverse", "N·m"),
    Readout("residual", "Left − right side", "N·m"),
    Readout("total", "Energy T + U", "J"),
    Readout("power", "Power τ·q̇ + w·v", "W"),
    Readout("drift", "Energy no work explains", "J"),
)


def plot_fields(
    params: DynamicsParams, world: Plant, q: np.ndarray, v: np.ndarray, t: float
) -> Mapping[str, np.ndarray]:
    """The terms as matrices, and the torque for the accelerations asked for."""
    now = InstantaneousDynamics.of(params, world, q, v, t)
    asked = params.accelerations(world.model.nv, t)
    needed = inverse_dynamics(world.model, world.data, q, v, asked) - now.external
    coriolis, gravity = now.terms.coriolis @ v, now.terms.gravity
    return {
        "mass": now.terms.mass,
        "coriolis_matrix": now.terms.coriolis,
        "bias": np.stack([coriolis, gravity, now.terms.bias(v)], axis=1),
        "eigenvalues": np.linalg.eigvalsh(now.terms.mass)[::-1],
        "asked_torque": needed,
        "torque_limit": world.arm.torque_limit,
    }
