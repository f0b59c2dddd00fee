"""Runs of the lab lqr and what tests ask of them."""

from collections.abc import Mapping

import numpy as np

from labs.lab import Inputs
from labs.optimal_control.lqr.lab import Lqr, LqrState
from labs.optimal_control.lqr.params import LqrParams
from labs.params import Value

LAB = Lqr()


def lqr_params(setting: Mapping[str, Value], **changes: Value) -> LqrParams:
    return LqrParams().change({**setting, **changes})


def states(
    params: LqrParams, seconds: float, inputs: Mapping[int, Inputs] | None = None
) -> list[LqrState]:
    """The states from t = 0 on, until trouble."""
    found = [LAB.init(params, np.random.default_rng(0))]
    for k in range(round(seconds / LAB.period)):
        found.append(LAB.step(params, (inputs or {}).get(k, Inputs()), found[-1]))
        if found[-1].trouble:
            break
    return found


def solved(params: LqrParams) -> LqrState:
    """At t = 0, when the study is over."""
    state = LAB.init(params, np.random.default_rng(0))
    for snapshot in LAB.solve(params, state):
        state = LAB.accept(params, state, snapshot)
    return state


def deviations(params: LqrParams, found: list[LqrState]) -> np.ndarray:
    """(k, nx)."""
    return np.asarray(np.array([s.x for s in found]) - params.linear_system.x_eq)


def largest_control(params: LqrParams, found: list[LqrState]) -> float:
    """[N; N m] the largest control."""
    return float(np.abs([s.u for s in found[1:]]).max())


def settling_time(x: np.ndarray, band: float) -> float:
    """[s] from when on |x| (k,) stays within the band."""
    return float(np.flatnonzero(np.abs(x) > band)[-1] + 1) * LAB.period


def closed_loop(params: LqrParams) -> np.ndarray:
    """|eigenvalues| of A + B K_0, ascending."""
    p = params.regulator.problem
    return np.asarray(np.sort(np.abs(np.linalg.eigvals(p.a + p.b @ params.regulator.gains[0]))))


def predicted_and_paid_cost(params: LqrParams, seconds: float) -> tuple[float, float]:
    """What x_0' P_0 x_0 promises and what is paid."""
    last = states(params, seconds)[-1]
    return last.predicted_cost, last.past_cost + last.stage_cost


def initial_state(params: LqrParams) -> LqrState:
    """At t = 0, without the study."""
    return LAB.init(params, np.random.default_rng(0))
