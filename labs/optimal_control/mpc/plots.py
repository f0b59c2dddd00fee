"""What the page of model predictive control plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.optimal_control.mpc.history import PlanningHistory
from labs.optimal_control.mpc.params import MpcParams
from labs.plots import Bars, Curves, Line, Note, Plot, Readout, TimeSeries, Trace
from labs.problems.receding_horizon import Plan

PHASES = ("derivatives", "QP", "rest")
"""Of a plan, that are timed."""
TIMED_PLANS = 200
"""Plans whose durations are kept."""
MIN_SWING_UP_HORIZON = 0.6
"""[s] about so far a plan must look ahead to swing up the pole of a cart."""

PLOTS: tuple[Plot, ...] = (
    Curves(
        "Prediction and motion",
        "time [s]",
        "{shown} [{shown_unit}]",
        Trace("fan_t", "fan_q", "earlier plans", "dash"),
        Trace("ahead_t", "ahead_q", "plan", "line", 2),
        Trace("past_t", "past_q", "motion", "line", 1),
    ),
    TimeSeries(
        "Share of the control limit",
        "|u| / u_max",
        Line("share", "u"),
        Line("one", "1", "limit"),
        select="motor",
    ),
    TimeSeries(
        "Position", "{q_unit}", Line("q", "q"), Line("goal", "q^*", "limit"), select="joint"
    ),
    TimeSeries("Velocity", "{v_unit}", Line("v", "v"), select="joint"),
    TimeSeries(
        "Cost by term",
        "1/s",
        Line("cost_q", "w_q |q - q^*|^2 / 2"),
        Line("cost_v", "w_v |v|^2 / 2"),
        Line("cost_u", "w_u |u - g(q^*)|^2 / 2"),
        stacked=True,
    ),
    TimeSeries(
        "Cost of the plan", "", Line("value", "V_N(x)"), Line("paid", r"\text{paid}", "dash")
    ),
    Bars("Limits active along the plan", "active_steps", "steps", "", names="limits"),
    Curves(
        "Time of a plan",
        "plan",
        "ms",
        Trace("plans", "durations", PHASES, "line", 1),
        Trace("plans", "deadline", "one period", "dash"),
        log_y=True,
    ),
    TimeSeries("Tip off the target", "m", Line("miss", "|p - p^*|")),
    TimeSeries("Control", "{u_unit}", Line("u", "u"), select="motor"),
    Note("What the controller says", "said"),
    Readout("promised", "Cost of the first plan", ""),
    Readout("over_horizon", "Paid over its horizon", ""),
    Readout("miss", "Tip off the target", "m"),
    Readout("off_first", "Off the first plan", "rad"),
    Readout("value", "Cost of the plan", ""),
    Readout("paid", "Cost paid", ""),
    Readout("active", "Limits active in the plan", "", whole=True),
    Readout("exceeded", "Beyond a limit", ""),
    Readout("gap", "Gap of the plan", ""),
    Readout("iterations", "Iterations of the period", "", whole=True),
    Readout("failures", "Periods without a plan", "", whole=True),
)


def prediction_fields(history: PlanningHistory, t: float, joint: int) -> dict[str, np.ndarray]:
    """The joint that is shown: the motion so far, what is predicted, and what was."""
    past = history.past[:, joint]
    found = {
        "past_t": t - 0.01 * np.arange(len(past) - 1, -1, -1.0),
        "past_q": past,
        "ahead_t": np.zeros(0),
        "ahead_q": np.zeros(0),
    }
    if history.latest:
        found |= {"ahead_t": history.latest.times, "ahead_q": history.latest.X[:, joint]}
    # One line for all: out to the end of each prediction, back, and on to the next.
    out_and_back = [(old.times, old.X[:, joint]) for old in history.predictions]
    fan_t = [part for t, _ in out_and_back for part in (t, t[::-1])]
    fan_q = [part for _, q in out_and_back for part in (q, q[::-1])]
    return found | {
        "fan_t": np.concatenate([np.zeros(0), *fan_t]),
        "fan_q": np.concatenate([np.zeros(0), *fan_q]),
    }


def limit_fields(plan: Plan | None, params: MpcParams) -> dict[str, np.ndarray]:
    """At how many steps of the plan each limit of position, velocity and control is active."""
    at = params.robot
    if plan is None:
        return {"active_steps": np.zeros(2 * at.n + len(at.u_0))}
    rows = [plan.active[kind].sum(axis=0) for kind in ("position", "velocity", "control")]
    return {"active_steps": np.concatenate(rows).astype(float)}


def time_fields(seconds: Mapping[str, float | np.ndarray], h: float) -> dict[str, np.ndarray]:
    """The time [ms] that each phase of the last plans took."""
    spent = np.stack([np.atleast_1d(seconds.get(phase, np.zeros(0))) for phase in PHASES], axis=1)
    count = len(spent)
    return {
        "plans": np.arange(1.0 - count, 1.0),
        "durations": 1e3 * spent,
        "deadline": np.full(count, 1e3 * h),
    }


def time_note(seconds: Mapping[str, float | np.ndarray], h: float) -> str:
    """Of the last plans: how long they took, what part of the period, how many took longer."""
    spent = [np.atleast_1d(seconds.get(phase, np.zeros(0))) for phase in PHASES]
    total = np.sum(spent, axis=0)
    if not len(total):
        return "No plan has been timed yet."
    parts = ", ".join(
        f"{phase} {1e3 * np.median(part):.2f}" for phase, part in zip(PHASES, spent, strict=True)
    )
    late, median = int((total > h).sum()), float(np.median(total))
    return (
        f"A plan takes {1e3 * median:.2f} ms ({parts}), {100 * median / h:.0f} % of the period. "
        f"Of the last {len(total)}, {late} missed the deadline."
    )


def horizon_note(params: MpcParams) -> str:
    """Whether plans look too short a time ahead for what they are to do; empty if not."""
    ahead = params.N * params.h
    if params.system != "cart-pole" or ahead > MIN_SWING_UP_HORIZON - 0.5 * params.h:
        return ""
    return (
        f"Plans look {ahead:.2f} s ahead, too short a time to swing up the pole: give them "
        f"{MIN_SWING_UP_HORIZON} s or more, by a period of 20 ms or by more steps."
    )
