"""What dynamic programming plots, and the curves and tables behind it."""

import numpy as np

from labs.plots import Bars, Curves, HeatMap, Line, Note, Plot, Readout, TimeSeries, Trace
from labs.reinforcement_learning.dynamic_programming.iteration_comparison import (
    ITERATION_METHODS,
)
from labs.reinforcement_learning.dynamic_programming.tasks import HORIZON, TabularTask
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.map import GridWorld
from labs.tasks.grid_world.policy_arrows import policy_arrows
from labs.tasks.mdp_table.world import state_values
from labs.tasks.pendulum_table.policy_arrows import torque_arrows
from labs.tasks.pendulum_table.table import table_size

JOINTS = np.arange(1.0, 8.0)
PENDULUM, TABLE = {"world": ("pendulum",)}, {"world": ("table",)}
MAPPED = {"world": ("grid", "pendulum")}
AXES = ("{across}", "{up}")
POINTS, PIXELS = 250, 51
"""Of a curve and along one side of a heat map, at most."""


def _traces(x: str, y: str) -> tuple[Trace, ...]:
    return tuple(
        Trace(f"{x}_{method}", f"{y}_{method}", method, series=i + 1)
        for i, method in enumerate(ITERATION_METHODS)
    )


PLOTS: tuple[Plot, ...] = (
    Curves(
        "Distance to the limit, sweep by sweep",
        "sweeps k",
        "max norm",
        *_traces("sweep", "error"),
        Trace("sweep_value", "bound", "γᵏ |V₀ − V*|", "dash"),
        log_y=True,
    ),
    Curves(
        "Distance to the limit by backups",
        "backups",
        "max norm",
        *_traces("backups", "error"),
        log_x=True,
        log_y=True,
    ),
    Note("What each took", "account"),
    Curves(
        "Cost-to-go of the start by the time to go",
        "steps to go N - i",
        "V of the start",
        Trace("stages", "stage_values", "finite horizon", "marked", 1),
        Trace("ends", "stationary", "infinite horizon", "dash"),
        Trace("stage", "stage_value", "shown", "points", 2),
    ),
    TimeSeries(
        "Cost of this run",
        "",
        Line("paid", r"\text{paid}"),
        Line("promised", r"\text{paid} + \gamma^k V(x_k)", "limit"),
    ),
    TimeSeries("Pendulum from upright", "rad", Line("angle", r"q - q^*"), when=PENDULUM),
    TimeSeries("Torque of the pendulum", "N·m", Line("torque", r"u"), when=PENDULUM),
    HeatMap("Cost-to-go", "x", "y", "V_map", *AXES, "V", gaps=True, when=MAPPED),
    HeatMap("Policy", "x", "y", "V_map", *AXES, "V", gaps=True, arrows="policy", when=MAPPED),
    Bars("Cost-to-go by state", "state_V", "V", "", gaps=True, names="state_names", when=TABLE),
    Note("Policy by state", "by_state", when=TABLE),
    Curves(
        "States of a table by joints",
        "joints j",
        "states",
        Trace("joints", "states", "cᵃ, a = 2j", "marked", 1),
        Trace("joint", "state", "yours", "points", 2),
        log_y=True,
    ),
    Readout("sweeps", "Sweeps", "", whole=True),
    Readout("backups", "Backups", "", whole=True),
    Readout("error", "Distance to the limit", ""),
    Readout("at_start", "V of the start", ""),
    Readout("entries", "Entries of this table", "X·U", whole=True),
    Readout("states", "States of a robot with j joints", ""),
    Readout("memory", "Memory for its values alone", "GB"),
    Note("The world", "about"),
)


def horizon_curves(task: TabularTask, stages: np.ndarray, to_go: int) -> dict[str, np.ndarray]:
    """V of the start by the steps to go, of `stages` (HORIZON + 1, X), beside V*."""
    best = float(task.limits[3, task.start])
    return {
        "stages": np.arange(HORIZON + 1.0),
        "stage_values": stages[:, task.start],
        "ends": np.array([0.0, HORIZON] if np.isfinite(best) else []),
        "stationary": np.array([best, best] if np.isfinite(best) else []),
        "stage": np.array([float(to_go)]),
        "stage_value": stages[to_go, task.start : task.start + 1],
    }


def table_maps(
    task: TabularTask, V: np.ndarray, policy: np.ndarray | None
) -> dict[str, np.ndarray]:
    """V (X,), seen from above, NaN where there is none, and a policy, (X,) controls or (X, U)
    probabilities, if any, as arrows."""
    place, arrows, everywhere = task.place, np.zeros((0, 4)), np.full(task.mdp.X, True)
    if isinstance(place, CellWorld):
        rows, columns = place.shape
        x, y = np.arange(1.0, columns + 1), np.arange(1.0, rows + 1)
        values = place.on_map(V, np.nan)[::-1]
        if policy is not None and isinstance(place, GridWorld):
            arrows = policy_arrows(place, policy, everywhere)
    else:
        every = -(-place.q_nodes // PIXELS)
        x, y = place.angles[::every], place.velocities[::every]
        values = V.reshape(place.shape)[::every, ::every].T
        if policy is not None and policy.ndim == 1:
            arrows = torque_arrows(place, policy, everywhere)
    return {"x": x, "y": y, "V_map": values, "policy": arrows, "state_V": state_values(place, V)}


def table_sizes(joints: int, nodes: int) -> dict[str, np.ndarray]:
    """States of robots with each of JOINTS, and of the one with so many."""
    return {
        "joints": JOINTS,
        "states": np.array([float(table_size(int(j), nodes)) for j in JOINTS]),
        "joint": np.array([float(joints)]),
        "state": np.array([float(table_size(joints, nodes))]),
    }
