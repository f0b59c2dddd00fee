"""Model-free control (notes, 3.6): Q-learning and SARSA, learned before your eyes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.arrays import Training, episodes_done
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.number_texts import count_text
from labs.params import Value
from labs.random_numbers import random_states, uniform
from labs.reinforcement_learning.td_control.greedy_walk import (
    PERIOD,
    follow_greedy_policies,
    start_greedy_walk,
)
from labs.reinforcement_learning.td_control.params import BATCHES, LEARNING_METHODS, TdParams
from labs.reinforcement_learning.td_control.plots import ORDER, PLOTS, learner_maps, learning_curves
from labs.reinforcement_learning.td_control.tasks import ControlTask
from labs.reinforcement_learning.td_control.training import (
    batch_size,
    fits_task,
    initial_training,
    train,
    transfer,
)
from labs.scene import Scene
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.grid_world.params import BOOK_WORLDS, edit_map
from labs.tasks.grid_world.picture import draw_board, draw_path, draw_walkers, value_span
from labs.tasks.grid_world.walk import GridWalk, nominal_path
from labs.tasks.mdp_table.params import EXAMPLE_TABLES
from labs.tasks.mdp_table.picture import draw_states
from labs.tasks.mdp_table.world import NO_NAMES_NOTE, TableWorld
from labs.tasks.pendulum_table.picture import draw_table
from labs.tasks.pendulum_table.swing import Swing
from labs.tasks.pendulum_table.table import PendulumGrid

SLIPPERY_SETTINGS: Mapping[str, Value] = {
    "alpha": 1.0,
    "omega": 0.6,
    "epsilon": 0.3,
    "episodes": 2000.0,
}
"""How to learn where much is left to chance: with steps that decrease."""
OPTIMALITY_TOLERANCE = 1e-9
"""A greedy walk that costs this much more than the best at most is one of the best."""


@dataclass(kw_only=True)
class TdState(State):
    """What was learned, and a walk that shows it."""

    training: Training
    walk: GridWalk | Swing
    """One of each method."""
    random: np.ndarray
    """(4,) uint64: of what the walk meets."""


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
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Cliff": {},
        "Windy grid": {"map": MAPS["windy"], "episodes": 1000},
        "Room": {"map": MAPS["room"], "episodes": 250},
        "FrozenLake": {**BOOK_WORLDS["FrozenLake"], **SLIPPERY_SETTINGS},
        "4 x 3 world": {**BOOK_WORLDS["4 x 3 world"], **SLIPPERY_SETTINGS},
        "Taxicab": {
            "system": "table",
            "table": EXAMPLE_TABLES["Taxicab"],
            "gamma": 0.9,
            "anywhere": True,
            **SLIPPERY_SETTINGS,
        },
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
    handles = (Handle("board", "A click puts the brush's cell on the map."),)

    def init(self, params: TdParams, rng: np.random.Generator) -> TdState:
        task, many = params.task, len(params.methods)
        training = initial_training(task, many, params.learners, rng, params.q0)
        return TdState(
            training=training, walk=start_greedy_walk(task, many), random=random_states(rng, 1)[0]
        )

    def step(self, params: TdParams, inputs: Inputs, state: TdState) -> TdState:
        """10 ms of the walk under the greedy policies of the moment."""
        if state.trouble:
            return state
        _, s = params.view
        policies = _training_on_map(params, state)["q"][:, s].argmin(axis=2)
        random = state.random.copy()
        walk = follow_greedy_policies(params.task, policies, state.walk, random)
        return replace(state, t=state.t + self.period, walk=walk, random=random)

    def solve(self, params: TdParams, state: TdState) -> Iterator[Snapshot]:
        """A batch of episodes an iteration; goes on from what was learned."""
        task, training = params.task, state.training
        behaviour, rule, method_numbers = params.behaviour, params.rule, params.method_numbers
        if not training["sound"]:
            rng = np.random.default_rng(training["random"][0, 0])
            training = initial_training(task, len(method_numbers), params.learners, rng, params.q0)
        elif not fits_task(training, task):
            training = transfer(training, task, params.q0)
        begun, wanted, i = episodes_done(training), round(params.episodes), 0
        most = -(-wanted // BATCHES)
        done = ""
        while not done:
            left = wanted - (episodes_done(training) - begun)
            episodes = min(left, batch_size(task, rule, method_numbers, training, most))
            training, i = train(task, behaviour, rule, method_numbers, training, episodes), i + 1
            if not training["sound"]:
                done = "The estimates diverged."
            elif left == episodes:
                learned = f"{count_text(episodes_done(training), 'episode')} learned."
                done = f"{learned} {task.no_optimum_message}".strip()
            yield Snapshot(i, training, done, 1.0 - (left - episodes) / wanted)

    def accept(self, params: TdParams, state: TdState, snapshot: Snapshot) -> TdState:
        training = snapshot.data
        trouble = "" if training["sound"] else _divergence_message(training)
        return replace(state, training=training, trouble=trouble)

    def edit(
        self, params: TdParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The map with the cell clicked as the brush says."""
        return edit_map(params.map, params.brush, handle, point)

    def measure(self, params: TdParams, state: TdState) -> Measurement:
        task, training = params.task, state.training
        measured: dict[str, float | np.ndarray] = {
            "paid": state.walk.cost,
            "trained": float(episodes_done(training)),
        }
        best = float(task.q_star[task.start].min())
        if np.isfinite(best):
            measured["optimum"] = best
        if training["offline"].shape[-1]:
            for name, costs in zip(ORDER, training["offline"][..., -1], strict=False):
                measured[f"greedy_{name}"] = float(np.median(costs))
                if task.mdp.deterministic and np.isfinite(best):
                    measured[f"best_{name}"] = float((costs <= best + OPTIMALITY_TOLERANCE).sum())
        return measured

    def fields(self, params: TdParams, state: TdState) -> Mapping[str, np.ndarray]:
        task, training, (m, s) = params.task, _training_on_map(params, state), params.view
        control = min(round(params.control), task.mdp.U)
        shown = learner_maps(task, training["q"][m, s], training["visits"][m, s], control)
        return shown | learning_curves(task, training)

    def results(self, params: TdParams, state: TdState) -> Mapping[str, np.ndarray]:
        """Of every learner V and the number of the greedy control: (methods, learners, cells); of a
        table the names."""
        q, place = state.training["q"], params.task.place
        V, control = q.min(axis=-1), q.argmin(axis=-1)
        if isinstance(place, TableWorld):
            return place.results(V, control)
        return {"V": V, "greedy_control": control}

    def notes(self, params: TdParams, state: TdState) -> Mapping[str, str]:
        task, (m, s), by_state = params.task, params.view, NO_NAMES_NOTE
        about = [task.mdp.describe([task.start]), task.no_optimum_message]
        if isinstance(task.place, CellWorld):
            about += task.place.notes
        if isinstance(task.place, TableWorld):
            q = _training_on_map(params, state)["q"][m, s]
            by_state = task.place.describe(q.min(axis=1), q.argmin(axis=1))
        return {"about": "\n".join(filter(None, about)), "by_state": by_state}

    def labels(self, params: TdParams) -> Mapping[str, str | tuple[str, ...]]:
        names = [LEARNING_METHODS[name] for name in params.methods]
        if len(set(names)) < len(names):
            names = [f"{name}, {order}" for name, order in zip(names, ORDER, strict=True)]
        grid, place = params.system == "grid", params.task.place
        states = place.table.states if isinstance(place, TableWorld) else ()
        return {
            "state_names": states,
            "method": tuple(names),
            "first": names[0],
            "second": names[1] if len(names) > 1 else "",
            "optimal": "" if params.task.no_optimum_message else "optimal",
            "distance": "RMS, dashed: largest"
            if params.task.compared.any()
            else "no Q* with γ = 1",
            "across": "column" if grid else "angle from upright [rad]",
            "up": "row from below" if grid else "velocity [rad/s]",
        }

    def draw(self, scene: Scene, params: TdParams, state: TdState) -> None:
        task, training, (m, s) = params.task, _training_on_map(params, state), params.view
        tables, known = training["q"][:, s], training["visits"][m, s].any(axis=1)
        V, policy = tables[m].min(axis=1), tables[m].argmin(axis=1)
        if isinstance(state.walk, Swing):
            assert isinstance(task.place, PendulumGrid)
            names = [LEARNING_METHODS[name] for name in params.methods]
            high = float(task.q_star.min(axis=1).max())
            draw_table(scene, task.place, V, high, policy, state.walk, names, known=known)
            return
        low, high = _color_range(task, V)
        if isinstance(task.place, TableWorld):
            draw_states(scene, task.place, V, (low, high), policy)
            draw_walkers(scene, task.place, state.walk)
            return
        assert isinstance(task.place, GridWorld)
        draw_board(scene, task.place, V, high, policy, low=low, known=known)
        for i, q in enumerate(tables):
            draw_path(scene, task.place, nominal_path(task.place, q.argmin(axis=1)), i)
        draw_walkers(scene, task.place, state.walk)

    @classmethod
    def prepare(cls) -> None:
        """Compiles the loops of all methods, which the worlds share, and the draws of the walkers
        where moves are random."""
        lab = cls()
        uniform(random_states(np.random.default_rng(0), 1)[0])
        for method in LEARNING_METHODS:
            params = TdParams(method=method, second="none")
            state = lab.init(params, np.random.default_rng(0))
            lab.step(params, Inputs(), lab.accept(params, state, next(lab.solve(params, state))))


def _training_on_map(params: TdParams, state: TdState) -> Training:
    """What was learned, on the map of now."""
    task, training = params.task, state.training
    return training if fits_task(training, task) else transfer(training, task, params.q0)


def _color_range(task: ControlTask, V: np.ndarray) -> tuple[float, float]:
    """The ends of the scale of colours: the values to be learned, and above them the largest
    estimate, within reason."""
    low, high = value_span(task.q_star[task.compared].min(axis=1))
    return low, float(np.clip(V.max(), high, max(high, 3.0 * high)))


def _divergence_message(training: Training) -> str:
    return (
        f"The estimates diverged by episode {episodes_done(training)}: what a trace adds to an "
        "estimate overshoots. Take a smaller step size or trace decay, or replacing traces."
    )
