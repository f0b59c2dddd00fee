"""What is counted over the runs."""

from dataclasses import dataclass

import numpy as np
from scipy.special import bdtr

from labs.optimal_control.mpc_uncertainty.controllers import NOMINAL, Controllers
from labs.optimal_control.mpc_uncertainty.params import UncertaintyParams
from labs.optimal_control.mpc_uncertainty.runs import RUN_STEPS, DisturbedRuns

CONFIDENCE = 0.95
ARRIVAL_STEP = RUN_STEPS // 2
"""Step from which on the runs count as having arrived."""
ROUNDING = 1e-9
"""[m]"""


@dataclass(frozen=True, eq=False)
class Counts:
    """By controller, all (3,) but the first."""

    beyond: np.ndarray
    """(3, k + 1) the share of runs behind the wall at each step."""
    ever: np.ndarray
    """The share that ever was."""
    held: np.ndarray
    """The share at a step, on average from step ARRIVAL_STEP on; NaN before."""
    distance: np.ndarray
    """[m] mean distance from the wall, likewise."""
    cost: np.ndarray
    """Mean cost paid so far: of the states and forces that were, not of plans."""
    unplanned: np.ndarray
    """The share of steps at which there was no plan."""


def run_statistics(params: UncertaintyParams, chosen: Controllers, runs: DisturbedRuns) -> Counts:
    """Over all runs so far."""
    problem = chosen.problems[NOMINAL]
    away = runs.X[:, :-1] - np.array([params.target, 0.0])
    stages = (away @ problem.Q * away).sum(axis=-1) + params.r * runs.U**2
    beyond = runs.X[..., 0] > params.wall + ROUNDING
    arrived = min(ARRIVAL_STEP, runs.steps)
    return Counts(
        beyond=beyond.mean(axis=2),
        ever=beyond.any(axis=1).mean(axis=1),
        held=beyond[:, arrived:].mean(axis=(1, 2)),
        distance=params.wall - runs.X[:, arrived:, :, 0].mean(axis=(1, 2)),
        cost=0.5 * stages.sum(axis=1).mean(axis=1),
        unplanned=1.0 - runs.planned.mean(axis=(1, 2)) if runs.steps else np.zeros(3),
    )


def confidence_interval(params: UncertaintyParams) -> tuple[float, float]:
    """Between which shares of the runs a count lies in 95 of 100 cases, if each is beyond with
    the probability promised: its quantiles (1 -+ CONFIDENCE) / 2, of a binomial distribution."""
    runs, risk = round(params.count), 1.0 - params.probability / 100.0
    at_most = bdtr(np.arange(runs + 1.0), runs, risk)
    low, high = np.searchsorted(at_most, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE])
    return float(low) / runs, float(high) / runs
