"""Model-free control (notes, 3.6): Q-learning and SARSA, learned before your eyes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.errors import LabError, ParameterError
from labs.lab import Inputs, Lab, Measurement, Snapshot, State
from labs.params import Group, Value
from labs.plots import Curves, HeatMap, Line, Readout, TimeSeries, Trace
from labs.random_numbers import seeded
from labs.reinforcement_learning.td_control.params import BATCHES, METHODS, LearningParams
from labs.reinforcement_learning.td_control.picture import CELL, board, draw_grid, draw_pendulum
from labs.reinforcement_learning.td_control.tasks import PENDULUM, Task
from labs.reinforcement_learning.td_control.training import (
    CURVES,
    Training,
    batch,
    begin,
    fits,
    further,
    moved,
    trained,
)
from labs.reinforcement_learning.td_control.walks import PERIOD, Walk, set_out, walked
from labs.scene import Scene, cell_at
from labs.tasks.grid_world.map import MAPS

SEEDS = {"grid": 10, "pendulum": 5}
"""Learners of each method."""
ORDER = ("first", "second")
AXES = ("column, or angle from upright [rad]", "row from below, or velocity [rad/s]")
WINDOW = 10
"""Batches over which the cost of learning is averaged."""
OPTIMAL = 1e-9
"""A greedy walk that costs this much more than the best at most is one of the best."""


VIEW = Group("View")


class TdParams(LearningParams):
    """What the user can turn."""

    shown: str = VIEW.choice("first", {"first": "First", "second": "Second"}, "Values of method")
    """Whose estimates colour the scene and the maps."""
    learner: float = VIEW.knob(1, 1, 10, "s", "", "Learner", step=1)
    """Which of those who learn side by side is shown."""
    control: float = VIEW.knob(0, 0, 8, r"u_{map}", "", "Control of the map", step=1)
    """The map of Q shows this control; 0: the best in each state."""

    @property
    def view(self) -> tuple[int, int]:
        """Which method's learner is shown, and which of its learners."""
        second = self.shown == "second" and self.second != "none"
        return int(second), min(round(self.learner), SEEDS[self.system]) - 1


@dataclass(kw_only=True)
class TdState(State):
    """What was learned, and a walk that shows it."""

    training: Training
    walk: Walk


def _curves(title: str, y_label: str, mean: str, *edges: str) -> Curves:
    """Over episodes, for both methods: a line, dashed ones, and what dynamic programming says."""
    traces = []
    for i, name in enumerate(ORDER):
        traces.append(Trace(f"episodes_{name}", f"{mean}_{name}", name, series=1 + i))
        traces += [Trace(f"episodes_{name}", f"{edge}_{name}", "", "dash", 1 + i) for edge in edges]
    if mean in ("online", "offline"):
        traces.append(Trace("best_x", "best_y", "optimal", "dash"))
    return Curves(title, "episodes", y_label, *tuple(traces), log_y=True)


class TdControl(Lab[TdParams, TdState]):
    """Learners of one or two methods, and their greedy policies at work."""

    title = "Model-free control"
    section = "3.6"
    summary = (
        "Q-learning and SARSA learn a cliff, a windy grid and a swing-up from experience alone: "
        "their values, policies and mistakes, episode by episode."
    )
    Params = TdParams
    period = PERIOD
    plots = (
        _curves("Cost of an episode while learning", "J", "online", "online_low", "online_high"),
        _curves("Cost of the greedy policy, median", "J", "offline"),
        _curves("Distance to Q*", "mean (root of squares); dashed: largest", "off", "most"),
        HeatMap("Q of the learner shown", "x", "y", "q", *AXES, "Q", gaps=True),
        HeatMap("Greedy policy", "x", "y", "policy", *AXES, "u", gaps=True),
        HeatMap("Visits", "x", "y", "visits", *AXES, "log₁₀(1 + n)", gaps=True),
        HeatMap("Error of min Q", "x", "y", "error", *AXES, "|V − V*|", gaps=True),
        TimeSeries("Cost of the walk in the scene", "", Line("paid", "J"), select="method"),
        Readout("trained", "Episodes of each learner", "", whole=True),
        Readout("optimum", "Optimal cost", ""),
        Readout("greedy_first", "Greedy, median, first", ""),
        Readout("greedy_second", "Greedy, median, second", ""),
        Readout("best_first", "Optimal learners, first", "", whole=True),
        Readout("best_second", "Optimal learners, second", "", whole=True),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Cliff": {},
        "Windy grid": {"map": MAPS["windy"], "episodes": 1000},
        "Room": {"map": MAPS["room"], "episodes": 250},
        "Pendulum": {
            "system": "pendulum",
            "second": "none",
            "gamma": 0.95,
            "episodes": 2000,
        },
        "Learn from a PD controller": {
            "system": "pendulum",
            "second": "none",
            "gamma": 0.95,
            "episodes": 2000,
            "explorer": "follow",
            "anywhere": True,
            "q0": 20.0,
            "alpha": 1.0,
        },
    }

    def init(self, params: TdParams, rng: np.random.Generator) -> TdState:
        task, many = params.task, len(params.methods)
        training = begin(task, many, SEEDS[params.system], rng, params.q0)
        walk = set_out(params.system, task, many, seeded(rng, 1)[0])
        return TdState(training=training, walk=walk)

    def step(self, params: TdParams, inputs: Inputs, state: TdState) -> TdState:
        """10 ms of the walk under the greedy policies of the moment."""
        if state.trouble:
            return state
        task = params.task
        _, s = params.view
        policies = _present(params, state)["q"][:, s].argmin(axis=2)
        walk = walked(params.system, task, policies, state.walk)
        return replace(state, t=state.t + self.period, walk=walk)

    def solve(self, params: TdParams, state: TdState) -> Iterator[Snapshot]:
        """A batch of episodes an iteration; goes on from what was learned."""
        task, training = params.task, state.training
        behavior, rule, kinds = params.behavior(task), params.rule(task), params.kinds
        if not training["sound"]:
            rng = np.random.default_rng(training["random"][0, 0])
            training = begin(task, len(kinds), SEEDS[params.system], rng, params.q0)
        elif not fits(training, task):
            training = moved(training, task, params.q0)
        begun, wanted, i = trained(training), round(params.episodes), 0
        most = -(-wanted // BATCHES)
        done = ""
        while not done:
            left = wanted - (trained(training) - begun)
            episodes = min(left, batch(task, rule, kinds, training, most))
            training, i = further(task, behavior, rule, kinds, training, episodes), i + 1
            if not training["sound"]:
                done = "The estimates diverged."
            elif left == episodes:
                done = f"{trained(training)} episodes learned."
            yield Snapshot(i, training, done, 1.0 - (left - episodes) / wanted)

    def accept(self, params: TdParams, state: TdState, snapshot: Snapshot) -> TdState:
        training = snapshot.data
        trouble = "" if training["sound"] else _diverged(training)
        return replace(state, training=training, trouble=trouble)

    def edit(
        self, params: TdParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The map with the cell clicked as the brush says."""
        world = params.world
        rows, columns = world.shape
        cell = cell_at(point, board(world.shape), CELL, rows, columns)
        if handle != "board" or cell is None:
            return {}
        row, column = cell
        again = params.brush in "#C" and world.rows[row][column] == params.brush
        try:
            return {"map": world.changed(row, column, "." if again else params.brush).text}
        except LabError as error:
            raise ParameterError(str(error)) from None

    def measure(self, params: TdParams, state: TdState) -> Measurement:
        task, training = params.task, state.training
        measured: dict[str, float | np.ndarray] = {
            "paid": state.walk.paid,
            "trained": float(trained(training)),
        }
        best = float(task.q_star[task.start].min())
        if np.isfinite(best):
            measured["optimum"] = best
        if training["offline"].shape[-1]:
            for name, costs in zip(ORDER, training["offline"][..., -1], strict=False):
                measured[f"greedy_{name}"] = float(np.median(costs))
                if task.mdp.deterministic and np.isfinite(best):
                    measured[f"best_{name}"] = float((costs <= best + OPTIMAL).sum())
        return measured

    def fields(self, params: TdParams, state: TdState) -> Mapping[str, np.ndarray]:
        """Maps are seen from above, row 0 on top."""
        task, training = params.task, _present(params, state)
        m, s = params.view
        q, visits = training["q"][m, s], training["visits"][m, s]
        value, best = q.min(axis=1), np.where(task.judged, task.q_star.min(axis=1), np.nan)
        control = min(round(params.control), task.mdp.U)
        meaning = np.arange(1.0, task.mdp.U + 1)
        x, y = np.arange(task.shape[1]), np.arange(task.shape[0])
        if params.system == "pendulum":
            meaning, x, y = PENDULUM.torques[:, 0], PENDULUM.angles, PENDULUM.velocities
        maps = {
            "q": q[:, control - 1] if control else value,
            "policy": meaning[q.argmin(axis=1)],
            "visits": np.log10(1.0 + visits.sum(axis=1)),
            "error": np.abs(value - best),
        }
        upright = -1 if params.system == "grid" else 1
        laid = {name: task.laid(values, np.nan)[::upright] for name, values in maps.items()}
        return {"x": x, "y": y} | laid | _progress(task, training)

    def draw(self, scene: Scene, params: TdParams, state: TdState) -> None:
        task, training = params.task, _present(params, state)
        m, s = params.view
        tables = training["q"][:, s]
        if params.system == "pendulum":
            names = [METHODS[name] for name in params.methods]
            draw_pendulum(scene, task, tables, names, state.walk, m)
        else:
            tried = training["visits"][m, s].sum(axis=1)
            draw_grid(scene, params.world, task, tables, tried, m, state.walk)

    @classmethod
    def prepare(cls) -> None:
        """Compiles the loops of all methods; the worlds share them."""
        lab = cls()
        for method in METHODS:
            params = TdParams(method=method, second="none")
            state = lab.init(params, np.random.default_rng(0))
            lab.step(params, Inputs(), lab.accept(params, state, next(lab.solve(params, state))))


def _present(params: TdParams, state: TdState) -> Training:
    """What was learned, on the map of now."""
    task, training = params.task, state.training
    return training if fits(training, task) else moved(training, task, params.q0)


def _progress(task: Task, training: Training) -> dict[str, np.ndarray]:
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
        curves["online"] = _smooth(curves["online"])
        for curve, points in curves.items():
            # One learner who walks in circles hides all others in a mean of greedy costs.
            middle = np.median if curve == "offline" else np.mean
            found[f"{curve}_{name}"] = middle(points, axis=0)
            found[f"{curve}_low_{name}"] = points.min(axis=0)
            found[f"{curve}_high_{name}"] = points.max(axis=0)
    return found


def _smooth(curves: np.ndarray) -> np.ndarray:
    """Each point (..., k) the mean of itself and up to WINDOW - 1 before it."""
    sums = np.cumsum(curves, axis=-1)
    late = sums[..., WINDOW:] - sums[..., :-WINDOW]
    counts = np.minimum(np.arange(curves.shape[-1]) + 1, WINDOW)
    return np.asarray(np.concatenate([sums[..., :WINDOW], late], axis=-1) / counts)


def _diverged(training: Training) -> str:
    return (
        f"The estimates diverged by episode {trained(training)}: what a trace adds to an "
        "estimate overshoots. Take a smaller step size or trace decay, or replacing traces."
    )
