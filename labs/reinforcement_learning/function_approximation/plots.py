"""What function approximation plots, in each of its worlds, and the curves behind it."""

import numpy as np

from labs.arrays import Training
from labs.plots import Curves, HeatMap, Plot, Readout, ShownWhen, Trace
from labs.reinforcement_learning.function_approximation.learning_world import Fields

WALK: ShownWhen = {"world": ("walk",)}
GIVEN: ShownWhen = {"world": ("walk", "surface")}
PLANE: ShownWhen = {"world": ("surface", "swing")}
SWING: ShownWhen = {"world": ("swing",)}
FITTED: ShownWhen = {"world": ("walk", "surface", "swing")}
EXAMPLES: ShownWhen = {"world": ("star", "pair", "spiral")}
TRIAD: ShownWhen = {"world": ("star", "pair")}
SPIRAL: ShownWhen = {"world": ("spiral",)}
NINE: ShownWhen = {"world": ("nine",)}
CONVERGENCE_ROWS = ("MC control", "SARSA", "Q-learning")
CONVERGENCE_COLUMNS = ("table", "linear", "nonlinear")
AXES = ("angle from upright [rad]", "velocity [rad/s]")
CHANGE_LEARNERS = ("MC, table", "MC, linear", "SARSA, linear", "MC, nonlinear")
"""Learners whose changes of policy are plotted, and their cells in `nine`."""
CHANGE_CELLS = [0, 1, 4, 2]


def _map(title: str, z: str, z_label: str, when: ShownWhen = PLANE, arrows: str = "") -> HeatMap:
    return HeatMap(title, "angle", "velocity", z, *AXES, z_label, when=when, arrows=arrows)


def _band(name: str, label: str) -> tuple[Trace, ...]:
    """What `spread` makes of the learners' curves."""
    return (
        Trace("steps", name, label, series=1),
        Trace("steps", f"{name}_low", "", "dash", series=1),
        Trace("steps", f"{name}_high", "", "dash", series=1),
    )


PLOTS: tuple[Plot, ...] = (
    Curves(
        "Value along the line",
        "state",
        "v",
        Trace("state", "truth", "truth", "dash"),
        Trace("state", "estimate", "estimate", series=1),
        Trace("state", "best", "best fit", series=3),
        Trace("state", "fixed", "TD fixed point", series=2),
        when=WALK,
    ),
    Curves(
        "Value error",
        "{unit}",
        "root mean square",
        *_band("error", "mean of six"),
        Trace("reference_x", "reference_best", "best fit", "dash", series=3),
        Trace("reference_x", "reference_fixed", "TD fixed point", "dash", series=2),
        Trace("squares_x", "squares", "least squares of the batch", "dash", optional=True),
        log_y=True,
        when=GIVEN,
    ),
    Curves(
        "Error of all values",
        "updates",
        "root mean square",
        *_band("error", "mean of six"),
        log_y=True,
        when=EXAMPLES,
    ),
    Curves("Features", "state", "φ", Trace("state", "features", "φ{}", series=1), when=WALK),
    _map("Estimate", "estimate_map", "v"),
    _map("Truth", "truth_map", "V"),
    _map("Error map", "error_map", "v − V"),
    _map("Feature", "feature_map", "φ"),
    Curves(
        "Cost of the greedy policy",
        "{unit}",
        "J from hanging",
        *_band("greedy", "median of six"),
        Trace("reference_x", "optimum", "optimal", "dash"),
        log_y=True,
        when=SWING,
    ),
    _map("Greedy policy", "estimate_map", "min q", SWING, "policy"),
    Curves(
        "Weights",
        "updates",
        "w",
        Trace("steps", "weights", "w{}", series=1),
        when=TRIAD,
    ),
    Curves(
        "Eigenvalues of −A",
        "real",
        "imaginary",
        Trace("real", "imaginary", "", "points", series=1),
        guide="imaginary-axis",
        when=TRIAD,
    ),
    Curves(
        "The spiral",
        "one way",
        "across",
        Trace("curve_x", "curve_y", "values within reach"),
        Trace("way_x", "way_y", "values of the learner", series=1),
        equal=True,
        when=SPIRAL,
    ),
    *(
        Curves(
            f"Distance to the best q, {column}",
            "episodes",
            "root mean square",
            Trace("rounds", f"distance_{column}", CONVERGENCE_ROWS, series=1),
            log_x=True,
            log_y=True,
            when=NINE,
        )
        for column in CONVERGENCE_COLUMNS
    ),
    Curves(
        "Changes of the greedy policy",
        "episodes",
        "so far",
        Trace("rounds", "changes", CHANGE_LEARNERS, series=1),
        log_x=True,
        when=NINE,
    ),
    Readout("learned", "Learned from", "{unit}", whole=True),
    Readout("size", "Weights", "", whole=True, when=FITTED),
    Readout(
        "error_now",
        "Value error",
        "",
        when={"world": ("walk", "surface", "star", "pair", "spiral")},
    ),
    Readout("error_best", "Of the best fit", "", when=GIVEN),
    Readout("error_fixed", "Of the TD fixed point", "", when=GIVEN),
    Readout("error_squares", "Of least squares", "", when=GIVEN),
    Readout("bound", "Bound on TD's", "", when={"world": ("surface",)}),
    Readout("greedy_now", "Greedy cost, median", "", when=SWING),
    Readout("greedy_best", "Optimal cost", "", when=SWING),
    Readout("growth", "Largest real part of −A", "", when=TRIAD),
    Readout("largest", "Largest weight", "", when=TRIAD),
)


def band_fields(name: str, curves: np.ndarray, middle: str = "mean") -> Fields:
    """The middle of S curves (S, k), the least and the largest."""
    center = np.median(curves, axis=0) if middle == "median" else curves.mean(axis=0)
    return {name: center, f"{name}_low": curves.min(axis=0), f"{name}_high": curves.max(axis=0)}


def reference_lines(training: Training, **levels: float) -> Fields:
    """Horizontal lines at some levels, from the first to the last of the steps."""
    ends = training["steps"]
    ends = ends[[0, -1]] if len(ends) else ends
    return {"reference_x": ends} | {name: np.full(len(ends), at) for name, at in levels.items()}
