"""What becomes of a plan when one of its controls is changed: in truth, and as its sensitivities
have it. It is looked at, never taken."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from labs.algorithms.single_shooting import SingleShooting
from labs.arrays import with_row
from labs.optimal_control.single_shooting.plan import ShootingPlan, hold_after_divergence
from labs.problems.continuous_control import ContinuousProblem
from labs.tasks.direct.systems import rest_to_rest_task
from labs.tasks.motion.continuous import continuous_motion

CHANGE_FRACTIONS = (-1.0, -2 / 3, -1 / 3, 1 / 3, 2 / 3, 1.0)
"""The changes that are shown, in parts of the chosen one, which is the last."""
CHANGE_RANGE = 2.0
"""[u_0] over which the end of the motion is asked for, either way."""
MAX_INTEGRATION_STEPS, MIN_CHANGES, MAX_CHANGES = 600, 9, 31
"""Steps of integration that this may take, about, and how many changes are tried."""


@dataclass(frozen=True, eq=False)
class ChangedMotions:
    """The motion with another u_k of the motor that tells most."""

    states: np.ndarray
    """(len(CHANGE_FRACTIONS), N M + 1, nx)"""
    linear_prediction: np.ndarray
    """(N M + 1, nx): x + dx/dy_k delta, of the chosen change."""


@dataclass(frozen=True, eq=False)
class FinalStates:
    """Where the motion ends, for changes of many sizes."""

    changes: np.ndarray
    """(n,) [u_0]"""
    states: np.ndarray
    """(n, nx)"""
    linear_prediction: np.ndarray
    """(n, nx) along dx(T)/dy_k"""


@lru_cache(maxsize=4)
def changed_motions(name: str, plan: ShootingPlan, k: int, change: float) -> ChangedMotions:
    """When u_k of the system of this name becomes u_k + change u_0."""
    fan = np.array([_changed_states(name, plan, k, part * change) for part in CHANGE_FRACTIONS])
    return ChangedMotions(fan, plan.X + change * _sensitivity(name, plan, k))


@lru_cache(maxsize=4)
def final_states(name: str, plan: ShootingPlan, k: int) -> FinalStates:
    """Over changes of u_k within CHANGE_RANGE."""
    steps = (plan.N - k) * plan.M
    # Odd: no change is among them.
    count = int(np.clip(MAX_INTEGRATION_STEPS // steps, MIN_CHANGES, MAX_CHANGES)) | 1
    changes = np.linspace(-CHANGE_RANGE, CHANGE_RANGE, count)
    truth = np.array([_changed_states(name, plan, k, change)[-1] for change in changes])
    slope = _sensitivity(name, plan, k)[-1]
    return FinalStates(changes, truth, plan.X[-1] + changes[:, None] * slope)


def _changed_states(name: str, plan: ShootingPlan, k: int, change: float) -> np.ndarray:
    """X (N M + 1, nx) with u_k + change u_0 of that motor."""
    at = rest_to_rest_task(name)
    u = plan.U[k].copy()
    u[at.motor] += change * at.u_0[at.motor]
    U = with_row(plan.U[k:], 0, u)
    tail = _tail_problem(name, plan, k)
    X = tail.rollout(tail.pack(U)).X
    return np.concatenate([plan.X[: k * plan.M], hold_after_divergence(X)])


def _sensitivity(name: str, plan: ShootingPlan, k: int) -> np.ndarray:
    """dx_j/d(u_k/u_0) (N M + 1, nx) of that motor: none before t_k."""
    tail, at = _tail_problem(name, plan, k), rest_to_rest_task(name)
    S = tail.sensitivities(tail.linearize(tail.pack(plan.U[k:])))[:, :, at.motor]
    return np.concatenate([np.zeros((k * plan.M, tail.nx)), S * at.u_0[at.motor]])


def _tail_problem(name: str, plan: ShootingPlan, k: int) -> SingleShooting:
    """From piece k to the end, its controls free."""
    at, T = rest_to_rest_task(name), plan.T * (1.0 - k / plan.N)
    x, u = np.full(at.mechanism.nx, np.inf), np.full(at.mechanism.nu, np.inf)
    cost = continuous_motion(at.motion, "least-energy", T, target=np.zeros(3)).cost
    problem = ContinuousProblem(at.mechanism, cost, plan.X[k * plan.M], T, -x, x, -u, u)
    return SingleShooting(problem, plan.N - k, plan.M, plan.integrator)
