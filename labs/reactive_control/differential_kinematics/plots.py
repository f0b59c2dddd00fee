"""What differential kinematics plots, and the matrices behind it."""

from collections.abc import Mapping

import numpy as np

from labs.algorithms.inverse_kinematics import REACH_TOLERANCE, manipulability
from labs.algorithms.jacobian import PosedChain, analytical_jacobian, geometric_jacobian
from labs.plots import Bars, Line, Matrix, Note, Readout, TimeSeries
from labs.reactive_control.differential_kinematics.params import DifferentialParams

PLOTS = (
    Matrix("Geometric Jacobian", "geometric", "J", shade=True),
    Matrix("Analytical Jacobian", "analytical", "J_A", shade=True),
    Matrix("Their difference", "difference", "J_A - J", shade=True),
    Matrix("Twist beside rate of the pose", "twist", r"(J\dot q,\; J_A\dot q)", shade=True),
    Bars("Singular values", "sigma", r"\sigma_k", ""),
    TimeSeries(
        "Distance to singularity",
        "",
        Line("sigma_min", r"\sigma_{min}"),
        Line("near", r"\text{warning}", "limit"),
    ),
    TimeSeries(
        "Joint speed",
        "rad/s",
        Line("speed", r"\lVert\dot q\rVert"),
        Line("speed_given", r"\lVert\dot q\rVert_{given}", "dash"),
        Line("bound", r"\lVert v\rVert/(2\lambda)", "limit"),
    ),
    TimeSeries("Joint velocities", "rad/s", Line("rates", r"\dot q"), select="joint"),
    TimeSeries("Task error", "m", Line("error", r"\lVert p^* - p_e\rVert")),
    TimeSeries(
        "Speed of orientation",
        "rad/s",
        Line("omega", r"\lVert\omega\rVert"),
        Line("rpy", r"\lVert\dot\phi_o\rVert", "dash"),
    ),
    Readout("sigma_min", "Distance to singularity (warning below 0.05)", ""),
    Readout("manipulability", "Manipulability", ""),
    Readout("condition", "Condition number", ""),
    Readout("peak", "Fastest joint speed asked", "rad/s"),
    Readout("short", "Target out of reach by", "m"),
    Readout("tip_speed", "Speed of the end-effector", "m/s"),
    Readout("bias", "Acceleration at constant joint velocities", "m/s²"),
    Note("Reach", "within_reach"),
)


def jacobian_fields(
    params: DifferentialParams, chain: PosedChain, rates: np.ndarray
) -> Mapping[str, np.ndarray]:
    """The Jacobians, (6, n); the twist and the rate of the pose at `rates` (n,), (6, 2)."""
    geometric = geometric_jacobian(chain)
    analytical = analytical_jacobian(chain, geometric)
    return {
        "geometric": geometric,
        "analytical": analytical,
        "difference": analytical - geometric,
        "twist": np.stack([geometric @ rates, analytical @ rates], axis=1),
        "sigma": singular_values(params, chain, geometric)[0],
    }


def singular_values(
    params: DifferentialParams, chain: PosedChain, jacobian: np.ndarray
) -> tuple[np.ndarray, float]:
    """Of the task's rows, for the joints that carry the frame; and their product."""
    return manipulability(jacobian[: params.rows, chain.supports])


def reach_note(params: DifferentialParams, nearest: float) -> str:
    """Whether the target can be reached, the frame coming as near as `nearest` [m]."""
    if params.mode != "follow":
        return "No target is followed."
    if nearest <= REACH_TOLERANCE:
        return "Nothing keeps the frame from where the target is."
    where = "At the far end of its way the" if params.reach > 0.0 else "The"
    return (
        f"{where} target is out of reach: no posture was found that brings "
        f"the frame nearer to it than {nearest:.3f} m."
    )
