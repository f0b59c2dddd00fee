"""A plan played on the true dynamics, integrated finely: its controls alone, or with a linear
quadratic regulator about it that looks once a piece,

    u_i = y_i + K_i (x(t_i) - x_i)

K_i by the Riccati recursion along the plan's own linearisation, with the weights Q = I (in rad, m
and their rates) and R = (1/u_0)^2.
"""

import numpy as np

from labs.algorithms import riccati
from labs.algorithms.integrators import rk4
from labs.algorithms.shooting_steps import StepDerivatives
from labs.errors import LabError
from labs.problems.linear_quadratic import LqrProblem
from labs.problems.optimal_control import LARGEST_STATE
from labs.tasks.direct.systems import RestToRestTask

MAX_STEP = 0.01
"""[s] The most a step of the simulation takes; it goes by RK4."""


def tracking_gains(linearization: StepDerivatives, N: int, u_0: np.ndarray) -> np.ndarray:
    """K (N, nu, nx) for a plan of N pieces; zero where P grows beyond all numbers."""
    nx, nu = linearization.A.shape[1], len(u_0)
    A, B = np.tile(np.eye(nx), (N, 1, 1)), np.zeros((N, nx, nu))
    M = len(linearization.A) // N
    for step in range(M):  # all pieces at once
        by_x, by_u = linearization.A[step::M], linearization.B[step::M, :, :nu]
        A, B = by_x @ A, by_x @ B + by_u
    weight = np.eye(nx)
    try:
        return riccati.solve(LqrProblem(N, A, B, weight, np.diag(1.0 / u_0**2), weight)).gains
    except LabError:
        return np.zeros((N, nu, nx))


def simulate_plan(
    at: RestToRestTask, X: np.ndarray, U: np.ndarray, K: np.ndarray, T: float
) -> tuple[np.ndarray, np.ndarray]:
    """States (k N + 1, nx) on an even grid over T [s], and the controls (N, nu) that were given.
    X (N + 1, nx) and U (N, nu) are the plan's. It rests where it diverges."""
    N, n = len(U), at.mechanism.nq
    M = int(np.ceil(T / N / MAX_STEP - 1e-9))
    h = np.full(n, T / N / M)
    held = np.zeros(at.mechanism.nu)
    acceleration = at.mechanism.acceleration(held)
    states, given = np.tile(at.x0, (N * M + 1, 1)), U.copy()
    x = at.x0
    for j in range(N * M):
        i, since = divmod(j, M)
        if since == 0:
            given[i] += K[i] @ (x - X[i])
            held[:] = given[i]
        with np.errstate(all="ignore"):
            after = np.concatenate(rk4(acceleration, x[:n], x[n:], h))
        if not np.abs(after).max() <= LARGEST_STATE:
            states[j + 1 :] = x
            break
        x = states[j + 1] = after
    return states, given
