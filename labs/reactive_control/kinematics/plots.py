"""What kinematics plots, and the matrices behind it."""

from collections.abc import Mapping

import numpy as np

from labs.algorithms.frame_chain import multiply_poses
from labs.algorithms.orientation import (
    matrix_to_angle_axis,
    matrix_to_euler,
    matrix_to_quaternion,
    matrix_to_rpy,
)
from labs.plots import Line, Matrix, Readout, TimeSeries
from labs.reactive_control.kinematics.params import KinematicsParams

PLOTS = (
    Matrix("One factor of the chain", "factor", "H_i^{i-1}(q_i)", shade=True),
    Matrix("The whole chain", "product", "H_n^0(q)", shade=True),
    Matrix("Who depends on whom", "dependence", r"\|\partial H / \partial q_j\|", shade=True),
    Matrix("Rotation matrix: 9 numbers", "rotation", "R_n^0"),
    Matrix("Euler angles: 3 numbers", "euler", r"(\varphi, \theta, \psi)", "rad"),
    Matrix("Roll, pitch, yaw: 3 numbers", "rpy", r"(\zeta, \vartheta, \psi)", "rad"),
    Matrix("Angle and axis: 4 numbers", "angle_axis", r"(\alpha, u)"),
    Matrix("Quaternion: 4 numbers", "quaternion", "(w, x, y, z)"),
    TimeSeries(
        "Gimbal: Euler angles",
        "rad",
        Line("phi", r"\varphi"),
        Line("theta", r"\theta"),
        Line("psi", r"\psi", "dash"),
    ),
    TimeSeries(
        "Gimbal: quaternion",
        "",
        Line("qw", "w"),
        Line("qx", "x"),
        Line("qy", "y"),
        Line("qz", "z"),
    ),
    TimeSeries(
        "Gimbal: amplification",
        "",
        Line("amplification", r"\max|\dot\varphi_i| / |\omega|"),
        Line("law", r"1 / |\cos\theta|", "dash"),
        Line("quaternion_gain", r"|\dot Q| / |\omega|"),
    ),
    TimeSeries(
        "Gimbal: fastest angle and body",
        "rad/s",
        Line("rate", r"\max|\dot\varphi_i|"),
        Line("speed", r"|\omega|"),
    ),
    Readout("shown", "Factor shown, i", "", whole=True),
    Readout("orthogonality", "‖RᵀR − I‖", ""),
    Readout("determinant", "det R", ""),
    Readout("tool_law", "End-effector: worst amplification", ""),
    Readout("peak_rate", "Gimbal: fastest Euler angle", "rad/s"),
    Readout("peak_speed", "Gimbal: fastest rotation", "rad/s"),
)


def chain_fields(params: KinematicsParams, shown: int) -> Mapping[str, np.ndarray]:
    """The chain with the factor shown, from 1, and the end-effector's orientation in five ways."""
    chain = params.chain
    factors = chain.factors(params.q)
    pose = multiply_poses(factors)
    rotation = pose[:3, :3]
    angle, axis = matrix_to_angle_axis(rotation)
    return {
        "factor": factors[shown - 1],
        "product": pose,
        "dependence": chain.derivative_norms(params.q),
        "rotation": rotation,
        "euler": matrix_to_euler(params.sequence, rotation)[None],
        "rpy": matrix_to_rpy(rotation)[None],
        "angle_axis": np.array([[angle, *axis]]),
        "quaternion": matrix_to_quaternion(rotation)[None],
    }
