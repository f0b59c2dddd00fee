"""n-step TD and TD(lambda) (notes, 3.5.5 and 3.5.6): how far to look ahead, and how far back."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.problems.prediction import root_mean_square_error
from labs.random_numbers import random_states
from labs.reinforcement_learning.td_lambda.params import TD_METHODS, TdLambdaParams
from labs.reinforcement_learning.td_lambda.partial_episode import (
    PartialEpisode,
    draw_episode,
    eligibility,
    n_step_returns,
    return_weights,
    updated_values,
)
from labs.reinforcement_learning.td_lambda.picture import draw_place
from labs.reinforcement_learning.td_lambda.plots import (
    ORDER,
    PLOTS,
    gap_curves,
    place_maps,
    sweep_curves,
    sweep_numbers,
)
from labs.reinforcement_learning.td_lambda.sweep import (
    EMPTY_SWEEP,
    SweepErrors,
    family_names,
    run_sweep,
)
from labs.scene import Scene
from labs.tasks.grid_world.map import MAPS
from labs.tasks.grid_world.params import edit_map
from labs.tasks.random_walk.picture import state_names
from labs.tasks.random_walk.walks import NINETEEN_STATE_WALK

ROUNDING = 1e-9
REST = 3.0
"""Steps that a walker rests at the end of an episode."""
HISTORY_LENGTH = 1000
"""Episodes whose errors are kept; older ones are dropped."""


@dataclass(kw_only=True)
class TdLambdaState(State):
    """A walk that one or two methods learn from, and what was measured of them."""

    seed: np.ndarray
    """(4,) uint64: of the learners that are measured."""
    random: np.ndarray
    """(4,) uint64: of the walk's episodes."""
    steps: PartialEpisode
    before: np.ndarray
    """(M, X) the values before this episode."""
    values: np.ndarray
    """(M, X) the values now."""
    wait: float = 0.0
    """The part of a step since the last one."""
    episodes: int = 0
    changed: np.ndarray
    """(M,) how many values the last episode changed; none before the first."""
    gaps: np.ndarray
    """(k,) largest difference of both methods' values after each episode."""
    sweep: SweepErrors


class TdLambda(Lab[TdLambdaParams, TdLambdaState]):
    """The way between TD(0) and Monte Carlo, by n and by lambda."""

    title = "n-step TD and TD(λ)"
    section = "3.5.5"
    summary = (
        "How far ahead to look before trusting the table: n-step returns, all of them at once by "
        "TD(λ), eligibility traces that glow, and the U-shaped curves of the error, measured live."
    )
    Params = TdLambdaParams
    period = 0.01
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Traces on the walk": {},
        "n-step TD": {"method": "n-step"},
        "Forward and backward, offline": {
            "method": "forward", "second": "backward", "offline": True, "alpha": 0.1,
        },
        "True online beside the traces": {"method": "true-online", "second": "backward"},
        "A trail through rooms": {"system": "grid", "lam": 0.9},
        "A trail along the cliff": {"system": "grid", "map": MAPS["cliff"], "lam": 0.9},
    }  # fmt: skip
    handles = (Handle("board", "A click puts the brush's cell on the map."),)

    def init(self, params: TdLambdaParams, rng: np.random.Generator) -> TdLambdaState:
        place = params.place
        seed, random = random_states(rng, 2)
        nothing = np.zeros((len(params.methods), len(place.task.truth)))
        return TdLambdaState(
            seed=seed,
            steps=draw_episode(place, random),
            random=random,
            before=nothing,
            values=nothing,
            changed=np.zeros(0, int),
            gaps=np.zeros(0),
            sweep=EMPTY_SWEEP,
        )

    def step(self, params: TdLambdaParams, inputs: Inputs, state: TdLambdaState) -> TdLambdaState:
        """10 ms of the walk."""
        if state.trouble:
            return state
        state = replace(state, t=state.t + self.period, wait=state.wait + params.rate * self.period)
        if state.steps.over and state.wait >= 1.0 + REST - ROUNDING:
            random = state.random.copy()
            steps = draw_episode(params.place, random)
            return replace(state, steps=steps, random=random, before=state.values, wait=0.0)
        if not state.steps.over and (state.wait >= 1.0 - ROUNDING or state.steps.done == 0):
            return _advance_walk(params, state)
        return state

    def solve(self, params: TdLambdaParams, state: TdLambdaState) -> Iterator[Snapshot | None]:
        """A setting of the sweep an iteration; what was measured before stays."""
        return run_sweep(params, state.seed, state.sweep)

    def accept(
        self, params: TdLambdaParams, state: TdLambdaState, snapshot: Snapshot
    ) -> TdLambdaState:
        return replace(state, sweep=snapshot.data)

    def edit(
        self, params: TdLambdaParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The map with the cell clicked as the brush says."""
        return edit_map(params.map, params.brush, handle, point)

    def measure(self, params: TdLambdaParams, state: TdLambdaState) -> Measurement:
        numbers: dict[str, float | np.ndarray] = {
            "error": root_mean_square_error(params.place.task, state.values),
            "episodes": float(state.episodes),
        }
        for name, count in zip(ORDER, state.changed, strict=False):
            numbers[f"changed_{name}"] = float(count)
        if len(state.gaps):
            numbers["gap"] = float(state.gaps[-1])
        return numbers | sweep_numbers(params, state.sweep)

    def fields(self, params: TdLambdaParams, state: TdLambdaState) -> Mapping[str, np.ndarray]:
        place, steps, rule = params.place, state.steps, params.rule(params.method)
        gamma, before = place.task.task.gamma, state.before[0]
        returns = n_step_returns(gamma, before, steps)
        weights = return_weights(params.method, rule, len(returns))
        ends = np.array([1.0, max(len(returns), 2)])
        return {
            "weights": return_weights(params.method, rule, round(params.ahead)),
            "return_n": np.arange(1.0, len(returns) + 1),
            "returns": returns,
            "return_ends": ends if len(returns) else np.zeros(0),
            "target": np.full(2 if len(returns) else 0, weights @ returns),
            "true_value": np.full(2 if len(returns) else 0, place.task.truth[place.start]),
            **gap_curves(place, state.gaps, state.episodes),
            **place_maps(place, _eligibility_trace(params, state), state.values),
            **sweep_curves(params, state.sweep),
        }

    def notes(self, params: TdLambdaParams, state: TdLambdaState) -> Mapping[str, str]:
        return {"about": "\n".join(params.place.about)}

    def labels(self, params: TdLambdaParams) -> Mapping[str, str | tuple[str, ...]]:
        names = [TD_METHODS[name] for name in params.methods]
        if len(set(names)) < len(names):
            names = [f"{name}, {order}" for name, order in zip(names, ORDER, strict=True)]
        return {
            "method": tuple(names),
            "first": names[0],
            "second": names[-1],
            "family": family_names(params.method),
            "member": "n" if params.method == "n-step" else "λ",
            "states": state_names(NINETEEN_STATE_WALK) if params.system == "walk" else (),
        }

    def draw(self, scene: Scene, params: TdLambdaParams, state: TdLambdaState) -> None:
        part = min(state.wait, 1.0)
        glow, trace = params.shown == "traces", _eligibility_trace(params, state)
        draw_place(scene, params.place, state.steps, part, trace, list(state.values), glow)

    @classmethod
    def prepare(cls) -> None:
        """Compiles the loops of all methods; the worlds share them."""
        lab = cls()
        for method in TD_METHODS:
            params = TdLambdaParams(method=method, episodes=1.0, rate=100.0)
            state = lab.init(params, np.random.default_rng(0))
            next(snapshot for snapshot in lab.solve(params, state) if snapshot)
            for _ in range(2 + round(params.n)):
                state = lab.step(params, Inputs(), state)


def _advance_walk(params: TdLambdaParams, state: TdLambdaState) -> TdLambdaState:
    """One step of the walk later."""
    place, steps = params.place, state.steps._replace(done=state.steps.done + 1)
    values = np.array([
        updated_values(place, method, params.rule(method), V, steps)
        for method, V in zip(params.methods, state.before, strict=True)
    ])  # fmt: skip
    state = replace(state, steps=steps, wait=0.0)
    for method, V in zip(params.methods, values, strict=True):
        if not np.abs(V).max() <= params.rule(method).limit:
            return replace(state, trouble=_divergence_message(method, state.episodes + 1))
    state = replace(state, values=values)
    if not steps.over:
        return state
    changed = (values != state.before).sum(axis=1)
    gaps = np.append(state.gaps, np.abs(values[0] - values[-1]).max())[-HISTORY_LENGTH:]
    return replace(state, episodes=state.episodes + 1, changed=changed, gaps=gaps)


def _eligibility_trace(params: TdLambdaParams, state: TdLambdaState) -> np.ndarray:
    """(X,) of the first method; none once the walker rests."""
    rule, states = params.rule(params.method), state.values.shape[1]
    return eligibility(params.gamma, params.method, rule, state.steps, states)


def _divergence_message(method: str, episode: int) -> str:
    return (
        f"In episode {episode} the values diverged ({TD_METHODS[method]}): states that come again "
        "and again pile up a trace, and a surprise moves them too far. Take a smaller step size or "
        "trace decay, or the method True online, and reset."
    )
