"""The plots of a Lyapunov function, and what they show."""

from collections.abc import Mapping

import numpy as np

from labs.appendix.lyapunov.analysis import NODES, LyapunovAnalysis
from labs.appendix.lyapunov.params import LyapunovParams
from labs.appendix.lyapunov.state_ensemble import RUN_STEPS, StateEnsemble
from labs.plots import Curves, HeatMap, Line, Note, Readout, TimeSeries, Trace

PLOTS = (
    Curves(
        "Distance and its bound",
        "step k",
        "|xₖ| / |x₀|",
        Trace("k", "farthest", "farthest run", series=1),
        Trace("k", "median", "median run", series=2),
        Trace("k_bound", "bound", "c γᵏ", "dash", optional=True),
        log_y=True,
    ),
    Curves(
        "V along the runs",
        "step k",
        "V(xₖ) / V(x₀)",
        Trace("k", "V_most", "largest", series=1),
        Trace("k", "V_median", "median", series=2),
        Trace("k_bound", "V_bound", "(1 − α₃/α₂)ᵏ", "dash", optional=True),
        log_y=True,
    ),
    HeatMap(
        "Change of V in a step",
        "map_q",
        "map_v",
        "map_change",
        "{q_name}",
        "{v_name}",
        "(V(f(x)) − V(x)) / |V(x)|",
        gaps=True,
    ),
    TimeSeries("V of the body", "", Line("body_V", "V(x)")),
    Note("Conditions", "conditions"),
    Readout("level_max", "Largest level", ""),
    Readout("alpha_1", "α₁", ""),
    Readout("alpha_2", "α₂", ""),
    Readout("alpha_3", "α₃", ""),
    Readout("c", "Factor c", ""),
    Readout("gamma", "Rate γ", ""),
    Readout("left", "Have left the set", "", whole=True),
    Readout("decreasing", "V decreases in", "%"),
    Readout("covered", "Largest set covers", "%"),
)
MAP_STRIDE = 2
"""The map shows every second node."""
LARGEST_CHANGE = 1.0
"""In parts of V; what is larger is shown as this."""
SMALLEST_RATIO = 1e-12


def run_fields(
    runs: StateEnsemble | None, found: LyapunovAnalysis | None
) -> Mapping[str, np.ndarray]:
    """The runs against what the constants promise."""
    none = np.empty(0)
    fields = dict.fromkeys(("k", "farthest", "median", "V_most", "V_median"), none)
    fields |= _bound_fields(found)
    if runs is None or found is None or runs.k < 0:
        return fields
    distances, V = (
        np.maximum(some / np.where(some[0] == 0.0, 1.0, some[0]), SMALLEST_RATIO)
        for some in (runs.distances, runs.V)
    )
    return fields | {
        "k": np.arange(runs.k + 1.0),
        "farthest": distances.max(axis=1),
        "median": np.median(distances, axis=1),
        "V_most": V.max(axis=1),
        "V_median": np.median(V, axis=1),
    }


def _bound_fields(found: LyapunovAnalysis | None) -> dict[str, np.ndarray]:
    """Not known yet it is empty; where V is no Lyapunov function there is nothing."""
    if found is None:
        return dict.fromkeys(("k_bound", "bound", "V_bound"), np.empty(0))
    constants, k = found.constants, np.arange(RUN_STEPS + 1.0)
    if not constants.holds:
        return {}
    rate = 1.0 - constants.alpha_3 / constants.alpha_2
    return {"k_bound": k, "bound": constants.bound(RUN_STEPS), "V_bound": rate**k}


def map_fields(params: LyapunovParams, found: LyapunovAnalysis | None) -> Mapping[str, np.ndarray]:
    """The change of V over the window; empty where V = 0."""
    window = params.loop.window
    axes = [np.linspace(-half, half, NODES)[::MAP_STRIDE] for half in window]
    change = np.full((len(axes[1]), len(axes[0])), np.nan)
    if found is not None:
        change = relative_change(found)[::MAP_STRIDE, ::MAP_STRIDE]
    return {"map_q": axes[0], "map_v": axes[1], "map_change": change}


def relative_change(found: LyapunovAnalysis) -> np.ndarray:
    """(NODES, NODES): of V in a step, in parts of its size; NaN where V = 0."""
    size = np.abs(found.V)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(size > 0.0, found.change / size, np.nan)
    return np.clip(share, -LARGEST_CHANGE, LARGEST_CHANGE)


def conditions(params: LyapunovParams, found: LyapunovAnalysis | None, failure: str) -> str:
    """The three conditions on the set, each with its number."""
    if found is None:
        return failure or "Not known yet."
    a = found.constants
    if params.set == "box":
        where = "in the box"
    else:
        where = "in the level set" if found.level > 0.0 else "in the window"
    lines = [
        f"V ≥ α₁|x|² {where}: "
        + (f"holds, α₁ = {a.alpha_1:.3g}." if a.alpha_1 > 0.0 else _failure_message(a.alpha_1)),
        f"V ≤ α₂|x|² {where}: holds, α₂ = {a.alpha_2:.3g}.",
        f"V(f(x)) − V(x) ≤ −α₃|x|² {where}: "
        + (f"holds, α₃ = {a.alpha_3:.3g}." if a.alpha_3 > 0.0 else _failure_message(a.alpha_3)),
    ]
    if a.holds:
        lines.append(f"So |xₖ| ≤ c γᵏ |x₀| with c = {a.c:.3g}, γ = {a.gamma:.4f}.")
    return "\n".join(lines)


def _failure_message(least: float) -> str:
    return f"fails, the best number is {least:.3g}."
