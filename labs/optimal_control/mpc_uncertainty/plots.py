"""What the page of MPC under uncertainty plots, and the fields behind it."""

from typing import Literal

import numpy as np

from labs.optimal_control.mpc_uncertainty.controllers import (
    CONTROL_PERIOD,
    CONTROLLER_NAMES,
    NOMINAL,
    ROBUST,
    STOCHASTIC,
    Controllers,
)
from labs.optimal_control.mpc_uncertainty.params import UncertaintyParams
from labs.optimal_control.mpc_uncertainty.runs import RUN_STEPS, DisturbedRuns
from labs.optimal_control.mpc_uncertainty.statistics import (
    ARRIVAL_STEP,
    Counts,
    confidence_interval,
)
from labs.plots import Bars, Curves, Note, Plot, Readout, Trace
from labs.resumable import run_to_completion

Style = Literal["line", "marked", "points", "dash"]
SERIES = (1, 2, 4)
"""Colours of the three, near those of the scene."""
CENTIMETRES = PERCENT = 100.0


def controller_traces(
    x: str, y: str, style: Style = "line", named: bool = True
) -> tuple[Trace, ...]:
    """A trace of each, where {} stands for its name."""
    return tuple(
        Trace(x.format(name), y.format(name), name if named else "", style, series)
        for name, series in zip(CONTROLLER_NAMES, SERIES, strict=True)
    )


PLOTS: tuple[Plot, ...] = (
    Curves(
        "Beyond the wall",
        "time [s]",
        "runs [%]",
        *controller_traces("times", "beyond_{}"),
        Trace("all_times", "promised_share", "promised", "dash"),
        Trace("all_times", "least", "", "dash", 7),
        Trace("all_times", "most", "95 % interval", "dash", 7),
    ),
    Curves(
        "Position at the wall",
        "time [s]",
        "beyond the wall [cm]",
        *controller_traces("held_times", "farthest_{}"),
        *controller_traces("held_times", "mean_{}", "dash", named=False),
        Trace("held_times", "wall", "wall", "dash"),
    ),
    Bars("Distance kept", "distance", r"p_{max} - \bar p", "cm", names="controllers"),
    Bars("Runs ever beyond", "ever", r"n/n_{runs}", "%", names="controllers"),
    Bars("Cost paid", "cost", "J", "", names="controllers"),
    Curves(
        "Feasible sets",
        "p [m]",
        "v [m/s]",
        *controller_traces("feasible_p_{}", "feasible_v_{}"),
        Trace("start_p", "start_v", "start", "points"),
    ),
    Curves(
        "Margin at the wall",
        "step of the plan",
        "margin [cm]",
        *controller_traces("planned_steps", "margin_{}", "marked"),
    ),
    Note("Promise and count", "promise"),
    Readout("risk", "Promised at most", "%"),
    Readout("held_stochastic", "Beyond, stochastic", "%"),
    Readout("held_nominal", "Beyond, nominal", "%"),
    Readout("held_robust", "Beyond, robust", "%"),
    Readout("unplanned_nominal", "No plan, nominal", "%"),
    Readout("unplanned_robust", "No plan, robust", "%"),
)


def design_fields(params: UncertaintyParams, chosen: Controllers) -> dict[str, np.ndarray]:
    """What the three controllers plan with."""
    sets: dict[str, np.ndarray] = {}
    for name, corners in zip(CONTROLLER_NAMES, chosen.feasible, strict=True):
        closed = np.vstack([corners, corners[:1]])
        sets |= {f"feasible_p_{name}": closed[:, 0], f"feasible_v_{name}": closed[:, 1]}
    margins = CENTIMETRES * chosen.margins()
    return (
        sets
        | _controller_fields("margin", margins)
        | {
            "planned_steps": np.arange(float(margins.shape[1])),
            "start_p": params.start[:1],
            "start_v": params.start[1:],
        }
    )


def run_fields(
    params: UncertaintyParams, runs: DisturbedRuns, counts: Counts
) -> dict[str, np.ndarray]:
    """What happened, and what was promised."""
    low, high = confidence_interval(params)
    whole, ones = np.array([0.0, RUN_STEPS * CONTROL_PERIOD]), np.ones(2)
    arrived = min(ARRIVAL_STEP, runs.steps)
    away = CENTIMETRES * (runs.X[:, arrived:, :, 0] - params.wall)
    times = CONTROL_PERIOD * np.arange(runs.steps + 1.0)
    return (
        _controller_fields("beyond", PERCENT * counts.beyond)
        | _controller_fields("mean", away.mean(axis=2))
        | _controller_fields("farthest", away.max(axis=2))
        | {
            "times": times,
            "held_times": times[arrived:],
            "all_times": whole,
            "promised_share": (100.0 - params.probability) * ones,
            "least": PERCENT * low * ones,
            "most": PERCENT * high * ones,
            "wall": np.zeros(len(times) - arrived),
            "ever": PERCENT * counts.ever,
            "cost": counts.cost,
            "distance": CENTIMETRES * counts.distance,
        }
    )


def _controller_fields(what: str, rows: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{what}_{name}": row for name, row in zip(CONTROLLER_NAMES, rows, strict=True)}


def run_readouts(
    params: UncertaintyParams, runs: DisturbedRuns, counts: Counts
) -> dict[str, float]:
    """Shares [%] of the runs beyond the wall, once they have arrived, and of plans not found."""
    shown = {"risk": 100.0 - params.probability}
    if runs.steps < RUN_STEPS:
        return shown
    held, unplanned = PERCENT * counts.held, PERCENT * counts.unplanned
    shown |= {f"held_{name}": float(held[i]) for i, name in enumerate(CONTROLLER_NAMES)}
    return shown | {
        "unplanned_nominal": float(unplanned[NOMINAL]),
        "unplanned_robust": float(unplanned[ROBUST]),
    }


def guarantee_note(
    params: UncertaintyParams, chosen: Controllers, runs: DisturbedRuns, counts: Counts
) -> str:
    """What was promised, and what was counted."""
    if runs.steps < RUN_STEPS:
        return "The runs are not complete yet."
    total = round(params.count)
    low, high = (share * total for share in confidence_interval(params))
    end = round(counts.beyond[STOCHASTIC, -1] * total)
    ever = [round(share * total) for share in counts.ever]
    robust = f"Robust MPC promises all steps, for w in W: {ever[ROBUST]} have been beyond."
    if counts.unplanned[ROBUST] == 1.0:
        why = run_to_completion(chosen.tube_planner.plan(params.start, None)).message
        robust = f"Robust MPC promises nothing. {why}"
    return "\n".join(
        (
            f"Nominal MPC promises nothing: {ever[NOMINAL]} of {total} have been beyond the wall.",
            f"Stochastic MPC promises {params.probability:g} % at each step. At the end {end} are "
            f"beyond; {low:.0f} to {high:.0f} would be usual. At some step {ever[STOCHASTIC]} have "
            "been: of that it says nothing.",
            robust,
        )
    )


def outcome_message(params: UncertaintyParams, counts: Counts) -> str:
    """Why the solver stopped, with what went wrong."""
    said = f"{round(params.count)} runs of {RUN_STEPS} steps under each controller."
    for name, share in zip(CONTROLLER_NAMES, counts.unplanned, strict=True):
        if share == 1.0:
            said += f" {name.capitalize()} MPC finds no plan: see Feasible sets."
    return said
