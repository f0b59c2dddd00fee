"""What the page of direct methods plots, and the fields behind it."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from labs.optimal_control.direct_methods.method_runs import MethodRuns
from labs.optimal_control.direct_methods.methods import SHORT_NAMES
from labs.plots import Bars, Curves, Matrix, Note, Plot, Readout, Trace
from labs.tasks.direct.plots import control_plot, position_plot

SERIES = (1, 2, 4)
"""Colours of the methods, near those of their robots."""
STRUCTURE_ROWS = (
    "variables",
    "constraints",
    "nonzeros of Jacobian",
    "nonzeros of Hessian",
    "iterations",
)


def _traces(x: str, y: str, style: Literal["line", "marked"] = "line") -> tuple[Trace, ...]:
    """One for each method, in its own colour."""
    return tuple(
        Trace(f"{x}_{name}", f"{y}_{name}", name, style, series)
        for name, series in zip(SHORT_NAMES, SERIES, strict=True)
    )


PLOTS: tuple[Plot, ...] = (
    Curves(
        "Constraint violation",
        "iteration",
        "largest of |c| and g",
        *_traces("iterations", "violation", "marked"),
        log_y=True,
    ),
    Curves("Motions planned", "time [s]", "{shown} [{shown_unit}]", *_traces("t", "q")),
    Matrix("Comparison", "comparison", r"\text{single, multiple, collocation}", rows="rows"),
    Curves("Cost", "iteration", "cost J", *_traces("iterations", "cost", "marked")),
    Curves(
        "Optimality",
        "iteration",
        "KKT residual",
        *_traces("stepped", "residual", "marked"),
        log_y=True,
    ),
    Curves("Controls planned", "time [s]", "u 1 [u₀]", *_traces("stair_t", "u")),
    Bars("Time of an iteration", "milliseconds", "t", "ms", gaps=True, names="methods"),
    Bars("Condition number", "condition", r"\log_{10} \kappa", "", gaps=True, names="methods"),
    Bars("Nonlinearity", "nonlinearity", r"\eta", "", names="methods"),
    Bars("Density", "density", r"\rho", "%", names="methods"),
    Note("How each fares", "verdicts"),
    position_plot("Position played"),
    control_plot("Control played"),
    *(Readout(f"iterations_{name}", f"Iterations, {name}", "", whole=True) for name in SHORT_NAMES),
    *(Readout(f"cost_{name}", f"Cost, {name}", "") for name in SHORT_NAMES),
    Readout("T", "Time T", "s", when={"objective": ("least-time",)}),
    Readout("missed", "Goal missed, feedback", "m"),
    Readout("missed_open", "Goal missed, open loop", "m"),
)


def method_readouts(race: MethodRuns) -> dict[str, float]:
    """Numbers of each method."""
    found = {}
    for name, at in race.items():
        found[f"iterations_{name}"] = float(at.history.iterations)
        found[f"cost_{name}"] = float(at.history.cost[-1])
        found[f"variables_{name}"] = float(at.structure.variables)
        found[f"nonzeros_{name}"] = float(at.structure.nonzeros)
    return found


def iteration_fields(race: MethodRuns) -> dict[str, np.ndarray]:
    """Numbers of all iterations so far."""
    found = {}
    for name, at in race.items():
        count = np.arange(len(at.history.cost), dtype=float)
        found[f"iterations_{name}"], found[f"stepped_{name}"] = count, count[1:]
        found[f"cost_{name}"], found[f"violation_{name}"] = at.history.cost, at.history.violation
        found[f"residual_{name}"] = at.history.residual
    return found


def plan_fields(race: MethodRuns, joint: int, u_0: np.ndarray) -> dict[str, np.ndarray]:
    """The motions planned, of the joint that tells most, broken where they do not join; and the
    first control, in its unit."""
    found = {}
    for name, at in race.items():
        motion = at.motion
        edges = np.repeat(motion.times, 2)[1:-1]
        found[f"t_{name}"] = found[f"stair_t_{name}"] = edges
        found[f"q_{name}"] = np.stack([motion.X[:-1], motion.ends], axis=1)[:, :, joint].ravel()
        found[f"u_{name}"] = motion.U[:, :, 0].ravel() / u_0[0]
    return found


def comparison_fields(
    race: MethodRuns, seconds: Mapping[str, float | np.ndarray]
) -> dict[str, np.ndarray]:
    """What the programmes are like, a column or a bar for each method."""
    all_of = [at.structure for at in race.values()]
    counts = [[s.variables, s.constraints, s.jacobian, s.hessian] for s in all_of]
    table = [[*row, at.history.iterations] for row, at in zip(counts, race.values(), strict=True)]
    condition = np.array([s.condition or np.nan for s in all_of])
    return {
        "comparison": np.array(table, dtype=float).T,
        "milliseconds": np.array([1e3 * float(seconds.get(name, np.nan)) for name in race]),
        "condition": np.log10(condition),
        "nonlinearity": np.array([s.nonlinearity for s in all_of]),
        "density": np.array([100.0 * s.density for s in all_of]),
    }
