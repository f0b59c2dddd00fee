"""What the lab of TD(lambda) plots, and the curves, bars and maps behind it."""

from collections.abc import Mapping

import numpy as np

from labs.plots import Bars, Curves, HeatMap, Line, Note, Plot, Readout, TimeSeries, Trace
from labs.reinforcement_learning.td_lambda.params import TD_METHODS, TdLambdaParams
from labs.reinforcement_learning.td_lambda.sweep import (
    ALPHAS,
    SweepErrors,
    family_values,
    known_errors,
    sweep_parts,
)
from labs.reinforcement_learning.td_lambda.tasks import PredictionPlace

ORDER = ("first", "second")
SECOND = {"second": tuple(TD_METHODS)}
WALK, GRID = {"system": ("walk",)}, {"system": ("grid",)}
FAMILIES = {"method": ("n-step", "forward", "backward", "true-online")}
SHOWN_ERROR_RATIO = 1.1
"""Times the error of having learned nothing: curves end there."""


def _over_alpha(title: str, *traces: Trace) -> Curves:
    """With the error of having learned nothing, dashed."""
    untrained = Trace("ends", "untrained", "", "dash")
    return Curves(title, "step size α", "RMS error", *traces, untrained, gaps=True)


PLOTS: tuple[Plot, ...] = (
    _over_alpha(
        "Error for every n or λ",
        Trace("alphas", "family_errors", "{family}", series=1),
        Trace("here_alpha", "here_first", "as set", "points"),
    ),
    _over_alpha(
        "Error as set",
        Trace("alphas", "own", "{method}", "marked", series=1),
        Trace("here_alphas", "here", "", "points"),
    ),
    Bars("Eligibility traces", "trace", "e", "", names="states", when=WALK),
    HeatMap("Eligibility trace of each cell", "x", "y", "trace_map", "column", "row from below",
            "e", gaps=True, when=GRID),
    Bars("Weights of the n-step returns", "weights", "w", ""),
    Curves(
        "n-step returns of the first state",
        "steps n",
        "J",
        Trace("return_n", "returns", "n-step return", "marked", series=1),
        Trace("return_ends", "target", "its mean, by the weights", series=2),
        Trace("return_ends", "true_value", "true value", "dash"),
    ),
    Curves(
        "Value of each state",
        "state",
        "V",
        Trace("state", "true_values", "true value", "dash"),
        Trace("state", "values", "{method}", "marked", series=1),
        when=WALK,
    ),
    HeatMap("Value of each cell", "x", "y", "value_map", "column", "row from below", "V",
            gaps=True, when=GRID),
    TimeSeries("Error of the learners in the scene", "", Line("error", "e"), select="method"),
    Curves(
        "Difference of the two methods",
        "episodes",
        "largest |ΔV|",
        Trace("gap_ends", "largest", "largest true value", "dash"),
        Trace("episodes", "gaps", "difference", "marked", series=1),
        Trace("gap_ends", "rounding", "rounding", "dash", series=2),
        log_y=True,
        when=SECOND,
    ),
    Note("The world", "about", when=GRID),
    Readout("best_error", "Least error", ""),
    Readout("best_alpha", "at α =", ""),
    Readout("best_member", "at {member} =", "", when=FAMILIES),
    Readout("here_first", "Error, {first}", ""),
    Readout("here_second", "Error, {second}", "", when=SECOND),
    Readout("gap", "Difference of the two methods", "", when=SECOND),
    Readout("episodes", "Episodes", "", whole=True),
    Readout("changed_first", "Values changed, {first}", "", whole=True),
    Readout("changed_second", "Values changed, {second}", "", whole=True, when=SECOND),
)  # fmt: skip


def sweep_curves(params: TdLambdaParams, sweep: SweepErrors) -> dict[str, np.ndarray]:
    """Errors over step sizes, NaN where not measured yet or larger than shown."""
    parts, untrained = sweep_parts(params), params.place.initial_error
    here = known_errors(sweep, "here", parts["here"])
    members, methods = len(family_values(params.method)), len(params.methods)
    alpha = np.array([params.alpha])
    return {
        "alphas": ALPHAS,
        "family_errors": _error_columns(
            known_errors(sweep, "family", parts["family"]), members, untrained
        ),
        "own": _error_columns(known_errors(sweep, "own", parts["own"]), methods, untrained),
        "here_alpha": alpha[: len(here)],
        "here_first": _mask_large_errors(here[:1], untrained),
        "here_alphas": np.repeat(alpha, len(here)),
        "here": _mask_large_errors(here, untrained),
        "ends": ALPHAS[[0, -1]],
        "untrained": np.full(2, untrained),
    }


def sweep_numbers(params: TdLambdaParams, sweep: SweepErrors) -> dict[str, float]:
    """The errors as set, and the least of the family once it is complete."""
    parts = sweep_parts(params)
    here, family = (known_errors(sweep, part, parts[part]) for part in ("here", "family"))
    found = {f"here_{name}": float(error) for name, error in zip(ORDER, here, strict=False)}
    if len(family) == len(parts["family"].rules):
        member, at = divmod(int(family.argmin()), len(ALPHAS))
        found |= {"best_error": float(family.min()), "best_alpha": float(ALPHAS[at])}
        if len(family) > len(ALPHAS):
            found["best_member"] = float(family_values(params.method)[member])
    return found


def _error_columns(errors: np.ndarray, many: int, untrained: float) -> np.ndarray:
    """(A, many): a curve a column, from those measured so far, one curve after another."""
    full = np.full(many * len(ALPHAS), np.nan)
    full[: len(errors)] = _mask_large_errors(errors, untrained)
    return full.reshape(many, -1).T


def _mask_large_errors(errors: np.ndarray, untrained: float) -> np.ndarray:
    return np.where(errors <= SHOWN_ERROR_RATIO * untrained, errors, np.nan)


def gap_curves(place: PredictionPlace, gaps: np.ndarray, episodes: int) -> dict[str, np.ndarray]:
    """The differences of two methods after each of the last episodes, between the largest value
    there is and what rounding makes of it."""
    first = episodes - len(gaps) + 1
    largest = np.full(2, np.abs(place.task.truth).max())
    return {
        "episodes": np.arange(first, episodes + 1.0),
        "gaps": gaps,
        "gap_ends": np.array([first, max(episodes, first + 1.0)]),
        "largest": largest,
        "rounding": np.finfo(float).eps * largest,
    }


def place_maps(
    place: PredictionPlace, trace: np.ndarray, values: np.ndarray
) -> Mapping[str, np.ndarray]:
    """The traces and values (M, X): those of the walk's states, or on the map of the grid, seen
    from above; of the other, nothing."""
    inside = slice(1, -1) if place.world is None else slice(0)
    found = {
        "trace": trace[inside],
        "state": np.arange(1.0, len(trace[inside]) + 1),
        "true_values": place.task.truth[inside],
        "values": values[:, inside].T,
    }
    rows, columns = place.world.shape if place.world else (0, 0)
    for name, of in {"trace_map": trace, "value_map": values[0]}.items():
        found[name] = place.world.on_map(of, np.nan)[::-1] if place.world else np.zeros((0, 0))
    return found | {"x": np.arange(1.0, columns + 1), "y": np.arange(1.0, rows + 1)}
