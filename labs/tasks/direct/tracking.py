"""A plan of a direct method made ready to be played, in collocation, multiple shooting and the
race of direct methods: at ticks, with a linear-quadratic regulator about it that
brings the state back,

    minimise  sum_k w |dq_k|^2 + w_v |dv_k|^2 + |du_k / u_0|^2,   dx_(k+1) = A_k dx_k + B_k du_k

with the plan's own linearisation (notes, 2.4.5)."""

import numpy as np

from labs.algorithms import riccati
from labs.errors import LabError
from labs.models.discrete import DiscreteMechanism
from labs.problems.linear_quadratic import LqrProblem
from labs.tasks.direct.params import DirectParams
from labs.tasks.direct.trajectory import PiecewiseTrajectory
from labs.tasks.motion.playback import NominalTrajectory

CONTROL_PERIOD = 0.01
"""[s] The control is held for it."""
VELOCITY_WEIGHT = 0.01
"""w_v, in parts of w."""


def nominal_trajectory(params: DirectParams, motion: PiecewiseTrajectory) -> NominalTrajectory:
    """The motion at ticks, with the regulator's gains; with none where there is no regulator."""
    at = params.task
    N = max(1, round(motion.T / CONTROL_PERIOD))
    ticks = CONTROL_PERIOD * np.arange(N + 1)
    X, U = motion.states(at.mechanism, ticks), motion.mean_controls(ticks)
    return NominalTrajectory(X, U, _regulator_gains(params, X, U), CONTROL_PERIOD)


def _regulator_gains(params: DirectParams, X: np.ndarray, U: np.ndarray) -> np.ndarray:
    at = params.task
    n = at.mechanism.nq
    _, A, B = DiscreteMechanism(at.mechanism, CONTROL_PERIOD, "rk4").linearize(X, U)
    Q = np.diag(np.repeat([1.0, VELOCITY_WEIGHT], n)) * params.tracking
    R = np.diag(1.0 / at.u_0**2)
    try:
        return riccati.solve(LqrProblem(len(U), A, B, Q, R, Q)).gains
    except LabError:
        return np.zeros((len(U), at.mechanism.nu, 2 * n))
