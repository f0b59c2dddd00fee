"""What model-free prediction plots, and the curves and maps behind it."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from labs.plots import Curves, HeatMap, Line, Plot, Readout, TimeSeries, Trace
from labs.reinforcement_learning.prediction.corners import UPDATE_KINDS
from labs.reinforcement_learning.prediction.params import PREDICTION_METHODS
from labs.reinforcement_learning.prediction.targets import sample_targets
from labs.reinforcement_learning.prediction.worlds import PredictionWorld
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.pendulum_table.table import PendulumGrid

ONLINE = {"study": ("online",)}
MAPPED = {"study": ("online",), "world": ("grid", "pendulum")}
BATCH = {"study": ("batch",)}
WALKED = {"study": ("batch",), "data": ("five", "nineteen")}
GIVEN = {"study": ("batch",), "data": ("predictor",)}
CORNER = {"study": ("corners",)}
MAP_AXES = ("{across}", "{up}")


def _method_traces(
    x: str, y: str, what: str = "", style: Literal["line", "dash"] = "line"
) -> tuple[Trace, ...]:
    """A curve of each method."""
    return tuple(
        Trace(x, f"{y}_{short}", f"{name}{what}", style, i)
        for i, (short, name) in enumerate(PREDICTION_METHODS.items(), 1)
    )


def _readouts(channel: str, label: str, when: Mapping[str, tuple[str, ...]]) -> tuple[Plot, ...]:
    return tuple(
        Readout(f"{channel}_{short}", f"{label}, {name}", "", when=when)
        for short, name in PREDICTION_METHODS.items()
    )


PLOTS: tuple[Plot, ...] = (
    Curves("RMS error", "episodes", "error", *_method_traces("episodes", "error"), when=ONLINE),
    Curves(
        "Estimates and truth",
        "{axis}",
        "V",
        Trace("along", "true_V", "truth", "points"),
        *_method_traces("along", "estimate"),
        *(
            Trace("beside", f"{edge}_{short}", "", "dash", i, optional=True)
            for i, short in enumerate(PREDICTION_METHODS, 1)
            for edge in ("low", "high")
        ),
        when=ONLINE,
    ),
    Curves(
        "Bias and spread",
        "episodes",
        "RMS over states",
        *_method_traces("episodes", "bias", ": bias"),
        *_method_traces("episodes", "spread", ": spread", "dash"),
        when=ONLINE,
    ),
    Curves(
        "Targets at the state looked at",
        "share of the samples [%]",
        "target",
        Trace("share_mc", "target_mc", "Monte Carlo, mean", series=1, note="mean_mc"),
        Trace("share_td", "target_td", "TD(0), mean", series=2, note="mean_td"),
        Trace("truth_x", "truth_y", "truth", "dash"),
        when=ONLINE,
    ),
    TimeSeries(
        "Walker's estimate of the state looked at",
        "",
        Line("walker_mc", r"V_{MC}"),
        Line("walker_td", r"V_{TD}"),
        Line("walker_true", r"V^\pi", "dash"),
        when=ONLINE,
    ),
    HeatMap("Error of Monte Carlo", "x", "y", "map_mc", *MAP_AXES, "|V − Vπ|", True, when=MAPPED),
    HeatMap("Error of TD(0)", "x", "y", "map_td", *MAP_AXES, "|V − Vπ|", True, when=MAPPED),
    Curves(
        "Two answers of one batch",
        "state",
        "V",
        *_method_traces("cells", "batch"),
        Trace("cells", "least_squares", "least squares", "points", 1),
        Trace("cells", "certainty", "certainty equivalence", "points", 2),
        Trace("batch_cells", "batch_truth", "truth", "dash", optional=True),
        when=BATCH,
    ),
    Curves(
        "Error over the size of the batch",
        "episodes",
        "error",
        *_method_traces("sizes", "answer"),
        when=WALKED,
    ),
    Curves(
        "Distance from the answer",
        "sweeps",
        "largest distance",
        *_method_traces("sweeps", "left"),
        log_y=True,
        when=BATCH,
    ),
    Curves(
        "Error over transitions looked at",
        "transitions",
        "RMS error",
        Trace("looked", "corner_error", UPDATE_KINDS, series=1),
        log_x=True,
        log_y=True,
        when=CORNER,
    ),
    Curves(
        "Values of the four",
        "state",
        "V",
        Trace("corner_cells", "corner_truth", "truth", "points"),
        Trace("corner_cells", "corner_V", UPDATE_KINDS, series=1),
        when=CORNER,
    ),
    Readout("trained", "Episodes of each learner", "", whole=True, when=ONLINE),
    *_readouts("error", "RMS error", ONLINE),
    *_readouts("bias", "Bias", ONLINE),
    *_readouts("spread", "Spread", ONLINE),
    Readout("walked", "Episodes of the walker", "", whole=True, when=ONLINE),
    *_readouts("V_A", "V(A)", GIVEN),
    *_readouts("misfit", "Misfit of what was paid", BATCH),
    *_readouts("residual", "Bellman error in the model", BATCH),
    *(Readout(f"error_{i}", f"Error, {c}", "", when=CORNER) for i, c in enumerate(UPDATE_KINDS)),
    *(
        Readout(f"looked_{i}", f"Transitions, {c}", "", whole=True, when=CORNER)
        for i, c in enumerate(UPDATE_KINDS)
    ),
)


def error_curves(training: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Error, bias and spread over episodes."""
    found = {"episodes": training["episodes"]}
    for name in ("error", "bias", "spread"):
        found |= {
            f"{name}_{short}": training[name][m] for m, short in enumerate(PREDICTION_METHODS)
        }
    return found


def estimate_curves(
    world: PredictionWorld, V: np.ndarray, spread: np.ndarray | None
) -> dict[str, np.ndarray]:
    """V (2, X) and the truth over some states, and the standard deviation (2, X), if given, as two
    lines beside."""
    some = world.states
    found = {"along": world.axis_positions, "true_V": world.truth[some]}
    for m, short in enumerate(PREDICTION_METHODS):
        found[f"estimate_{short}"] = V[m, some]
        if spread is not None:
            found["beside"] = world.axis_positions
            found[f"low_{short}"] = (V - spread)[m, some]
            found[f"high_{short}"] = (V + spread)[m, some]
    return found


def target_curves(
    world: PredictionWorld, x: int, V: np.ndarray, random: np.ndarray
) -> dict[str, np.ndarray]:
    """Targets at state x, sorted; those of TD(0) under the estimates V (X,)."""
    found = {"truth_x": np.array([0.0, 100.0]), "truth_y": np.full(2, world.truth[x])}
    targets = sample_targets(world.task, x, V, random)
    for short, of in zip(PREDICTION_METHODS, targets, strict=True):
        there = np.sort(of[np.isfinite(of)])
        found[f"target_{short}"] = there
        found[f"share_{short}"] = np.linspace(0.0, 100.0, len(there))
        found[f"mean_{short}"] = there.mean(keepdims=True) if len(there) else np.full(1, np.nan)
    return found


def error_maps(world: PredictionWorld, V: np.ndarray) -> dict[str, np.ndarray]:
    """|V - V^pi| of V (2, X), seen from above; of a walk, nothing."""
    off = np.abs(V - world.truth)
    names = [f"map_{short}" for short in PREDICTION_METHODS]
    place = world.place
    if isinstance(place, GridWorld):
        rows, columns = place.shape
        axes = {"x": np.arange(1.0, columns + 1), "y": np.arange(1.0, rows + 1)}
        maps = [place.on_map(np.where(world.mdp.terminal, np.nan, of), np.nan)[::-1] for of in off]
    elif isinstance(place, PendulumGrid):
        axes = {"x": place.angles, "y": place.velocities}
        maps = [np.where(world.mdp.terminal, np.nan, of).reshape(place.shape).T for of in off]
    else:
        return {}
    return axes | dict(zip(names, maps, strict=True))


def batch_curves(
    training: Mapping[str, np.ndarray], truth: np.ndarray | None
) -> dict[str, np.ndarray]:
    """What the first learner has come to, and how all of them came there."""
    inner = slice(1, -1)
    V, answers = training["V"][:, 0, inner], training["answers"][:, 0, inner]
    cells = np.arange(1.0, V.shape[1] + 1)
    found = {
        "cells": cells,
        "least_squares": answers[0],
        "certainty": answers[1],
        "sizes": training["sizes"],
        "sweeps": training["sweeps"],
    }
    if truth is not None:
        found |= {"batch_cells": cells, "batch_truth": truth[inner]}
    for m, short in enumerate(PREDICTION_METHODS):
        found[f"batch_{short}"] = V[m]
        found[f"answer_{short}"] = training["error"][m]
        found[f"left_{short}"] = training["left"][m]
    return found


def update_curves(training: Mapping[str, np.ndarray], truth: np.ndarray) -> dict[str, np.ndarray]:
    """Of the four kinds of update."""
    inner = slice(1, -1)
    return {
        "looked": training["looked"].T,
        "corner_error": training["error"].T,
        "corner_cells": np.arange(1.0, len(truth) - 1),
        "corner_truth": truth[inner],
        "corner_V": training["V"].mean(axis=1)[:, inner].T,
    }
