"""Markov chains and reward processes (notes, 3.3.1 to 3.3.4): a token walks a graph."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.algorithms.markov_chain import iterate_values
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.reinforcement_learning.markov.chains import format_rows, parse_rows
from labs.reinforcement_learning.markov.description import describe_chain, describe_value
from labs.reinforcement_learning.markov.graph import TOKEN_OFFSET, token_place
from labs.reinforcement_learning.markov.params import STATE_NUMBERS, MarkovParams
from labs.reinforcement_learning.markov.picture import draw_chain
from labs.reinforcement_learning.markov.plots import PLOTS, discount_curves
from labs.reinforcement_learning.markov.random_walk import (
    RandomWalk,
    advance_random_walk,
    start_random_walk,
)
from labs.scene import Scene

MAX_SWEEPS, UNENDING_SWEEPS = 1000, 200
"""Iterations of V at most; where V has no limit."""
REST_SHARE, MAX_ANIMATED_PACE = 0.4, 6.0
"""The part of a step that the token rests; at more steps a second it jumps."""


@dataclass(kw_only=True)
class MarkovState(State):
    """The walk of the token, and how far V has been iterated."""

    walk: RandomWalk
    V: np.ndarray
    """(X,) the iterate V_k."""
    errors: np.ndarray
    """(k + 1,) max|V_j - V| for j = 0..k; empty where there is no V."""
    bounds: np.ndarray
    """(k + 1,) gamma^j max|V_0 - V|."""


class Markov(Lab[MarkovParams, MarkovState]):
    """A Markov chain that is walked, edited and given a value."""

    title = "Markov chains"
    section = "3.3"
    summary = (
        "A token walks a graph whose probabilities you drag: where it ends up, what the "
        "eigenvalues know about it, and what its costs are worth at any discount."
    )
    Params = MarkovParams
    period = 0.02
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Lights that hesitate": {"chain": "lights", "source": "1", "target": "1", "shift": 0.2},
        "A gambler's ruin": {"chain": "gambler", "gamma": 1.0},
        "A machine, mended half the time": {"chain": "machine", "first": 0.5},
    }
    handles = (
        Handle("token", "Sets the walker down on the nearest state."),
        Handle(
            "tile",
            "A click chooses this state as the one its transitions lead out of.",
            len(STATE_NUMBERS),
        ),
        Handle("bead", "The probability of the transition to this state.", len(STATE_NUMBERS)),
    )

    def init(self, params: MarkovParams, rng: np.random.Generator) -> MarkovState:
        P, none = params.process.P, np.zeros(0)
        walk = start_random_walk(P, 0, int(rng.integers(2**62)))
        return MarkovState(walk=walk, V=np.zeros(len(P)), errors=none, bounds=none)

    def step(self, params: MarkovParams, inputs: Inputs, state: MarkovState) -> MarkovState:
        process, held = params.process, inputs.handles.get("token")
        if held is None:
            walk = advance_random_walk(process.P, state.walk, params.pace * self.period)
        else:  # Set down on the nearest tile, it begins anew.
            x = int(np.argmin(np.hypot(*(process.places - held)[:, :2].T)))
            walk = start_random_walk(process.P, x, state.walk.key + 1)
        return replace(state, t=state.t + self.period, walk=walk)

    def solve(self, params: MarkovParams, state: MarkovState) -> Iterator[Snapshot]:
        """Always from V_0 = 0, so that the errors tell the whole way."""
        process, gamma = params.process, params.gamma
        exact, V0 = process.cost_to_go(gamma), np.zeros(len(process.C))
        most = MAX_SWEEPS if exact.finite.all() else UNENDING_SWEEPS
        for k, found in enumerate(iterate_values(process.P, process.C, gamma, V0, exact, most), 1):
            data = {"V": found.V, "errors": found.errors, "bounds": found.bounds}
            yield Snapshot(k, data, found.done, found.progress)

    def accept(self, params: MarkovParams, state: MarkovState, snapshot: Snapshot) -> MarkovState:
        return replace(state, **snapshot.data)

    def edit(
        self, params: MarkovParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """A tile chooses its state; a bead is the probability of its ribbon."""
        kind, _, number = handle.partition(" ")
        if kind == "tile" and number in STATE_NUMBERS:
            return {"source": number}
        process, (x, _) = params.process, params.chosen_states
        if (
            kind != "bead"
            or number not in STATE_NUMBERS
            or not process.can_edit(x, int(number) - 1)
        ):
            return {}
        row = process.row_with_bead_at(x, int(number) - 1, np.array(point))
        return {"rows": format_rows(parse_rows(params.rows) | {x: row}), "shift": 0.0}

    def measure(self, params: MarkovParams, state: MarkovState) -> Measurement:
        process, walk, (x, _) = params.process, state.walk, params.chosen_states
        far, visited = process.long_run[walk.start], walk.visits / walk.visits.sum()
        found = process.cost_to_go(params.gamma)
        measured: dict[str, float | np.ndarray] = {
            "mu": walk.mu,
            "far": far,
            "visited": visited,
            "steps": float(walk.steps),
            "off": round(50.0 * float(np.abs(walk.mu - far).sum()), 10),  # no rounding errors
            "visits_off": 50.0 * float(np.abs(visited - far).sum()),
            "step_cost": float(far @ process.C),
        }
        known = {
            "second": np.abs(process.eigenvalues[1:2]),
            "value": found.values_or_nan[x : x + 1],
        }
        known = {name: value for name, value in known.items() if np.isfinite(value).any()}
        return measured | {name: float(value[0]) for name, value in known.items()}

    def fields(self, params: MarkovParams, state: MarkovState) -> Mapping[str, np.ndarray]:
        process = params.process
        return discount_curves(process, params.gamma) | {
            "mu": state.walk.mu,
            "far": process.long_run[state.walk.start],
            "re": process.eigenvalues.real,
            "im": process.eigenvalues.imag,
            "P": process.P,
            "V": state.V,
            "exact": process.cost_to_go(params.gamma).values_or_nan,
            "sweep": np.arange(len(state.errors), dtype=float),
            "error": state.errors,
            "bound": state.bounds,
            "Q": process.action_values(params.gamma, state.V),
        }

    def notes(self, params: MarkovParams, state: MarkovState) -> Mapping[str, str]:
        process = params.process
        return {
            "chain": describe_chain(process, *params.chosen_states),
            "value": describe_value(process, params.gamma),
        }

    def labels(self, params: MarkovParams) -> Mapping[str, tuple[str, ...]]:
        return {"state": params.process.table.states}

    def draw(self, scene: Scene, params: MarkovParams, state: MarkovState) -> None:
        process, walk, (source, target) = params.process, state.walk, params.chosen_states
        flow = walk.mu + walk.phase * (walk.next_mu - walk.mu)
        draw_chain(scene, process, flow, source, process.bead_targets(source, target))
        token = process.places[walk.at] + TOKEN_OFFSET
        if walk.phase > REST_SHARE and params.pace < MAX_ANIMATED_PACE:
            part = (walk.phase - REST_SHARE) / (1.0 - REST_SHARE)
            token = token_place(process.places, walk.at, walk.to, part)
        scene.sphere("walker", token, 0.055, "reference")
        scene.handle("token", token, 0.075)
