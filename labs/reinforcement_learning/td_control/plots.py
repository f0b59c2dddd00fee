"""What model-free control plots, and the curves and maps behind it."""

import numpy as np

from labs.arrays import Training
from labs.plots import Bars, Curves, HeatMap, Line, Note, Plot, Readout, TimeSeries, Trace
from labs.reinforcement_learning.td_control.params import LEARNING_METHODS
from labs.reinforcement_learning.td_control.tasks import ControlTask
from labs.reinforcement_learning.td_control.training import CURVES
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.grid_world.policy_arrows import policy_arrows
from labs.tasks.mdp_table.world import state_values
from labs.tasks.pendulum_table.policy_arrows import torque_arrows

ORDER = ("first", "second")
AXES = ("{across}", "{up}")
SECOND = {"second": tuple(LEARNING_METHODS)}
"""Where there is a second method."""
MAPPED, TABLE = {"system": ("grid", "pendulum")}, {"system": ("table",)}
WINDOW = 10
"""Batches over which the cost of learning is averaged."""


def _curves(title: str, y_label: str, mean: str, *edges: str) -> Curves:
    """Over episodes, for both methods: a line, dashed ones, and what dynamic programming says."""
    traces = []
    for i, name in enumerate(ORDER):
        traces.append(Trace(f"episodes_{name}", f"{mean}_{name}", f"{{{name}}}", series=1 + i))
        traces += [Trace(f"episodes_{name}", f"{edge}_{name}", "", "dash", 1 + i) for edge in edges]
    if mean in ("online", "offline"):
        traces.append(Trace("best_x", "best_y", "{optimal}", "dash"))
    return Curves(title, "episodes", y_label, *tuple(traces), log_y=True)


PLOTS: tuple[Plot, ...] = (
    _curves("Cost of an episode while learning", "J", "online", "online_low", "online_high"),
    _curves("Cost of the greedy policy, median", "J", "offline"),
    _curves("Distance to Q*", "{distance}", "off", "most"),
    HeatMap("Q of the learner shown", "x", "y", "q", *AXES, "Q", gaps=True, when=MAPPED),
    HeatMap(
        "Greedy policy", "x", "y", "value", *AXES, "min Q", gaps=True, arrows="policy", when=MAPPED
    ),
    HeatMap("Visits", "x", "y", "visits", *AXES, "log₁₀(1 + n)", gaps=True, when=MAPPED),
    HeatMap("Error of min Q", "x", "y", "error", *AXES, "|V − V*|", gaps=True, when=MAPPED),
    Bars(
        "min Q by state",
        "state_V",
        "min Q",
        "",
        marks="best_V",
        gaps=True,
        names="state_names",
        when=TABLE,
    ),
    Note("Greedy policy by state", "by_state", when=TABLE),
    Note("The world", "about", when={"system": ("grid", "table")}),
    TimeSeries("Cost of the walk in the scene", "", Line("paid", "J"), select="method"),
    Readout("trained", "Episodes of each learner", "", whole=True),
    Readout("optimum", "Optimal cost", ""),
    Readout("greedy_first", "Greedy, median, {first}", ""),
    Readout("greedy_second", "Greedy, median, {second}", "", when=SECOND),
    Readout("best_first", "Optimal learners, {first}", "", whole=True),
    Readout("best_second", "Optimal learners, {second}", "", whole=True, when=SECOND),
)


def learner_maps(
    task: ControlTask, q: np.ndarray, visits: np.ndarray, control: int
) -> dict[str, np.ndarray]:
    """Of one learner's Q and visits, both (X, U), seen from above, row 0 on top: NaN where there is
    nothing to show; the greedy policy as arrows, where it has been. `control` counts from 1; 0: the
    best in each state."""
    value, best = q.min(axis=1), np.where(task.compared, task.q_star.min(axis=1), np.nan)
    values = {
        "q": q[:, control - 1] if control else value,
        "value": value,
        "visits": np.log10(1.0 + visits.sum(axis=1)),
        "error": np.abs(value - best),
    }
    known = visits.sum(axis=1) > 0
    if isinstance(task.place, CellWorld):
        rows, columns = task.shape
        axes = {"x": np.arange(1.0, columns + 1), "y": np.arange(1.0, rows + 1)}
        axes["policy"], upwards = np.zeros((0, 4)), -1
        if isinstance(task.place, GridWorld):
            axes["policy"] = policy_arrows(task.place, q.argmin(axis=1), known)
    else:
        axes = {"x": task.place.angles, "y": task.place.velocities}
        axes["policy"], upwards = torque_arrows(task.place, q.argmin(axis=1), known), 1
    axes |= {"state_V": state_values(task.place, value), "best_V": state_values(task.place, best)}
    return axes | {name: task.on_map(of, np.nan)[::upwards] for name, of in values.items()}


def learning_curves(task: ControlTask, training: Training) -> dict[str, np.ndarray]:
    """The curves over episodes: the mean (of greedy costs the median) of all learners, the least
    and the largest."""
    episodes, none = training["episodes"], np.zeros(0)
    best = float(task.q_star[task.start].min())
    known = np.isfinite(best) and len(episodes)
    found = {
        "best_x": episodes[[0, -1]] if known else none,
        "best_y": np.full(2, best) if known else none,
    }
    for m, name in enumerate(ORDER):
        there = m < len(training["q"])
        found[f"episodes_{name}"] = episodes if there else none
        curves = {c: training[c][m] if there else np.zeros((1, 0)) for c in CURVES}
        curves["online"] = _moving_average(curves["online"])
        for curve, points in curves.items():
            # One learner who walks in circles hides all others in a mean of greedy costs.
            middle = np.median if curve == "offline" else np.mean
            found[f"{curve}_{name}"] = middle(points, axis=0)
            found[f"{curve}_low_{name}"] = points.min(axis=0)
            found[f"{curve}_high_{name}"] = points.max(axis=0)
    return found


def _moving_average(curves: np.ndarray) -> np.ndarray:
    """Each point (..., k) the mean of itself and up to WINDOW - 1 before it."""
    sums = np.cumsum(curves, axis=-1)
    late = sums[..., WINDOW:] - sums[..., :-WINDOW]
    counts = np.minimum(np.arange(curves.shape[-1]) + 1, WINDOW)
    return np.asarray(np.concatenate([sums[..., :WINDOW], late], axis=-1) / counts)
