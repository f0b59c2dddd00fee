"""Chance constraints of linear MPC under Gaussian noise (notes, 2.5.5), made deterministic.

    x+ = A x + B u + w,   w ~ N(0, Sigma_w), independent from step to step
    u_k = v_k + K (x_k - z_k)   about the nominal   z+ = A z + B v

The error e = x - z is Gaussian, e_k ~ N(0, Sigma_k), with

    Sigma_(k+1) = (A + B K) Sigma_k (A + B K)' + Sigma_w,

so a row of H x <= h holds with probability p at step k exactly where the nominal state keeps

    H_i z_k <= h_i - q(p) sqrt(H_i Sigma_k H_i'),           q the quantile of the normal

and a row of the control's limits likewise, with K Sigma_k K'. Two ways to use it:

`nominal_from_measured_state` plans from z_0 = x at every period: Sigma_0 = 0, and margins grow
along the horizon. What it promises is seen from the period that plans, and where x is too near a
limit there is no plan: nothing rules that out.

`nominal_from_predicted_state` plans from where the last plan's nominal state came to, whatever the
noise did, and leaves the noise to K: the margins of all steps are those of the Sigma that Sigma_k
grows to. Its promise is seen from the start, and with a terminal set that need not be left it is
feasible for ever once it is.

Either promises each row at each step, one by one: it is broken with probability at most 1 - p.
Of M of them together the promise is only that with probability at least 1 - M (1 - p) none is
broken (Boole).

M. Farina, L. Giulioni, R. Scattolini, "Stochastic linear model predictive control with chance
constraints: a review", Journal of Process Control 44, 2016; L. Hewing, M. N. Zeilinger,
"Stochastic model predictive control for linear systems using probabilistic reachable sets",
CDC 2018.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_discrete_lyapunov
from scipy.special import ndtri

from labs.errors import LabError
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron


@dataclass(frozen=True, eq=False)
class Noise:
    """What is known of the disturbance and done against it."""

    covariance: np.ndarray
    """Sigma_w (n, n), semidefinite."""
    K: np.ndarray
    """(m, n) the ancillary gain."""


def error_covariances(problem: LinearMpcProblem, noise: Noise) -> np.ndarray:
    """Sigma_0 ... Sigma_N (N + 1, n, n)."""
    A_K = problem.A + problem.B @ noise.K
    Sigma = np.zeros((problem.N + 1, problem.n, problem.n))
    for k in range(problem.N):
        Sigma[k + 1] = A_K @ Sigma[k] @ A_K.T + noise.covariance
    return Sigma


def stationary_covariance(problem: LinearMpcProblem, noise: Noise) -> np.ndarray:
    """What Sigma_k (n, n) grows to. Raises LabError where A + B K is not stable."""
    A_K = problem.A + problem.B @ noise.K
    if not np.abs(np.linalg.eigvals(A_K)).max() < 1.0:
        raise LabError("the ancillary gain K does not stabilise: the error's variance never ends")
    return np.asarray(solve_discrete_lyapunov(A_K, noise.covariance))


def back_off(limits: Polyhedron, Sigma: np.ndarray, probability: float) -> np.ndarray:
    """q(p) sqrt(H_i Sigma H_i') for each row of H x <= h: (..., rows) of Sigma (..., n, n). Raises
    LabError unless the probability is in [0.5, 1): below, limits would be widened."""
    if not 0.5 <= probability < 1.0:
        raise LabError(
            f"a probability of {probability:g}: chance constraints take 0.5 up to below 1"
        )
    variance = np.einsum("ij,...jk,ik->...i", limits.H, Sigma, limits.H)
    return np.asarray(ndtri(probability) * np.sqrt(np.maximum(variance, 0.0)))


def nominal_from_measured_state(
    problem: LinearMpcProblem, noise: Noise, probability: float
) -> LinearMpcProblem:
    """The nominal problem to be solved from the measured state: margins along the horizon. Its
    terminal set is the nominal state's, and stays."""
    Sigma, K = error_covariances(problem, noise)[:-1], noise.K
    return replace(
        problem,
        state_margins=back_off(problem.state_set, Sigma, probability),
        control_margins=back_off(problem.control_set, K @ Sigma @ K.T, probability),
    )


def nominal_from_predicted_state(
    problem: LinearMpcProblem, noise: Noise, probability: float
) -> LinearMpcProblem:
    """The nominal problem to be solved from the nominal state: X and U less the margins of the
    stationary error. Its terminal set is the nominal state's, and stays."""
    Sigma, K = stationary_covariance(problem, noise), noise.K
    X, U = problem.state_set, problem.control_set
    return replace(
        problem,
        state_set=Polyhedron(X.H, X.h - back_off(X, Sigma, probability)),
        control_set=Polyhedron(U.H, U.h - back_off(U, K @ Sigma @ K.T, probability)),
    )
