"""Markov chains and reward processes (notes, 3.3.1 to 3.3.4): a token walks a graph."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
from pydantic import field_validator
from pydantic_core.core_schema import ValidationInfo

from labs.algorithms.markov_chain import evaluate, mean_costs
from labs.errors import LabError
from labs.lab import Inputs, Lab, Measurement, Snapshot, State
from labs.params import Group, Params, Value
from labs.plots import Bars, Curves, Line, Matrix, Note, Readout, TimeSeries, Trace
from labs.reinforcement_learning.markov.chains import TITLES, parse_rows, table_of, write_rows
from labs.reinforcement_learning.markov.description import about_chain, about_value
from labs.reinforcement_learning.markov.graph import REST, on_the_way
from labs.reinforcement_learning.markov.picture import draw_chain
from labs.reinforcement_learning.markov.random_walk import Walk, advance, begin
from labs.reinforcement_learning.markov.reward_process import Edit, RewardProcess, reward_process
from labs.reinforcement_learning.markov.tables import parse
from labs.scene import Scene

MOST = 12
"""States that a circle and a chooser still hold."""
NUMBERS = {str(x + 1): str(x + 1) for x in range(MOST)}
GAMMAS = np.concatenate([np.linspace(0.0, 0.95, 39), np.linspace(0.96, 1.0, 11)])
SWEEPS, UNENDING = 1000, 200
"""Iterations of V at most; where V has no limit."""
WAIT, HURRY = 0.4, 6.0
"""The part of a step that the token rests; at more steps a second it jumps."""


CHAIN = Group("Chain", effect="restart")
PROBABILITIES = Group("Probabilities", effect="solve")
COSTS = Group("Costs", effect="solve")
WALK = Group("Walk")


class MarkovParams(Params):
    """What the user can turn."""

    chain: str = CHAIN.choice("student", TITLES, "Chain")
    """The states, their probabilities and costs. The machine has two controls."""
    number: float = CHAIN.knob(1.0, 1.0, 41.0, "n", "", "Which random chain", step=1.0)
    """Each number is another one of six states, for the random chain only."""
    table: str = CHAIN.text(
        "state, cost, Sun, Rain, Snow\nSun, 0, 2/3, 1/3, 0\nRain, 1, 1/2, 1/4, 1/4\n"
        "Snow, 3, 0, 1/2, 1/2",
        "Your table",
        rows=5,
        max_length=4000,
    )
    """For your own chain. CSV: a heading (state, control if any, cost, the states), then a row
    each; or JSON: [{"state": "A", "cost": 1, "to": {"A": 1}}]."""
    source: str = PROBABILITIES.choice("1", NUMBERS, "From state")
    """Whose beads lie on its ribbons; a click on a state's tile chooses it, too."""
    target: str = PROBABILITIES.choice("2", NUMBERS, "To state")
    """Where the transition leads whose probability is shifted."""
    shift: float = PROBABILITIES.knob(0.0, -1.0, 1.0, "s", "", "Shift it", step=0.01)
    """Down to -1: never. Up to 1: always. The others of its row keep their proportions."""
    rows: str = PROBABILITIES.text("", "Changed rows", rows=3, max_length=1000)
    """Beads that are dragged write here: a state and its weights, 1: 0 0.5 0.5. For chains without
    controls."""
    gamma: float = COSTS.knob(0.9, 0.0, 1.0, r"\gamma", "", "Discount", step=0.01)
    """What the cost of the next step counts today."""
    first: float = COSTS.knob(1.0, 0.0, 1.0, r"\pi(u_1 \mid x)", "", "First control", step=0.01)
    """How often the policy takes the first control of a table that has several, in every state; the
    others share what is left."""
    pace: float = WALK.knob(1.5, 0.2, 200.0, r"1/T", "1/s", "Steps a second", scale="log")
    """Of the token."""

    @field_validator("table", "rows")
    @classmethod
    def _can_be_read(cls, value: str, info: ValidationInfo) -> str:
        try:
            parse_rows(value) if info.field_name == "rows" else parse(value, MOST)
        except LabError as error:
            raise ValueError(str(error)) from None
        return value

    @property
    def places(self) -> tuple[int, int]:
        """The states chosen, from 0."""
        return int(self.source) - 1, int(self.target) - 1

    @property
    def process(self) -> RewardProcess:
        edit = (self.rows, *self.places, self.shift)
        return _process(self.chain, round(self.number), self.table, self.first, *edit)


@lru_cache(64)
def _process(
    name: str, number: int, own: str, first: float, rows: str, source: int, target: int, s: float
) -> RewardProcess:
    edit = Edit(parse_rows(rows), source, target, s)
    return reward_process(table_of(name, number, own), first, edit)


@dataclass(kw_only=True)
class MarkovState(State):
    """The walk of the token, and how far V has been iterated."""

    walk: Walk
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
    plots = (
        Note("The chain in words", "chain"),
        Bars("Distribution now, and in the long run", "mu", r"\mu_k", "", marks="far"),
        TimeSeries(
            "Probability of each state",
            "long run dashed",
            Line("mu", r"\mu"),
            Line("far", r"\bar\mu", "dash"),
            select="state",
        ),
        TimeSeries(
            "Share of the token's visits",
            "long run dashed",
            Line("visited", r"f"),
            Line("far", r"\bar\mu", "dash"),
            select="state",
        ),
        Curves(
            "Eigenvalues of P",
            "Re λ",
            "Im λ",
            Trace("re", "im", style="points", series=1),
            guide="unit-circle",
        ),
        Matrix("Transition matrix", "P", "P", shade=True),
        Note("The value in words", "value"),
        Bars("Cost-to-go by iteration, and exact", "V", r"V_k", "", marks="exact", gaps=True),
        Curves(
            "Error of the iteration",
            "iteration k",
            "error",
            Trace("sweep", "error", "max|Vₖ − V|", "line", 1),
            Trace("sweep", "bound", "γᵏ max|V₀ − V|", "dash", 2),
            log_y=True,
        ),
        Curves(
            "Mean cost (1 − γ) V over the discount",
            "γ",
            "cost of a step",
            *(
                Trace("gammas", f"mean_{x}", "other states" * (x == 1), "line", 7)
                for x in range(1, MOST + 1)
            ),
            Trace("gammas", "mean", "chosen state", "line", 1),
            Trace("now", "span", "γ now", "dash", 2),
        ),
        Matrix("Action values, a row a state", "Q", r"Q", shade=True),
        Readout("steps", "Steps walked", "", whole=True),
        Readout("off", "μ off the long run", "%"),
        Readout("visits_off", "Visits off the long run", "%"),
        Readout("second", "|λ₂|", ""),
        Readout("step_cost", "Cost of a step, long run", ""),
        Readout("value", "V, chosen state", ""),
    )
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Lights that hesitate": {"chain": "lights", "source": "1", "target": "1", "shift": 0.2},
        "A gambler's ruin": {"chain": "gambler", "gamma": 1.0},
        "A machine, mended half the time": {"chain": "machine", "first": 0.5},
    }

    def init(self, params: MarkovParams, rng: np.random.Generator) -> MarkovState:
        P, none = params.process.P, np.zeros(0)
        walk = begin(P, 0, int(rng.integers(2**62)))
        return MarkovState(walk=walk, V=np.zeros(len(P)), errors=none, bounds=none)

    def step(self, params: MarkovParams, inputs: Inputs, state: MarkovState) -> MarkovState:
        process, held = params.process, inputs.handles.get("token")
        if held is None:
            walk = advance(process.P, state.walk, params.pace * self.period)
        else:  # Set down on the nearest tile, it begins anew.
            x = int(np.argmin(np.hypot(*(process.where - held)[:, :2].T)))
            walk = begin(process.P, x, state.walk.key + 1)
        return replace(state, t=state.t + self.period, walk=walk)

    def solve(self, params: MarkovParams, state: MarkovState) -> Iterator[Snapshot]:
        """Always from V_0 = 0, so that the errors tell the whole way."""
        process, gamma = params.process, params.gamma
        exact, V0 = process.cost_to_go(gamma), np.zeros(len(process.C))
        most = SWEEPS if exact.finite.all() else UNENDING
        for k, found in enumerate(evaluate(process.P, process.C, gamma, V0, exact, most), 1):
            data = {"V": found.V, "errors": found.errors, "bounds": found.bounds}
            yield Snapshot(k, data, found.done, found.progress)

    def accept(self, params: MarkovParams, state: MarkovState, snapshot: Snapshot) -> MarkovState:
        return replace(state, **snapshot.data)

    def edit(
        self, params: MarkovParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """A tile chooses its state; a bead is the probability of its ribbon."""
        kind, _, number = handle.partition(" ")
        if kind == "tile" and number in NUMBERS:
            return {"source": number}
        process, (x, _) = params.process, params.places
        if kind != "bead" or number not in NUMBERS or not process.has(x, int(number) - 1):
            return {}
        row = process.dragged(x, int(number) - 1, np.array(point))
        return {"rows": write_rows(parse_rows(params.rows) | {x: row}), "shift": 0.0}

    def measure(self, params: MarkovParams, state: MarkovState) -> Measurement:
        process, walk, (x, _) = params.process, state.walk, params.places
        far, visited = process.far[walk.start], walk.visits / walk.visits.sum()
        found = process.cost_to_go(params.gamma)
        measured: dict[str, float | np.ndarray] = {
            "mu": walk.mu,
            "far": far,
            "visited": visited,
            "steps": float(walk.steps),
            "off": 50.0 * float(np.abs(walk.mu - far).sum()),
            "visits_off": 50.0 * float(np.abs(visited - far).sum()),
            "step_cost": float(far @ process.C),
        }
        known = {"second": np.abs(process.eigenvalues[1:2]), "value": found.known[x : x + 1]}
        known = {name: value for name, value in known.items() if np.isfinite(value).any()}
        return measured | {name: float(value[0]) for name, value in known.items()}

    def fields(self, params: MarkovParams, state: MarkovState) -> Mapping[str, np.ndarray]:
        process, last = params.process, len(params.process.P) - 1
        found = process.cost_to_go(params.gamma)
        means = mean_costs(process.P, process.C, GAMMAS, process.classes)
        # There are lines for MOST states: beyond the last one they lie on its own.
        lines = {f"mean_{x + 1}": means[:, min(x, last)] for x in range(MOST)}
        return lines | {
            "mu": state.walk.mu,
            "far": process.far[state.walk.start],
            "re": process.eigenvalues.real,
            "im": process.eigenvalues.imag,
            "P": process.P,
            "V": state.V,
            "exact": found.known,
            "sweep": np.arange(len(state.errors), dtype=float),
            "error": state.errors,
            "bound": state.bounds,
            "gammas": GAMMAS,
            "mean": lines[f"mean_{params.source}"],
            "now": np.full(2, params.gamma),
            "span": np.array([means.min(), means.max()]),
            "Q": process.action_values(params.gamma, state.V),
        }

    def notes(self, params: MarkovParams, state: MarkovState) -> Mapping[str, str]:
        process = params.process
        return {
            "chain": about_chain(process, *params.places),
            "value": about_value(process, params.gamma),
        }

    def draw(self, scene: Scene, params: MarkovParams, state: MarkovState) -> None:
        process, walk, (source, target) = params.process, state.walk, params.places
        flow = walk.mu + walk.phase * (walk.ahead - walk.mu)
        draw_chain(scene, process, flow, source, process.beads(source, target))
        token = process.where[walk.at] + REST
        if walk.phase > WAIT and params.pace < HURRY:
            part = (walk.phase - WAIT) / (1.0 - WAIT)
            token = on_the_way(process.where, walk.at, walk.to, part)
        scene.sphere("walker", token, 0.055, "reference")
        scene.handle("token", token, 0.075)
