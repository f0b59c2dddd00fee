"""What the page of collocation plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.algorithms.collocation_schemes import SCHEMES
from labs.optimal_control.collocation.structure import SparsityPattern, cell_starts, log_magnitudes
from labs.optimal_control.collocation.studies import ConvergenceStudy, slopes
from labs.optimal_control.collocation.transcription import Costates
from labs.plots import Curves, HeatMap, Line, Plot, Readout, TimeSeries, Trace
from labs.tasks.direct.history import IterationHistory
from labs.tasks.direct.player import DirectState
from labs.tasks.direct.plots import control_plot, position_plot
from labs.tasks.motion.playback import FEEDBACK, OPEN_LOOP

WITH_ORDER_STUDY, WITH_SIZE_STUDY = {"study": ("order",)}, {"study": ("sizes",)}
EARLIER = (4, 2, 1)
"""Iterations ago whose gaps are shown, too."""
LINEAR_SOLVES = ("full matrix", "sparse matrix")

PLOTS: tuple[Plot, ...] = (
    Curves(
        "Gaps",
        "time [s]",
        "|defect of a step|",
        Trace("gap_t", "first_gaps", "first guess", "dash"),
        Trace("gap_t", "earlier_gaps", tuple(f"{i} before" for i in EARLIER), "line", 2),
        Trace("gap_t", "gaps", "now", "marked", 1),
        log_y=True,
    ),
    Curves(
        "Motion",
        "time [s]",
        "{shown} [{shown_unit}]",
        Trace("ends_t", "ends_q", "where a step leads", "points", 2),
        Trace("states_t", "states_q", "states s", "points", 1),
        Trace("played_t", "played_q", ("played with feedback", "open loop"), "line", 3),
    ),
    HeatMap(
        "Jacobian of the constraints",
        "jacobian_columns",
        "jacobian_rows",
        "jacobian",
        "variable",
        "constraint",
        "log₁₀",
        gaps=True,
        downward=True,
    ),
    HeatMap(
        "Hessian of the Lagrangian",
        "hessian_places",
        "hessian_places",
        "hessian",
        "variable",
        "variable",
        "log₁₀",
        gaps=True,
        downward=True,
    ),
    Curves(
        "Convergence",
        "iteration",
        "",
        Trace("iterations", "largest_gaps", "largest gap", "marked", 1),
        Trace("stepped", "residual", "optimality residual", "marked", 2),
        Trace("iterations", "violations", "constraints missed by", "dash", 1),
        Trace("iterations", "costs", "cost J", "line"),
        Trace("stepped", "alpha", "step α", "points", 3),
        log_y=True,
    ),
    Curves(
        "Error over N",
        "steps N",
        "relative error of J",
        Trace(
            "order_steps",
            "errors",
            tuple(scheme.title for scheme in SCHEMES.values()),
            "marked",
            1,
            note="orders",
        ),
        log_x=True,
        log_y=True,
        when=WITH_ORDER_STUDY,
    ),
    Curves(
        "Time of a Newton step",
        "steps N",
        "ms",
        Trace("sizes", "solve_times", LINEAR_SOLVES, "marked", 1, note="time_slopes"),
        log_x=True,
        log_y=True,
        when=WITH_SIZE_STUDY,
    ),
    Curves(
        "Entries of its matrix",
        "steps N",
        "entries",
        Trace("sizes", "entries", ("all", "not zero"), "marked", 1, note="entry_slopes"),
        log_x=True,
        log_y=True,
        when=WITH_SIZE_STUDY,
    ),
    Curves(
        "Controls",
        "time [s]",
        "u [u₀]",
        Trace("control_t", "controls", "u {motor}", "line", 1),
    ),
    Curves(
        "Multipliers and costates",
        "time [s]",
        "∂J/∂x",
        Trace("lam_t", "lam_q", "−λ, of {shown}", "points", 1),
        Trace("costate_t", "p_q", "p, of {shown}", "line", 1),
        Trace("lam_t", "lam_v", "−λ, of its velocity", "points", 2),
        Trace("costate_t", "p_v", "p, of its velocity", "line", 2),
    ),
    Curves(
        "Phase portrait",
        "{shown} [{shown_unit}]",
        "velocity [{shown_unit}/s]",
        Trace("before_q", "before_v", "iteration before", "line"),
        Trace("ends_q", "ends_v", "where a step leads", "points", 2),
        Trace("states_q", "states_v", "states s", "points", 1),
        Trace("played_q0", "played_v0", "played with feedback", "line", 3),
    ),
    position_plot(),
    TimeSeries(
        "Velocity",
        "{v_unit}",
        Line("v", "v"),
        Line("v_open", r"v^{\text{open}}", "dash"),
        Line("v_plan", r"v^{\text{plan}}", "limit"),
        select="joint",
    ),
    control_plot(),
    Readout("iteration", "Iterations", "", whole=True),
    Readout("cost", "Cost J", ""),
    Readout("largest_gap", "Largest gap", ""),
    Readout("violation", "Constraints missed by", ""),
    Readout("T", "Time T", "s"),
    Readout("variables", "Variables", "", whole=True),
    Readout("constraints", "Constraints", "", whole=True),
    Readout("nonzeros", "Nonzeros of the Jacobian", "", whole=True),
    Readout("density", "Density of the Jacobian", "%"),
    Readout("hessian_density", "Density of the Hessian", "%"),
    Readout("order", "Order of the rule", "", when=WITH_ORDER_STUDY),
    Readout("missed", "Goal missed, feedback", "m"),
    Readout("missed_open", "Goal missed, open loop", "m"),
)


def iteration_fields(history: IterationHistory, T: float) -> dict[str, np.ndarray]:
    """Gaps over time now and before, and numbers of all iterations so far."""
    pieces, last = history.gaps.shape[1], history.iterations
    return {
        "gap_t": (np.arange(pieces) + 0.5) * T / pieces,
        "first_gaps": history.gaps[0],
        "earlier_gaps": history.gaps[[max(last - i, 0) for i in EARLIER]].T,
        "gaps": history.gaps[-1],
        "iterations": np.arange(last + 1.0),
        "stepped": np.arange(1.0, last + 1.0),
        "largest_gaps": history.gaps.max(axis=1),
        "violations": history.violation,
        "costs": history.cost,
        "residual": history.residual,
        "alpha": history.alpha,
    }


def motion_fields(
    state: DirectState, joint: int, control_scale: np.ndarray
) -> dict[str, np.ndarray]:
    """States, where steps lead, controls, and what has been played."""
    motion, plan, playback = state.motion, state.plan, state.playback
    k, n = playback.clock // plan.substeps, playback.x.shape[1] // 2
    played = np.concatenate([playback.X[:, :k], playback.x[:, None]], axis=1)
    times = motion.times
    before = state.history.phases[-2].reshape(-1, 2)
    return {
        "states_t": times,
        "states_q": motion.X[:, joint],
        "states_v": motion.X[:, n + joint],
        "ends_t": times[1:],
        "ends_q": motion.ends[:, joint],
        "ends_v": motion.ends[:, n + joint],
        "before_q": before[:, 0],
        "before_v": before[:, 1],
        "played_t": plan.h * np.arange(played.shape[1]),
        "played_q": played[[FEEDBACK, OPEN_LOOP], :, joint].T,
        "played_q0": played[FEEDBACK, :, joint],
        "played_v0": played[FEEDBACK, :, n + joint],
        "control_t": np.repeat(times, 2)[1:-1],
        "controls": motion.U.reshape(-1, len(control_scale)) / control_scale,
    }


def structure_fields(structure: SparsityPattern) -> dict[str, np.ndarray]:
    """Both maps, with the numbers of rows and columns from 1."""
    rows, columns = structure.jacobian.shape
    return {
        "jacobian": log_magnitudes(structure.jacobian),
        "jacobian_rows": cell_starts(rows, structure.constraints),
        "jacobian_columns": cell_starts(columns, structure.variables),
        "hessian": log_magnitudes(structure.hessian),
        "hessian_places": cell_starts(len(structure.hessian), structure.variables),
    }


def costate_fields(found: Costates, joint: int) -> dict[str, np.ndarray]:
    """Of the joint that tells most."""
    n = found.costate.shape[1] // 2
    return {
        "lam_t": found.times,
        "lam_q": found.multipliers[:, joint],
        "lam_v": found.multipliers[:, n + joint],
        "costate_t": found.grid,
        "p_q": found.costate[:, joint],
        "p_v": found.costate[:, n + joint],
    }


def study_fields(
    study: ConvergenceStudy, seconds: Mapping[str, float | np.ndarray]
) -> dict[str, np.ndarray]:
    """Curves of what was measured besides; empty where it was not."""
    dense, sparse = (np.atleast_1d(seconds.get(way, np.zeros(0))) for way in ("dense", "sparse"))
    times = np.stack([dense, sparse], axis=1)
    timed = study.sizes[: len(times)]
    return {
        "order_steps": study.steps,
        "errors": study.errors,
        "orders": study.orders,
        "sizes": timed,
        "solve_times": 1e3 * times[: len(timed)],
        "time_slopes": slopes(timed, times[: len(timed)]),
        "entries": study.entries[: len(timed)],
        "entry_slopes": slopes(timed, study.entries[: len(timed)]),
    }
