"""What a direct method begins with, in collocation, multiple shooting and the race of direct
methods."""

from typing import NamedTuple

import numpy as np

from labs.models.discrete import DiscreteMechanism
from labs.problems.optimal_control import LARGEST_STATE
from labs.tasks.direct.params import DirectParams
from labs.tasks.direct.plan_params import PlanParams
from labs.tasks.direct.trajectory import PiecewiseTrajectory

MAX_STEP = 0.01
"""[s] The most a step of integration takes."""


class Guess(NamedTuple):
    """States and controls on a grid of N steps over T [s]."""

    X: np.ndarray
    """(N + 1, nx)"""
    U: np.ndarray
    """(N, nu), each held for a step."""
    T: float


def first_guess(params: DirectParams, N: int) -> Guess:
    """As chosen: a straight line in x, at rest all the way; the start; or controls, with the
    states that follow from them, which stay where they are once they diverge."""
    at, T = params.task, params.horizon
    U = np.tile(at.holding, (N, 1))
    X = np.tile(at.x0, (N + 1, 1))
    if params.guess == "line":
        goal = np.concatenate([params.goal_posture, np.zeros(at.mechanism.nq)])
        X = X + np.linspace(0.0, 1.0, N + 1)[:, None] * (goal - at.x0)
    if params.guess == "controls":
        t = (np.arange(N) + 0.5) * T / N
        wave = np.cos(2.0 * np.pi * params.guess_rate * t)[:, None]
        U = U + params.guess_size * wave * at.u_0
        if params.bound is not None:
            U = np.clip(U, -params.bound, params.bound)
        M = int(np.ceil(T / N / MAX_STEP - 1e-9))
        fine = DiscreteMechanism(at.mechanism, T / N / M, "rk4")
        with np.errstate(all="ignore"):
            X = fine.rollout(at.x0, np.repeat(U, M, axis=0))[::M]
            sound = np.abs(X).max(axis=1) <= LARGEST_STATE
        last = N if sound.all() else int(np.argmin(sound)) - 1
        X = X[np.minimum(np.arange(N + 1), last)]
    return Guess(X, U, T)


def is_warm_start(params: PlanParams, reusable: bool) -> bool:
    """Whether to start from the present motion, which is `reusable` where the solve that it is of
    neither failed nor was infeasible, and no first guess."""
    return params.start == "warm" and reusable


def start_guess(params: DirectParams, motion: PiecewiseTrajectory, reusable: bool, N: int) -> Guess:
    """What a change of the problem is solved from: the present motion, or the first guess."""
    if is_warm_start(params, reusable):
        return resample_motion(params, motion, N)
    return first_guess(params, N)


def resample_motion(params: DirectParams, motion: PiecewiseTrajectory, N: int) -> Guess:
    """The present motion on a grid of N steps, in the horizon's time if that is fixed."""
    T = motion.T if params.objective == "least-time" else params.horizon
    times = np.linspace(0.0, motion.T, N + 1)
    X = motion.states(params.task.mechanism, times)
    return Guess(X, motion.mean_controls(times), T)
