"""What deep Q-learning plots, and the maps and curves behind it."""

from functools import cache

import numpy as np

from labs.algorithms.dqn import q_values
from labs.arrays import Training
from labs.plots import Curves, HeatMap, Line, Plot, Readout, TimeSeries, Trace
from labs.reinforcement_learning.dqn.optimal_table import best_controls, least_costs
from labs.reinforcement_learning.dqn.tasks import RobotTask, learning_task
from labs.reinforcement_learning.dqn.training import UNKNOWN_COST

ARROW_STRIDE = 3
"""Every so many nodes of a map has one."""
AXES = ("{across}", "{up}")

PLOTS: tuple[Plot, ...] = (
    Curves(
        "Cost of an episode under the greedy policy",
        "steps of a learner",
        "J",
        Trace("tried", "greedy", "learner {}", series=1),
        Trace("compared_x", "table_y", "optimal table", "dash", optional=True),
        Trace("compared_x", "energy_y", "energy, then LQR", "dash", series=5, optional=True),
        log_y=True,
    ),
    HeatMap("Value and policy", "x", "y", "value", *AXES, "min Q", arrows="policy"),
    Curves(
        "Cost of an episode while learning",
        "steps of a learner",
        "J, mean of 10",
        Trace("online_x", "online_y", "learner {}", series=1),
    ),
    Curves(
        "Believed and paid",
        "steps of a learner",
        "discounted cost, learner shown",
        Trace("tried", "believed", "min Q, believed", series=1),
        Trace("tried", "paid", "paid", series=3),
    ),
    Curves(
        "TD error",
        "steps of a learner",
        "RMS of y − Q",
        Trace("tried", "td_error", "learner {}", series=1),
        log_y=True,
    ),
    Curves(
        "Loss and gradient",
        "steps of a learner",
        "of the learner shown",
        Trace("tried", "loss", "L", series=1),
        Trace("tried", "gradient_norm", "|∂L/∂w|", series=2),
        log_y=True,
    ),
    HeatMap("What the buffer holds", "x", "y", "held", *AXES, "log₁₀(1 + n)"),
    TimeSeries("Angles in the scene", "rad", Line("q", "q"), select="joint"),
    TimeSeries("Torques in the scene", "N·m", Line("u", "u"), select="motor"),
    Readout("greedy", "Greedy policy", ""),
    Readout("best", "Best", ""),
    Readout("table", "Table", "", when={"system": ("pendulum",)}),
    Readout("energy", "Energy", "", when={"system": ("pendulum",)}),
    Readout("distance", "Tip to target", "m", when={"system": ("ur5",)}),
    Readout("steps", "Steps", "", whole=True),
    Readout("updates", "Updates", "", whole=True),
    Readout("epsilon", "ε", ""),
)


def value_map(
    task: RobotTask, sizes: np.ndarray, w: np.ndarray, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """min Q in the task's units of cost and argmin Q, (NODES, NODES), rows along the second
    coordinate, through the state x (nx,)."""
    q = q_values(sizes, w, task.robot.observe(_map_states(task, x)))
    return _on_map(task, task.cost_scale * q.min(axis=1)), _on_map(task, q.argmin(axis=1))


@cache
def table_map() -> tuple[np.ndarray, np.ndarray]:
    """The same of the pendulum's optimal table."""
    task = learning_task("pendulum")
    X = task.map_states(task.base)
    return _on_map(task, least_costs(X)), _on_map(task, best_controls(X))


def _map_states(task: RobotTask, x: np.ndarray) -> np.ndarray:
    base = task.base.copy()
    base[4:] = x[4:] if task.name == "ur5" else base[4:]
    return task.map_states(base)


def _on_map(task: RobotTask, values: np.ndarray) -> np.ndarray:
    return values.reshape(len(task.map_axis(1)), len(task.map_axis(0)))


def map_fields(
    task: RobotTask, training: Training, s: int, shown: tuple[np.ndarray, np.ndarray]
) -> dict[str, np.ndarray]:
    """Values and policy `shown`, as `value_map` has them, and the buffer of learner s."""
    value, policy = shown
    first, second = task.map_axis(0), task.map_axis(1)
    some = (slice(ARROW_STRIDE // 2, None, ARROW_STRIDE),) * 2
    across, up = np.meshgrid(first[some[0]], second[some[1]])
    torque = task.torques[policy[some], 0].ravel() / task.max_torque
    arrows = np.stack([across.ravel(), up.ravel(), torque, np.zeros(torque.size)], axis=1)
    return {"x": first, "y": second, "value": value, "policy": arrows} | {
        "held": _buffer_histogram(task, training, s)
    }


def _buffer_histogram(task: RobotTask, training: Training, s: int) -> np.ndarray:
    """How many states of the buffer are near each node."""
    known = min(int(training["stored"][s, 0]), training["observations"].shape[1])
    at = task.map_coordinates(training["observations"][s, :known])
    edges = []
    for i in (0, 1):
        axis = task.map_axis(i)
        half = 0.5 * (axis[1] - axis[0])
        edges.append(np.append(axis - half, axis[-1] + half))
    counts, _, _ = np.histogram2d(at[:, 1], at[:, 0], bins=(edges[1], edges[0]))
    return np.asarray(np.log10(1.0 + counts))


def learning_curves(
    training: Training, s: int, compared: tuple[float, float] | None
) -> dict[str, np.ndarray]:
    """Of all learners, (k, S); loss and gradient of learner s; and what the controllers cost that
    they are compared with."""
    tried, online = training["tried"], training["online"].T
    begun = (online != UNKNOWN_COST).all(axis=1)
    found = {
        "tried": tried,
        "greedy": training["greedy"].T,
        "td_error": training["td_error"].T,
        "online_x": tried[begun],
        "online_y": online[begun],
        "believed": training["believed"][s],
        "paid": training["paid_greedy"][s],
        "loss": training["loss"][s],
        "gradient_norm": training["gradient_norm"][s],
    }
    if compared is not None:
        ends = tried[[0, -1]] if len(tried) else np.zeros(0)
        table, energy = (np.full(len(ends), cost) for cost in compared)
        found |= {"compared_x": ends, "table_y": table, "energy_y": energy}
    return found
