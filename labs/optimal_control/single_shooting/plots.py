"""What the page of single shooting plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.algorithms.shooting_steps import SHOOTING_METHODS
from labs.optimal_control.single_shooting.control_changes import (
    CHANGE_FRACTIONS,
    changed_motions,
    final_states,
)
from labs.optimal_control.single_shooting.history import ShootingHistory
from labs.optimal_control.single_shooting.params import SingleShootingParams
from labs.optimal_control.single_shooting.plan import ShootingPlan
from labs.optimal_control.single_shooting.studies import (
    DIFFERENCE_STEPS,
    GRADIENT_METHODS,
    INTEGRATION_STEPS,
    TIMED_PIECES,
    AccuracyStudy,
)
from labs.plots import Curves, HeatMap, Line, Plot, Readout, TimeSeries, Trace

WITH_GRADIENT_STUDY, WITH_INTEGRATION_STUDY = {"study": ("gradients",)}, {"study": ("integration",)}

PLOTS: tuple[Plot, ...] = (
    HeatMap(
        "Sensitivities",
        "control_t",
        "state_t",
        "influence",
        "control uₖ, at [s]",
        "state xᵢ, at [s]",
        "log₁₀",
        gaps=True,
    ),
    Curves(
        "One control changes",
        "time [s]",
        "{shown} [{shown_unit}]",
        Trace("t", "planned", "as planned", "line"),
        Trace("t", "changed", "uₖ + δ, integrated", "line", 2),
        Trace("t", "forecast", "uₖ + δ, by dx/dy", "dash", 2),
        Trace("t", "opposite", "uₖ − δ, integrated", "line", 1),
    ),
    Curves(
        "End of the motion",
        "change of uₖ [u₀]",
        "{shown} at T [{shown_unit}]",
        Trace("change", "end", "integrated", "marked", 2),
        Trace("change", "end_forecast", "by dx/dy", "dash", 2),
        Trace("chosen_change", "chosen_end", "δ", "points", 3),
    ),
    Curves(
        "Effect of a control",
        "time [s]",
        "|dx/duₖ|, per u₀",
        Trace("state_times", "first_effect", "of the first", "line", 1),
        Trace("state_times", "chosen_effect", "of the chosen, k", "line", 2),
        Trace("state_times", "middle_effect", "of the one in the middle", "dash", 3),
        log_y=True,
    ),
    Curves(
        "Controls",
        "time [s]",
        "u [u₀]",
        Trace("stair_t", "stairs", "u {motor}", "line", 1),
        Trace("stair_t", "changed_stairs", "uₖ + δ", "dash", 2),
    ),
    Curves(
        "Convergence",
        "iteration",
        "",
        Trace("iterations", "costs", "cost J", "marked"),
        Trace("stepped", "residual", "optimality residual", "marked", 1),
        Trace("iterations", "violations", "constraint violation", "line", 2),
        Trace("stepped", "alpha", "step length α", "points", 3),
        log_y=True,
    ),
    Curves(
        "Error of the gradient",
        "step ε of the differences",
        "relative error",
        Trace(
            "eps", "gradient_errors", ("forward differences", "central differences"), "marked", 1
        ),
        Trace("eps_ends", "sensitivities_error", "sensitivities, from adjoint", "dash", 3),
        log_x=True,
        log_y=True,
        when=WITH_GRADIENT_STUDY,
    ),
    Curves(
        "Time of a gradient",
        "pieces N",
        "ms",
        Trace("sizes", "gradient_times", ("sensitivities", "adjoint", "differences"), "marked", 1),
        log_x=True,
        log_y=True,
        when=WITH_GRADIENT_STUDY,
    ),
    Curves(
        "Error of the state",
        "steps a piece M",
        "|x(T) − exact|",
        Trace(
            "steps", "state_errors", tuple(m.title for m in SHOOTING_METHODS.values()), "marked", 1
        ),
        log_x=True,
        log_y=True,
        when=WITH_INTEGRATION_STUDY,
    ),
    Curves(
        "Error of the cost",
        "steps a piece M",
        "relative error of J",
        Trace("steps", "cost_errors", ("augmented state (x, c)", "the notes' sum"), "marked", 1),
        log_x=True,
        log_y=True,
        when=WITH_INTEGRATION_STUDY,
    ),
    TimeSeries(
        "Position",
        "{q_unit}",
        Line("q", "q"),
        Line("q_plan", r"q^{\text{plan}}", "limit"),
        select="joint",
    ),
    TimeSeries("Control", "{u_unit}", Line("u", "u"), select="motor"),
    Readout("cost", "Cost J", ""),
    Readout("iteration", "Iterations", "", whole=True),
    Readout("missed", "Goal missed by", ""),
    Readout("first_effect", "Effect of the first control", ""),
    Readout("condition", "Condition number", ""),
    Readout("integration_error", "Plan off the simulation", ""),
    Readout("T", "Time T", "s"),
)


def iteration_fields(history: ShootingHistory) -> dict[str, np.ndarray]:
    """Numbers of all iterations so far."""
    return {
        "iterations": np.arange(len(history.cost), dtype=float),
        "stepped": np.arange(1.0, len(history.alpha) + 1.0),
        "costs": history.cost,
        "violations": history.violation,
        "residual": history.residual,
        "alpha": history.alpha,
    }


def sensitivity_fields(plan: ShootingPlan, chosen: int, grown: float) -> dict[str, np.ndarray]:
    """The map, its rows up to the part `grown` of the motion, and three of its columns."""
    N = plan.N
    times = np.linspace(0.0, plan.T, N + 1)
    shown = plan.influence.copy()
    shown[(plan.influence <= 0.0) | (times > grown * plan.T + 1e-9)[:, None]] = np.nan
    return {
        "control_t": times[:-1] + 0.5 * plan.T / N,
        "state_t": times,
        "influence": np.log10(shown),
        "state_times": times[1:],
        "first_effect": plan.influence[1:, 0],
        "chosen_effect": plan.influence[1:, min(chosen, N - 1)],
        "middle_effect": plan.influence[1:, N // 2],
    }


def change_fields(params: SingleShootingParams, plan: ShootingPlan) -> dict[str, np.ndarray]:
    """The joint that tells most, and where it ends, as the chosen control changes."""
    k, j = min(params.chosen_piece, plan.N - 1), params.task.shown
    changed = changed_motions(params.system, plan, k, params.delta)
    ends = final_states(params.system, plan, k)
    stairs = np.repeat(plan.U / params.task.u_0, 2, axis=0)
    after = stairs[:, params.task.motor].copy()
    after[2 * k : 2 * k + 2] += params.delta
    edges = np.linspace(0.0, plan.T, plan.N + 1)
    return {
        "t": np.linspace(0.0, plan.T, len(plan.X)),
        "planned": plan.X[:, j],
        "changed": changed.states[-1, :, j],
        "opposite": changed.states[CHANGE_FRACTIONS.index(-1.0), :, j],
        "forecast": changed.linear_prediction[:, j],
        "change": ends.changes,
        "end": ends.states[:, j],
        "end_forecast": ends.linear_prediction[:, j],
        "chosen_change": np.array([params.delta]),
        "chosen_end": changed.states[-1, -1:, j],
        "stair_t": np.repeat(edges, 2)[1:-1],
        "stairs": stairs,
        "changed_stairs": after,
    }


def study_fields(
    study: AccuracyStudy, seconds: Mapping[str, float | np.ndarray]
) -> dict[str, np.ndarray]:
    """Curves of what was measured besides; empty where it was not."""
    measured = len(study.gradient_errors) > 0
    times = [np.atleast_1d(seconds.get(way, np.zeros(0))) for way in GRADIENT_METHODS]
    same = study.sensitivities_error
    return {
        "eps": DIFFERENCE_STEPS[: len(study.gradient_errors)],
        "gradient_errors": study.gradient_errors,
        "eps_ends": DIFFERENCE_STEPS[[0, -1]] if measured else np.zeros(0),
        "sensitivities_error": np.full(2, same) if measured else np.zeros(0),
        "sizes": np.array(TIMED_PIECES[: len(times[0])], dtype=float),
        "gradient_times": 1e3 * np.stack(times, axis=1),
        "steps": np.array(INTEGRATION_STEPS[: len(study.state_errors)], dtype=float),
        "state_errors": study.state_errors,
        "cost_errors": study.cost_errors,
    }
