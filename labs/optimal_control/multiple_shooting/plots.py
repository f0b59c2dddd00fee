"""What the page of multiple shooting plots, and the fields behind it."""

from itertools import pairwise

import numpy as np

from labs.optimal_control.multiple_shooting.structure import ShootingStructure
from labs.optimal_control.multiple_shooting.study import SegmentSweep
from labs.plots import Curves, HeatMap, Plot, Readout, Trace
from labs.tasks.direct.history import IterationHistory
from labs.tasks.direct.plan_params import LIGHT_SYSTEMS
from labs.tasks.direct.plots import control_plot, position_plot

ROUNDING = 1e-12
"""Constraints that are off by less are met: a logarithmic axis leaves that out."""
WITH_SEGMENT_STUDY = {"study": ("segments",), "system": LIGHT_SYSTEMS}

PLOTS: tuple[Plot, ...] = (
    Curves(
        "Gaps",
        "iteration",
        "|sᵢ₊₁ − xᵢ(tᵢ₊₁)|",
        Trace("iterations", "largest", "the largest gap", "marked"),
        Trace("iterations", "mean", "their mean", "line", 1),
        log_y=True,
    ),
    Curves(
        "Phase portrait",
        "{shown} [{shown_unit}]",
        "velocity [{shown_unit}/s]",
        Trace("arc_q", "arc_v", "", "line", 1),
        Trace("start_q", "start_v", "starts sᵢ", "points"),
    ),
    Curves(
        "Growth of a deviation",
        "time [s]",
        "|dx/ds|",
        Trace("whole_t", "whole", "from x₀ on: single shooting", "dash"),
        Trace("growth_t", "growth", "", "line", 1),
        log_y=True,
    ),
    HeatMap(
        "Sparsity",
        "column",
        "row",
        "pattern",
        "variable, multiplier",
        "equation",
        "1 L_zz, 2 c_z",
        downward=True,
    ),
    Curves(
        "Convergence",
        "iteration",
        "",
        Trace("iterations", "costs", "cost", "marked"),
        Trace("stepped", "residual", "optimality residual", "marked", 1),
        Trace("iterations", "violations", "constraint violation", "line", 2),
        Trace("stepped", "alpha", "step length α", "points", 3),
        log_y=True,
    ),
    HeatMap(
        "Gap by segment",
        "gap_iteration",
        "gap_t",
        "gap_sizes",
        "iteration",
        "where, at [s]",
        "log₁₀",
        gaps=True,
    ),
    Curves(
        "Iterations by segments",
        "segments m",
        "iterations",
        Trace("solved_m", "solved_iterations", "converged", "marked", 1),
        Trace("failed_m", "failed_iterations", "stopped without a solution", "points", 2),
        log_x=True,
        when=WITH_SEGMENT_STUDY,
    ),
    Curves(
        "Cost by segments",
        "segments m",
        "cost",
        Trace("solved_m", "solved_cost", "converged", "marked", 1),
        log_x=True,
        when=WITH_SEGMENT_STUDY,
    ),
    Curves(
        "Size by segments",
        "segments m",
        "",
        Trace("all_m", "all_variables", "variables", "marked", 1),
        Trace("all_m", "all_nonzeros", "nonzeros", "marked", 2),
        log_x=True,
        log_y=True,
        when=WITH_SEGMENT_STUDY,
    ),
    position_plot(),
    control_plot(),
    Readout("cost", "Cost J", ""),
    Readout("iteration", "Iterations", "", whole=True),
    Readout("largest_gap", "Largest gap", ""),
    Readout("variables", "Variables", "", whole=True),
    Readout("nonzeros", "Nonzeros", "", whole=True),
    Readout("density", "Density", "%"),
    Readout("growth", "Growth in a segment", ""),
    Readout("condition", "Condition number", ""),
    Readout("T", "Time T", "s"),
    Readout("missed", "Goal missed, feedback", "m"),
    Readout("missed_open", "Goal missed, open loop", "m"),
)


def iteration_fields(history: IterationHistory, cuts: np.ndarray) -> dict[str, np.ndarray]:
    """Numbers of all iterations so far, and every gap in each."""
    gaps = history.gaps[:, cuts[1:-1] - 1]
    shown = np.where(gaps > 0.0, np.log10(np.maximum(gaps, 1e-300)), np.nan)
    count = np.arange(len(history.cost), dtype=float)
    return {
        "iterations": count,
        "stepped": count[1:],
        "largest": gaps.max(axis=1, initial=0.0),
        "mean": gaps.mean(axis=1) if gaps.size else np.zeros(len(gaps)),
        "costs": history.cost,
        "violations": np.where(history.violation > ROUNDING, history.violation, 0.0),
        "residual": history.residual,
        "alpha": history.alpha,
        "gap_iteration": count,
        "gap_sizes": shown.T,
    }


def segment_fields(
    history: IterationHistory, at: ShootingStructure, T: float
) -> dict[str, np.ndarray]:
    """The segments in the phase plane, and what a deviation becomes in them."""
    h, phases = T / len(at.growth), history.phases[-1]
    between = list(pairwise(at.cuts))
    arcs = [phases[i:j].reshape(-1, 2) for i, j in between]
    growth = [np.concatenate([[1.0], at.growth[i:j]]) for i, j in between]
    times = [h * np.arange(i, j + 1) for i, j in between]
    arc_q, arc_v = (_pad_columns([arc[:, k] for arc in arcs]) for k in (0, 1))
    return {
        "arc_q": arc_q,
        "arc_v": arc_v,
        "start_q": arc_q[0],
        "start_v": arc_v[0],
        "gap_t": h * at.cuts[1:-1],
        "growth_t": _pad_columns(times),
        "growth": _pad_columns(growth),
        "whole_t": h * np.arange(len(at.growth) + 1),
        "whole": np.concatenate([[1.0], at.growth_whole]),
        "row": np.arange(len(at.pattern), dtype=float),
        "column": np.arange(len(at.pattern), dtype=float),
        "pattern": at.pattern,
    }


def study_fields(study: SegmentSweep) -> dict[str, np.ndarray]:
    """Curves over the number of segments; empty where none were compared."""
    good = study.converged
    return {
        "all_m": study.segments,
        "all_variables": study.variables,
        "all_nonzeros": study.nonzeros,
        "solved_m": study.segments[good],
        "solved_iterations": study.iterations[good],
        "solved_cost": study.cost[good],
        "failed_m": study.segments[~good],
        "failed_iterations": study.iterations[~good],
    }


def _pad_columns(curves: list[np.ndarray]) -> np.ndarray:
    """(points, k) of k curves, shorter ones resting at their end."""
    longest = max(len(curve) for curve in curves)
    return np.stack([np.pad(curve, (0, longest - len(curve)), "edge") for curve in curves], axis=1)
