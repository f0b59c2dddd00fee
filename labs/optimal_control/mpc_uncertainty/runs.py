"""Many runs of the cart under each controller, with the same disturbances."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from labs.optimal_control.mpc_uncertainty.controllers import (
    NOMINAL,
    ROBUST,
    STOCHASTIC,
    Controllers,
)
from labs.optimal_control.mpc_uncertainty.disturbances import sample_disturbances
from labs.optimal_control.mpc_uncertainty.params import UncertaintyParams
from labs.problems.receding_horizon import Plan, Planner
from labs.resumable import Resumable

RUN_STEPS = 40
"""Of a run: 8 s."""


@dataclass(frozen=True, eq=False)
class DisturbedRuns:
    """All that happened so far; arrays are never written into again."""

    X: np.ndarray
    """(3, k + 1, runs, 2) by controller and step."""
    U: np.ndarray
    """(3, k, runs) [N]"""
    planned: np.ndarray
    """(3, k, runs) whether there was a plan."""
    plans: np.ndarray
    """(3, k, N + 1, 2) of the first run; where there was none, its state."""

    @classmethod
    def start(cls, params: UncertaintyParams) -> Self:
        """Before the first step."""
        count, N = round(params.count), round(params.N)
        nothing = np.zeros((3, 0, count))
        return cls(
            np.tile(params.start, (3, 1, count, 1)),
            nothing,
            nothing.astype(bool),
            np.zeros((3, 0, N + 1, 2)),
        )

    def append(
        self, x: np.ndarray, u: np.ndarray, planned: np.ndarray, plans: np.ndarray
    ) -> "DisturbedRuns":
        """A step later."""
        added = ((self.X, x), (self.U, u), (self.planned, planned), (self.plans, plans))
        return DisturbedRuns(*(np.concatenate([old, new[:, None]], axis=1) for old, new in added))

    @property
    def steps(self) -> int:
        return int(self.U.shape[1])


def simulate_runs(params: UncertaintyParams, chosen: Controllers) -> Iterator[DisturbedRuns | None]:
    """The runs after each step; None in the midst of one. Where there is no plan, u = K (x - the
    place nearest to the target where the plan may stay); no force is above its limit."""
    problem, K = chosen.problems[NOMINAL], chosen.K[0]
    w = sample_disturbances(params, problem.A + problem.B @ chosen.K, RUN_STEPS)
    rests = np.stack([np.minimum(chosen.final_position_limits, params.target), np.zeros(3)], axis=1)
    runs, prediction = DisturbedRuns.start(params), None
    for k in range(RUN_STEPS):
        x = runs.X[:, -1]
        prediction = yield from _predict(params, chosen, prediction)
        u = yield from _controls(chosen, x, prediction)
        planned = np.isfinite(u)
        plans = yield from _plans(chosen, x[:, 0], planned[:, 0], prediction)
        u = np.where(planned, u, (x - rests[:, None]) @ K)
        u = np.clip(u, -params.u_max, params.u_max)
        x = x @ problem.A.T + u[..., None] @ problem.B.T + w[k]
        runs = runs.append(x, u, planned, plans)
        yield runs


def _predict(
    params: UncertaintyParams, chosen: Controllers, last: Plan | None
) -> Resumable[Plan | None]:
    """The plan of stochastic MPC from where its nominal state came to, if that is what it plans
    from."""
    if params.source == "measured":
        return None
    start = params.start if last is None else last.X[1] if last.found else last.X[0]
    return (yield from chosen.planners[STOCHASTIC].plan(start, last))


def _controls(chosen: Controllers, x: np.ndarray, prediction: Plan | None) -> Resumable[np.ndarray]:
    """u (3, runs) of the states (3, runs, 2); NaN where there is no plan."""
    u = np.full(x.shape[:2], np.nan)
    u[NOMINAL] = (yield from chosen.planners[NOMINAL].values(x[NOMINAL])).u[:, 0]
    if prediction is None:
        u[STOCHASTIC] = (yield from chosen.planners[STOCHASTIC].values(x[STOCHASTIC])).u[:, 0]
    elif prediction.found:
        u[STOCHASTIC] = prediction.U[0, 0] + (x[STOCHASTIC] - prediction.X[0]) @ chosen.K[0]
    u[ROBUST] = (yield from chosen.tube_planner.values(x[ROBUST])).u[:, 0]
    return u


def _plans(
    chosen: Controllers, x: np.ndarray, planned: np.ndarray, prediction: Plan | None
) -> Resumable[np.ndarray]:
    """(3, N + 1, 2) nominal states planned from x (3, 2); where there is no plan, x."""
    plans = np.tile(x[:, None], (1, chosen.problems[NOMINAL].N + 1, 1))
    planners: tuple[Planner, ...] = (*chosen.planners, chosen.tube_planner)
    for i, planner in enumerate(planners):
        if planned[i]:
            if i == STOCHASTIC and prediction is not None:
                plan = prediction
            else:
                plan = yield from planner.plan(x[i], None)
            if plan.found:
                plans[i] = plan.X
    return plans
