"""Dynamic programming (notes, 2.2 and 3.4): four iterations side by side, and a finite horizon, on
a grid world and on a pendulum."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.lab import Action, Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.plots import Curves, HeatMap, Line, Note, Readout, TimeSeries, Trace
from labs.reinforcement_learning.dynamic_programming.params import NAMES, DynamicProgrammingParams
from labs.reinforcement_learning.dynamic_programming.picture import (
    Picture,
    board,
    draw_grid,
    draw_pendulum,
)
from labs.reinforcement_learning.dynamic_programming.problems import (
    HORIZON,
    Walk,
    afresh,
    begin,
    carried,
    finite_horizon,
    fits,
    nudged,
    problem,
    state_of,
    tick,
)
from labs.reinforcement_learning.dynamic_programming.side_by_side import (
    METHODS,
    Rules,
    Standing,
    account,
    curves,
    passes,
    progress,
)
from labs.scene import Scene, cell_at
from labs.tasks.grid_world.map import MAPS, GridWorld
from labs.tasks.pendulum_table.table import table_size

JOINTS = np.arange(1.0, 8.0)
POINTS, PIXELS = 250, 51
"""Of a curve and along one side of a heat map, at most."""


@dataclass(kw_only=True)
class DynamicProgrammingState(State):
    """How far the iterations have come, and who follows them where."""

    seed: int
    """Of all that is drawn."""
    problem: str
    """What `standing` is about, ..."""
    rules: Rules
    spread: float
    """... and how it came about."""
    standing: Standing
    walk: Walk


def _traces(x: str, y: str) -> tuple[Trace, ...]:
    return tuple(
        Trace(f"{x}_{m}", f"{y}_{m}", name, series=i + 1)
        for i, (m, name) in enumerate(METHODS.items())
    )


class DynamicProgramming(Lab[DynamicProgrammingParams, DynamicProgrammingState]):
    """Tables of values and policies, found sweep by sweep and put to use."""

    title = "Dynamic programming"
    section = "3.4"
    summary = (
        "Policy and value iteration side by side, sweep by sweep, on a map you edit and on a "
        "pendulum that swings up by a lookup table."
    )
    Params = DynamicProgrammingParams
    period = 0.01
    plots = (
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
            "cost",
            Line("paid", r"\text{paid}"),
            Line("promised", r"\text{paid} + \gamma^k V(x_k)", "limit"),
        ),
        TimeSeries("Pendulum from upright", "rad", Line("angle", r"q - q^*")),
        TimeSeries("Torque of the pendulum", "N·m", Line("torque", r"u")),
        HeatMap(
            "Cost-to-go",
            "across",
            "up",
            "V",
            "column; angle from upright [rad]",
            "row from below; velocity [rad/s]",
            "V",
            gaps=True,
        ),
        HeatMap(
            "Policy",
            "across",
            "up",
            "control",
            "column; angle from upright [rad]",
            "row from below; velocity [rad/s]",
            "control, from 0; torque [N·m]",
            gaps=True,
        ),
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
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Four by four": {"map": MAPS["4x4"], "gamma": 1.0, "shown": "evaluation"},
        "Cliff": {"map": MAPS["cliff"], "gamma": 1.0},
        "Windy": {"map": MAPS["windy"], "gamma": 1.0},
        "Little time left": {"shown": "finite", "gamma": 1.0, "to_go": 9},
        "Pendulum": {"world": "pendulum", "gamma": 0.98},
        "Coarse pendulum": {"world": "pendulum", "gamma": 0.98, "nodes": 21},
        "Fine pendulum": {"world": "pendulum", "gamma": 0.98, "nodes": 101, "levels": 11},
    }
    actions = (
        Action("again", "Start again", "Back to the start: S, or hanging at rest."),
        Action("push", "Push", "The pendulum gets 4 rad/s; the walker lands in some other cell."),
    )

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
            problem=params.key,
            rules=params.rules,
            spread=params.spread,
            standing=afresh(params.key, seed, params.spread),
            walk=begin(problem(params.key)),
        )

    def step(
        self, params: DynamicProgrammingParams, inputs: Inputs, state: DynamicProgrammingState
    ) -> DynamicProgrammingState:
        """10 ms of the walker's or the pendulum's life, under the policy shown."""
        if state.trouble:
            return state
        found, walk = problem(state.problem), state.walk
        if "again" in inputs.actions:
            walk = begin(found, walk.drawn)
        if "push" in inputs.actions:
            walk = nudged(found, walk, state.seed)
        policy: np.ndarray | None = state.standing.policy[params.row]
        if params.shown == "finite":
            left = int(params.to_go) - walk.steps
            _, stages = finite_horizon(state.problem, params.w_f)
            policy = stages[left - 1] if left > 0 else None
        return replace(state, t=state.t + self.period, walk=tick(found, walk, policy, state.seed))

    def solve(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Iterator[Snapshot]:
        """Sweep by sweep: on from where the state is, if it is about this; else from the values
        it holds, if wanted and they fit; else afresh."""
        key, rules = params.key, params.rules
        mdp, limits = problem(key).mdp, problem(key).limits
        about = {"problem": key, "rules": rules, "spread": params.spread}
        if about == {name: getattr(state, name) for name in about}:
            at, spent = state.standing, np.array([state.seconds.get(m, 0.0) for m in NAMES])
        else:
            fresh = afresh(key, state.seed, params.spread)
            warm = params.warm and key != state.problem
            at = carried(state.standing, state.problem, key, fresh) if warm else fresh
            spent = np.zeros(len(NAMES))
        on_the_way = passes(mdp, at, rules, limits) if not at.over else [(at, np.zeros(4))]
        for i, (now, seconds) in enumerate(on_the_way, 1):
            spent = spent + seconds
            data = about | {"standing": now, "seconds": dict(zip(NAMES, spent, strict=True))}
            yield Snapshot(i, data, now.verdict, progress(now, rules.tolerance))

    def accept(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState, snapshot: Snapshot
    ) -> DynamicProgrammingState:
        found, walk = problem(snapshot.data["problem"]), state.walk
        return replace(
            state, **snapshot.data, walk=walk if fits(found, walk) else begin(found, walk.drawn)
        )

    def edit(
        self,
        params: DynamicProgrammingParams,
        handle: str,
        point: tuple[float, float, float],
    ) -> Mapping[str, Value]:
        world = GridWorld.parse(params.map, params.kings)
        cell = cell_at(point, *board(world), *world.shape)
        if handle != "board" or cell is None:
            return {}
        row, column = cell
        wall = world.rows[row][column] == "#" == params.brush
        return {"map": world.changed(row, column, "." if wall else params.brush).text}

    def measure(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Measurement:
        found, walk, at = problem(state.problem), state.walk, state.standing
        (V, _), mdp, row = _shown(params, state), found.mdp, params.row
        if params.shown == "finite":
            left = max(int(params.to_go) - walk.steps, 0)
            V = finite_horizon(state.problem, params.w_f)[0][left]
        states = table_size(int(params.joints), int(params.cuts))
        measured: dict[str, float | np.ndarray] = {
            "paid": walk.paid,
            "promised": walk.paid + mdp.gamma**walk.steps * float(V[state_of(found, walk.to)]),
            "at_start": float(_shown(params, state)[0][found.start]),
            "entries": float(mdp.X * mdp.U),
            "states": float(states),
            "memory": 8e-9 * states,
        }
        if params.world == "pendulum":
            turning = walk.steps > 0 and not walk.resting
            measured["angle"] = float(walk.at[0] % (2 * np.pi) - np.pi)
            measured["torque"] = float(found.efforts[walk.u]) if turning else 0.0
        if params.shown != "finite":
            measured |= {"sweeps": float(at.count[row]), "backups": float(at.backups[-1, row])}
            measured["error"] = float(at.errors[-1, row]) if at.begun[row] else np.nan
        return {name: value for name, value in measured.items() if not np.isnan(value)}

    def fields(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Mapping[str, np.ndarray]:
        found = problem(state.problem)
        V, policy = _shown(params, state)
        stages, _ = finite_horizon(state.problem, params.w_f)
        best = float(found.limits[3, found.start])
        controls = np.full(found.mdp.X, np.nan) if policy is None else policy.astype(float)
        if isinstance(found.place, GridWorld):
            rows, columns = found.place.shape
            across, up = np.arange(1.0, columns + 1), np.arange(1.0, rows + 1)
            values, control = (found.place.on_map(x, np.nan)[::-1] for x in (V, controls))
        else:
            every = -(-found.place.q_nodes // PIXELS)
            across, up = found.place.angles[::every], found.place.velocities[::every]
            tables = (V, controls if policy is None else found.efforts[policy])
            values, control = (x.reshape(found.place.shape)[::every, ::every].T for x in tables)
        return curves(state.standing, found.mdp.gamma, POINTS) | {
            "stages": np.arange(HORIZON + 1.0),
            "stage_values": stages[:, found.start],
            "ends": np.array([0.0, HORIZON] if np.isfinite(best) else []),
            "stationary": np.array([best, best] if np.isfinite(best) else []),
            "stage": np.array([float(int(params.to_go))]),
            "stage_value": stages[int(params.to_go), found.start : found.start + 1],
            "across": across,
            "up": up,
            "V": values,
            "control": control,
            "joints": JOINTS,
            "states": np.array([float(table_size(int(j), int(params.cuts))) for j in JOINTS]),
            "joint": np.array([float(int(params.joints))]),
            "state": np.array([float(table_size(int(params.joints), int(params.cuts)))]),
        }

    def notes(
        self, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> Mapping[str, str]:
        mdp = problem(state.problem).mdp
        about = mdp.report([problem(state.problem).start])
        if mdp.terminal.any() and not mdp.can_end.all():
            about += f"\nFrom {int((~mdp.can_end).sum())} states no way leads to a goal."
        return {"account": account(state.standing, state.seconds), "about": about}

    def draw(
        self, scene: Scene, params: DynamicProgrammingParams, state: DynamicProgrammingState
    ) -> None:
        found = problem(state.problem)
        V, policy = _shown(params, state)
        finite = params.shown == "finite"
        limit = V if finite else found.limits[params.row]
        top = float(np.abs(limit[np.isfinite(limit)]).max(initial=0.0)) or 1.0
        picture = Picture(found, V, top, policy)
        if isinstance(found.place, GridWorld):
            ways = {"reference": found.solution[1]}
            if finite:
                ways["actual"] = finite_horizon(state.problem, params.w_f)[1][: int(params.to_go)]
            draw_grid(scene, picture, found.place, state.walk, ways)
        else:
            draw_pendulum(scene, picture, found.place, state.walk)


def _shown(
    params: DynamicProgrammingParams, state: DynamicProgrammingState
) -> tuple[np.ndarray, np.ndarray | None]:
    """The values (X,) and the policy (X,) shown: NaN where the iteration is not begun, None where
    no time is left."""
    if params.shown != "finite":
        at, row = state.standing, params.row
        return at.V[row] if at.begun[row] else np.full_like(at.V[row], np.nan), at.policy[row]
    values, policies = finite_horizon(state.problem, params.w_f)
    left = int(params.to_go)
    return values[left], policies[left - 1] if left else None
