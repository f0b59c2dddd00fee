"""What the page of DDP plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.optimal_control.ddp.history import DdpHistory
from labs.plots import Curves, Line, Plot, Readout, TimeSeries, Trace
from labs.tasks.motion.playback import NominalTrajectory

PHASES = ("derivatives", "backward", "forward")
"""Of an iteration, that are timed."""
EARLIER = (8, 4, 2)
"""Iterations ago whose motions the phase portrait shows, too."""

PLOTS: tuple[Plot, ...] = (
    Curves(
        "Cost",
        "iteration",
        "cost",
        Trace("iterations", "cost", "J", "marked"),
        Trace("stepped", "expected", "expected improvement", "line", 1),
        Trace("stepped", "actual", "actual improvement", "points", 2),
        log_y=True,
    ),
    Curves(
        "Line search and regularisation",
        "iteration",
        "",
        Trace("stepped", "alpha", "α", "points", 1),
        Trace("stepped", "mu", "μ", "marked", 2),
        Trace("stepped", "gradient", "max |dJ/dU|", "line"),
        log_y=True,
    ),
    TimeSeries(
        "Position",
        "{q_unit}",
        Line("q", "q"),
        Line("q_open", r"q^{\text{open}}", "dash"),
        Line("q_plan", r"\bar q", "limit"),
        select="joint",
    ),
    TimeSeries(
        "Control",
        "{u_unit}",
        Line("u", r"u = \bar u + K (x - \bar x)"),
        Line("u_plan", r"\bar u", "limit"),
        select="motor",
    ),
    Curves(
        "Phase portrait",
        "angle [rad]",
        "velocity [rad/s]",
        Trace(
            "earlier_angles",
            "earlier_velocities",
            tuple(f"{i} before" for i in EARLIER),
            "line",
            2,
        ),
        Trace("angle", "velocity", "this iteration", "line", 1),
        Trace("played_angle", "played_velocity", "played with feedback", "dash"),
    ),
    Curves(
        "Gains of the first motor",
        "time in the motion [s]",
        "gain",
        Trace("plan_t", "gain_q", "∂u₁/∂q{}", "line", 1),
        Trace("plan_t", "gain_v", "∂u₁/∂v{}", "dash", 1),
    ),
    Curves(
        "Time of an iteration",
        "iteration",
        "ms",
        Trace("timed", "durations", PHASES, "line", 1),
        log_y=True,
    ),
    TimeSeries(
        "Velocity",
        "{v_unit}",
        Line("v", "v"),
        Line("v_open", r"v^{\text{open}}", "dash"),
        Line("v_plan", r"\bar v", "limit"),
        select="joint",
    ),
    Readout("cost", "Cost J of the plan", ""),
    Readout("iteration", "Iterations", "", whole=True),
    Readout("paid", "Cost paid with feedback", ""),
    Readout("paid_open", "Cost paid in open loop", ""),
    Readout("missed", "Tip off the goal, feedback", "m"),
    Readout("missed_open", "Tip off the goal, open loop", "m"),
)


def iteration_fields(
    history: DdpHistory, seconds: Mapping[str, float | np.ndarray]
) -> dict[str, np.ndarray]:
    """Numbers of all iterations so far, with the time [ms] each phase took."""
    spent = [np.atleast_1d(seconds.get(phase, np.zeros(0))) for phase in PHASES]
    return {
        "iterations": np.arange(len(history.cost), dtype=float),
        "stepped": np.arange(1.0, len(history.alpha) + 1.0),
        "cost": history.cost,
        "expected": -history.expected,
        "actual": -history.actual,
        "alpha": history.alpha,
        "mu": history.mu,
        "gradient": history.gradient,
        "timed": np.arange(1.0, len(spent[0]) + 1.0),
        "durations": 1e3 * np.stack(spent, axis=1),
    }


def portrait_fields(history: DdpHistory, played: np.ndarray, joint: int) -> dict[str, np.ndarray]:
    """Angle and velocity of a joint, in this iteration and in earlier ones, and as played so far:
    `played` (k, nx)."""
    angle, velocity = history.phase_paths[-1].T
    earlier = np.stack([history.phase_paths[-1 - i] for i in EARLIER], axis=2)
    return {
        "angle": angle,
        "velocity": velocity,
        "earlier_angles": earlier[:, 0],
        "earlier_velocities": earlier[:, 1],
        "played_angle": played[:, joint],
        "played_velocity": played[:, played.shape[1] // 2 + joint],
    }


def plan_gain_fields(plan: NominalTrajectory) -> dict[str, np.ndarray]:
    """The gains of the first motor by angles and velocities of the first joints, two at most."""
    n = plan.X.shape[1] // 2
    shown = np.arange(min(n, 2))
    return {
        "plan_t": plan.h * np.arange(plan.N),
        "gain_q": plan.K[:, 0, shown],
        "gain_v": plan.K[:, 0, n + shown],
    }
