"""Dynamic programming (notes, 2.2 and 3.4): four iterations side by side, and a finite horizon, on
a grid world and on a pendulum."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.lab import Action, Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.number_texts import count_text
from labs.params import Value
from labs.reinforcement_learning.dynamic_programming.follower import (
    PERIOD,
    PolicyFollower,
    apply_push,
    carry_over,
    follow_policy,
    start_follower,
)
from labs.reinforcement_learning.dynamic_programming.iteration_comparison import (
    ITERATION_METHODS,
    RANDOM_CONTROL,
    Iterates,
    IterationSettings,
    convergence_curves,
    iteration_report,
    progress,
    run_passes,
    unpack_policy,
)
from labs.reinforcement_learning.dynamic_programming.params import DynamicProgrammingParams
from labs.reinforcement_learning.dynamic_programming.plots import (
    PLOTS,
    POINTS,
    horizon_curves,
    table_maps,
    table_sizes,
)
from labs.reinforcement_learning.dynamic_programming.tasks import (
    TabularTask,
    cold_start,
    finite_horizon,
    tabular_task,
    warm_start,
)
from labs.scene import Scene
from labs.tasks.grid_world.cells import CellWorld
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.grid_world.params import BOOK_WORLDS, edit_map
from labs.tasks.grid_world.picture import draw_board, draw_path, draw_walkers, value_span
from labs.tasks.grid_world.walk import GridWalk, nominal_path
from labs.tasks.mdp_table.params import EXAMPLE_TABLES
from labs.tasks.mdp_table.picture import draw_states
from labs.tasks.mdp_table.world import NO_NAMES_NOTE, TableWorld, table_world
from labs.tasks.pendulum_table.picture import draw_table
from labs.tasks.pendulum_table.swing import Swing
from labs.tasks.pendulum_table.table import PendulumGrid, table_size


@dataclass(kw_only=True)
class DynamicProgrammingState(State):
    """How far the iterations have come, and who follows them where."""

    seed: int
    """Of all that is drawn."""
    task: str
    """The key of what `iterates` are about, ..."""
    settings: IterationSettings
    spread: float
    """... and how they came about."""
    iterates: Iterates
    follower: PolicyFollower

    @property
    def tabular_task(self) -> TabularTask:
        """What `iterates` are about."""
        return tabular_task(self.task)


class DynamicProgramming(Lab[DynamicProgrammingParams, DynamicProgrammingState]):
    """Tables of values and policies, found sweep by sweep and put to use."""

    title = "Dynamic programming"
    section = "3.4"
    summary = (
        "Policy and value iteration side by side, sweep by sweep, on a map you edit and on a "
        "pendulum that swings up by a lookup table."
    )
    Params = DynamicProgrammingParams
    period = PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Four by four": {"map": MAPS["4x4"], "gamma": 1.0, "shown": "evaluation"},
        "Cliff": {"map": MAPS["cliff"], "gamma": 1.0},
        "Windy": {"map": MAPS["windy"], "gamma": 1.0},
        **BOOK_WORLDS,
        "Taxicab": {"world": "table", "table": EXAMPLE_TABLES["Taxicab"], "gamma": 0.9},
        "Little time left": {"shown": "finite", "gamma": 1.0, "to_go": 9},
        "Pendulum": {"world": "pendulum", "gamma": 0.98},
        "Coarse pendulum": {"world": "pendulum", "gamma": 0.98, "nodes": 21},
        "Fine pendulum": {"world": "pendulum", "gamma": 0.98, "nodes": 101, "levels": 11},
    }
    actions = (
        Action("again", "Start again", "Back to the start: S, or hanging at rest."),
        Action("push", "Push", "The pendulum gets 4 rad/s; the walker lands in some other cell."),
    )
    handles = (Handle("board", "A click puts the brush's cell on the map."),)

    @classmethod
    def prepare(cls) -> None:
        rng = np.random.default_rng(0)
        for changes in ({}, {"world": "pendulum", "nodes": 11}):
            params = cls.Params().change(changes)
            lab, state = cls(), cls().init(params, rng)
            lab.accept(params, state, next(lab.solve(params, state)))

    def init(
        self, params: DynamicProgrammingParams, rng: np.random.Generator
    ) -> DynamicProgrammingState:
        seed = int(rng.integers(2**31))
        return DynamicProgrammingState(
            seed=seed,
            task=params.task,
            settings=params.settings,
            spread=params.spread,
            iterates=cold_start(params.task, seed, params.spread),
            follower=start_follower(tabular_task(params.task)),
        )

    def step(
        self, params: DynamicProgrammingParams, inputs: Inputs, state: DynamicProgrammingState
    ) -> DynamicProgrammingState:
        """10 ms of the walker's or the pendulum's life, under the policy shown."""
        if state.trouble:
            return state
        task, follower = state.tabular_task, state.follower
        if "again" in inputs.actions:
            follower = start_follower(task, follower.draws)
        if "push" in inputs.actions:
            follower = apply_push(task, follower, state.seed)
        policy: np.ndarray | None = state.iterates.policy[params.row]
        if params.shown == "finite":
            left = int(params.to_go) - follower.walk.steps
            _, stages = finite_horizon(state.task, params.w_f)
            policy = stages[left - 1] if left > 0 else None
        follower = follow_policy(task, follower, policy, state.seed)
        return replace(state, t=state.t + self.period, follower=follower)

    def solve(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Iterator[Snapshot]:
        """Sweep by sweep: on from where the state is, if it is about this; else from the values
        it holds, if wanted and they fit; else from the initial values."""
        key, settings, names = params.task, params.settings, list(ITERATION_METHODS)
        task = tabular_task(key)
        about = {"task": key, "settings": settings, "spread": params.spread}
        if about == {name: getattr(state, name) for name in about}:
            at, spent = state.iterates, np.array([state.seconds.get(m, 0.0) for m in names])
        else:
            at, spent = cold_start(key, state.seed, params.spread), np.zeros(len(names))
            if params.warm and key != state.task:
                at = warm_start(state.iterates, state.task, key, at)
        later = (
            run_passes(task.mdp, at, settings, task.limits) if not at.over else [(at, np.zeros(4))]
        )
        for i, (now, seconds) in enumerate(later, 1):
            spent = spent + seconds
            data = about | {"iterates": now, "seconds": dict(zip(names, spent, strict=True))}
            yield Snapshot(i, data, now.stop_reason, progress(now, settings.tolerance))

    def accept(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState, snapshot: Snapshot
    ) -> DynamicProgrammingState:
        """A pendulum that half-made policies have pushed about starts anew with the full table."""
        task, iterates = tabular_task(snapshot.data["task"]), snapshot.data["iterates"]
        follower = carry_over(task, state.follower)
        if isinstance(follower.walk, Swing) and iterates.over and not state.iterates.over:
            follower = start_follower(task, follower.draws)
        return replace(state, **snapshot.data, follower=follower)

    def edit(
        self,
        params: DynamicProgrammingParams,
        handle: str,
        point: tuple[float, float, float],
    ) -> Mapping[str, Value]:
        """The map with the cell clicked as the brush says."""
        return edit_map(params.map, params.brush, handle, point)

    def measure(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Measurement:
        task, walk, at = state.tabular_task, state.follower.walk, state.iterates
        shown, _ = _shown(params, state)
        mdp, row, paid, V = task.mdp, params.row, float(walk.cost[0]), shown
        if params.shown == "finite":
            left = max(int(params.to_go) - walk.steps, 0)
            V = finite_horizon(state.task, params.w_f)[0][left]
        states = table_size(int(params.joints), int(params.cuts))
        measured: dict[str, float | np.ndarray] = {
            "paid": paid,
            "promised": paid + mdp.gamma**walk.steps * float(V[task.state(walk.to[0])]),
            "at_start": float(shown[task.start]),
            "entries": float(mdp.X * mdp.U),
            "states": float(states),
            "memory": 8e-9 * states,
        }
        if not isinstance(walk, GridWalk):
            measured["angle"] = float(walk.at[0, 0] % (2 * np.pi) - np.pi)
            measured["torque"] = float(walk.torque[0])
        if params.shown != "finite":
            measured |= {"sweeps": float(at.count[row]), "backups": float(at.backups[-1, row])}
            measured["error"] = float(at.errors[-1, row]) if at.started[row] else np.nan
        return {name: value for name, value in measured.items() if np.isfinite(value)}

    def fields(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Mapping[str, np.ndarray]:
        task = state.tabular_task
        stages, _ = finite_horizon(state.task, params.w_f)
        V, policy = _shown(params, state)
        if policy is not None and policy[0] == RANDOM_CONTROL:
            policy = unpack_policy(task.mdp, policy)
        return {
            **convergence_curves(state.iterates, task.mdp.gamma, POINTS),
            **horizon_curves(task, stages, int(params.to_go)),
            **table_maps(task, V, policy),
            **table_sizes(int(params.joints), int(params.cuts)),
        }

    def results(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Mapping[str, np.ndarray]:
        """Of the four methods V, NaN where one is not begun, and the number of the control that its
        policy takes, -1 where it takes all alike: (4, X); of a table the names."""
        at, place = state.iterates, state.tabular_task.place
        V = np.where(at.started[:, None], at.V, np.nan)
        if isinstance(place, TableWorld):
            return place.results(V, at.policy)
        return {"V": V, "greedy_control": at.policy}

    def notes(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Mapping[str, str]:
        mdp = state.tabular_task.mdp
        place, (V, policy) = state.tabular_task.place, _shown(params, state)
        about = mdp.describe([state.tabular_task.start])
        if mdp.terminal.any() and not mdp.can_end.all():
            about += (
                f"\nFrom {count_text(int((~mdp.can_end).sum()), 'state')} no way leads to a goal."
            )
        by_state = NO_NAMES_NOTE
        if isinstance(place, CellWorld):
            about = "\n".join([about, *place.notes])
        if isinstance(place, TableWorld):
            random = policy is None or policy[0] == RANDOM_CONTROL
            by_state = place.describe(V, None if random else policy)
        report = iteration_report(state.iterates, state.seconds)
        return {"account": report, "about": about, "by_state": by_state}

    def labels(self, params: DynamicProgrammingParams) -> Mapping[str, str | tuple[str, ...]]:
        states = table_world(params.table).table.states if params.world == "table" else ()
        if params.world == "pendulum":
            across, up = "angle from upright [rad]", "velocity [rad/s]"
        else:
            across, up = "column", "row from below"
        return {"state_names": states, "across": across, "up": up}

    def draw(
        self, scene: Scene, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> None:
        task, walk = state.tabular_task, state.follower.walk
        V, policy = _shown(params, state)
        finite = params.shown == "finite"
        limit = V if finite else task.limits[params.row]
        low, high = value_span(limit)
        if not isinstance(walk, GridWalk):
            assert isinstance(task.place, PendulumGrid)
            draw_table(scene, task.place, V, high, policy, walk)
            return
        random = policy is not None and policy[0] == RANDOM_CONTROL
        if isinstance(task.place, TableWorld):
            draw_states(scene, task.place, V, (low, high), None if random else policy)
            draw_walkers(scene, task.place, walk)
            return
        assert isinstance(task.place, GridWorld)
        if policy is not None and random:
            policy = unpack_policy(task.mdp, policy)
        draw_board(scene, task.place, V, high, policy, low=low, relief=True)
        draw_path(scene, task.place, nominal_path(task.place, task.solution[1]), 1)
        if finite:
            _, policies = finite_horizon(state.task, params.w_f)
            draw_path(scene, task.place, nominal_path(task.place, policies[: int(params.to_go)]), 0)
        draw_walkers(scene, task.place, walk)


def _shown(
    params: DynamicProgrammingParams, state: DynamicProgrammingState
) -> tuple[np.ndarray, np.ndarray | None]:
    """The values (X,) and the policy (X,) shown: NaN where the iteration is not begun, None where
    no time is left."""
    if params.shown != "finite":
        at, row = state.iterates, params.row
        return at.V[row] if at.started[row] else np.full_like(at.V[row], np.nan), at.policy[row]
    values, policies = finite_horizon(state.task, params.w_f)
    left = int(params.to_go)
    return values[left], policies[left - 1] if left else None
