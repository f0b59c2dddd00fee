"""What the page of the four families plots, and the fields behind it."""

from collections.abc import Mapping

import numpy as np

from labs.optimal_control.families.closed_form import closed_form
from labs.optimal_control.families.motion import first_guess
from labs.optimal_control.families.params import FamiliesParams
from labs.optimal_control.families.side_by_side import (
    FAMILY_NAMES,
    GLOBAL_METHODS,
    Results,
    optimal_motion,
)
from labs.plots import Bars, Curves, HeatMap, Note, Plot, Readout, Trace

SERIES = {"hjb": 1, "dp": 2, "pontryagin": 4, "direct": 7}
"""Colours of the methods."""
MAX_CELLS = 61
"""Of a heat map along one side, at most."""
CUTOFF_FACTOR = 4.0
"""Times the least cost from the start, where the map ends."""


def _curves(title: str, x: str, y: str, x_label: str, y_label: str, *more: Trace) -> Curves:
    """A curve of each method."""
    traces = [
        Trace(f"{x}_{name}", f"{y}_{name}", FAMILY_NAMES[name], "line", series)
        for name, series in SERIES.items()
    ]
    return Curves(title, x_label, y_label, *traces, *more)


_NOW = Trace("now_t", "now_q", "", "points")
PLOTS: tuple[Plot, ...] = (
    _curves(
        "Position",
        "t", "q", "t [s]", "q [{unit}]",
        Trace("tail_t", "tail_q", "tail", "dash", optional=True),
        _NOW,
    ),
    _curves("Control", "t", "u", "t [s]", "u [{control_unit}]"),
    _curves(
        "Costate of q",
        "t", "p_q", "t [s]", "∂J/∂q",
        Trace("exact_t", "exact_p_q", "exact", "dash", optional=True),
    ),
    _curves(
        "Costate of v",
        "t", "p_v", "t [s]", "∂J/∂v",
        Trace("exact_t", "exact_p_v", "exact", "dash", optional=True),
    ),
    Bars(
        "Cost: paid, and promised by the tables",
        "costs", "J", "", marks="promises", gaps=True, names="methods",
    ),
    Bars("Computing time", "durations", "t", "ms", names="methods"),
    _curves(
        "Phase plane",
        "q", "v", "q [{unit}]", "v [{unit}/s]",
        Trace("guess_q", "guess_v", "first guess", "dash"),
    ),
    HeatMap("Cost-to-go from M", "across", "up", "V", "q [{unit}]", "v [{unit}/s]", "V, to 4 J"),
    Curves(
        "Error of V over the nodes",
        "nodes along an axis",
        "|V(x₀) − J|",
        Trace("nodes_hjb", "error_hjb", FAMILY_NAMES["hjb"], "marked", 1),
        Trace("nodes_dp", "error_dp", FAMILY_NAMES["dp"], "marked", 2),
        log_x=True,
        log_y=True,
        when={"study": ("grid",)},
    ),
    Curves(
        "Cost by the first guess",
        "A [{unit}]",
        "J",
        Trace("swing_pontryagin", "found_pontryagin", FAMILY_NAMES["pontryagin"], "points", 4),
        Trace("swing_direct", "found_direct", FAMILY_NAMES["direct"], "marked", 7),
        log_y=True,
        when={"study": ("guess",)},
    ),
    Note("What each has found", "account"),
    Readout("cost_hjb", "Cost, HJB", ""),
    Readout("cost_dp", "Cost, DP", ""),
    Readout("cost_pontryagin", "Cost, Pontryagin", ""),
    Readout("cost_direct", "Cost, Direct", ""),
    Readout("gradient_gap", "Gradient of V off the costate", "%"),
    Readout("multiplier_gap", "Multipliers off the costate", "%"),
    Readout("tail_gap", "Tail from M off the motion", "%"),
    Readout("tail_cost_gap", "Its cost off the rest of J", "%"),
)  # fmt: skip


def motion_fields(params: FamiliesParams, at: Results, now: float) -> dict[str, np.ndarray]:
    """The motions and costates known so far, and where they are at t = now [s]."""
    fields: dict[str, np.ndarray] = {}
    optimal = optimal_motion(params, at.motions)
    for name, motion in at.motions.items():
        some = slice(None if motion.known else 0)
        P = at.gradients[name] if name in GLOBAL_METHODS and at.over and optimal else motion.P
        fields[f"t_{name}"], fields[f"u_{name}"] = motion.t[some], motion.U[some]
        fields[f"q_{name}"], fields[f"v_{name}"] = motion.X[some].T
        fields[f"p_q_{name}"], fields[f"p_v_{name}"] = P[some].T
    known = [motion for motion in at.motions.values() if motion.known]
    if params.moment:
        some = slice(None if at.tail.converged else 0)
        fields |= {"tail_t": at.tail.t[some], "tail_q": at.tail.X[some, 0]}
    exact = closed_form(params, params.x0, params.horizon)
    if exact:
        fields |= {"exact_t": exact.t, "exact_p_q": exact.P[:, 0], "exact_p_v": exact.P[:, 1]}
    guess = first_guess(params.problem(params.x0, params.horizon), params.guess)
    moment = min(now, params.horizon)
    return fields | {
        "guess_q": guess.X[:, 0],
        "guess_v": guess.X[:, 1],
        "now_t": np.full(len(known), moment),
        "now_q": np.array([motion.at(moment)[0] for motion in known]),
    }


def table_fields(params: FamiliesParams, at: Results) -> dict[str, np.ndarray]:
    """V as a map, of not too many cells, cut where it is far dearer than the start."""
    V = at.values[params.surface]
    costs = [motion.cost for motion in at.motions.values() if motion.known]
    V = np.minimum(V, CUTOFF_FACTOR * min(costs)) if costs else V
    q, v = params.grid(len(V)).axes
    every = -(-len(V) // MAX_CELLS)
    return {"across": q[::every], "up": v[::every], "V": V[::every, ::every].T}


def study_fields(
    params: FamiliesParams, at: Results, seconds: Mapping[str, float | np.ndarray]
) -> dict[str, np.ndarray]:
    """Costs and times of the four, and the points of the study so far."""
    costs = [motion.cost if motion.known else np.nan for motion in at.motions.values()]
    promises = [
        motion.promised if motion.known and name in GLOBAL_METHODS else np.nan
        for name, motion in at.motions.items()
    ]
    fields = {
        "costs": np.array(costs),
        "promises": np.array(promises),
        "durations": np.array([1e3 * float(seconds.get(name, 0.0)) for name in FAMILY_NAMES]),
    }
    x, y = {"hjb": "nodes", "dp": "nodes"}, {"hjb": "error", "dp": "error"}
    for column, (first, second) in enumerate((("hjb", "pontryagin"), ("dp", "direct"))):
        found = at.study.found[:, column]
        points = at.study.x[found], at.study.y[found, column]
        none = np.zeros(0), np.zeros(0)
        grid, guess = (points, none) if params.study == "grid" else (none, points)
        fields[f"{x[first]}_{first}"], fields[f"{y[first]}_{first}"] = grid
        fields[f"swing_{second}"], fields[f"found_{second}"] = guess
    return fields


def method_notes(at: Results) -> str:
    """What each has found, a line a method."""
    lines = []
    for name, motion in at.motions.items():
        cost = f"cost {motion.cost:.5g}. " if motion.known else ""
        lines.append(f"{FAMILY_NAMES[name]}: {cost}{motion.message}")
    return "\n".join(lines)
