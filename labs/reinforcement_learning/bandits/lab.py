"""Bandits (notes, 3.6.4 and 3.6.1): exploring costs, and so does not exploring."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.lab import Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.reinforcement_learning.bandits.game import (
    Game,
    initial_game,
    play,
    reset_game,
    single_task_game,
)
from labs.reinforcement_learning.bandits.params import STRATEGIES, BanditParams
from labs.reinforcement_learning.bandits.picture import draw_doors
from labs.reinforcement_learning.bandits.plots import ORDER, PLOTS, regret_curves, regret_readouts
from labs.resumable import run_to_completion
from labs.scene import Scene

BATCHES = 100
"""Iterations of a game."""


@dataclass(kw_only=True)
class BanditState(State):
    """A game of all strategies, and one of its tasks played once more, slowly."""

    game: Game
    live: Game
    opened: np.ndarray
    """(P,) int: the doors opened last in the slow game; -1 before the first turn."""
    game_key: tuple[Value, ...]
    """What it is played by."""
    wait: float = 0.0
    """The part of a turn since then."""


class BanditsLab(Lab[BanditParams, BanditState]):
    """Two strategies open doors whose costs nobody told them."""

    title = "Bandits"
    section = "3.6.4"
    summary = (
        "Doors with unknown costs and every opening counts: greedy, ε-greedy, Boltzmann, "
        "confidence bounds and Thompson side by side on a thousand tasks at once."
    )
    Params = BanditParams
    period = 0.02
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Ten doors": {},
        "Two doors": {"world": "doors", "turns": 100.0},
        "Bounds that close": {"first": "bound", "second": "epsilon"},
        "Thompson": {"first": "thompson", "second": "bound"},
        "Means that drift": {"drift": 0.05, "first": "epsilon", "forget": True},
    }

    def init(self, params: BanditParams, rng: np.random.Generator) -> BanditState:
        game = initial_game(params, rng)
        live = single_task_game(params, game, params.shown)
        return BanditState(game=game, live=live, opened=_no_choices(live), game_key=params.game_key)

    def step(self, params: BanditParams, inputs: Inputs, state: BanditState) -> BanditState:
        """The slow game; from its first turn on where other rules hold."""
        live, opened, wait = state.live, state.opened, state.wait + params.pace * self.period
        if state.game_key != params.game_key:
            live, wait = single_task_game(params, state.game, params.shown), 0.0
            opened = _no_choices(live)
        if wait >= 1.0 and live["regrets"].shape[1] < params.total_turns:
            after = run_to_completion(play(params, live, 1))
            opened = (after["visits"] - live["visits"])[:, 0].argmax(axis=1)
            live, wait = after, wait - 1.0
        wait = min(wait, 1.0)
        t = state.t + self.period
        return replace(state, t=t, live=live, opened=opened, wait=wait, game_key=params.game_key)

    def solve(self, params: BanditParams, state: BanditState) -> Iterator[Snapshot | None]:
        """From the first turn on: some turns an iteration."""
        game, turns = reset_game(params, state.game), params.total_turns
        for i in range(1, BATCHES + 1):
            game = yield from play(params, game, i * turns // BATCHES - game["regrets"].shape[1])
            done = f"{turns} turns of {len(game['begun'])} players each." if i == BATCHES else ""
            yield Snapshot(i, game, done, i / BATCHES)

    def accept(self, params: BanditParams, state: BanditState, snapshot: Snapshot) -> BanditState:
        return replace(state, game=snapshot.data)

    def measure(self, params: BanditParams, state: BanditState) -> Measurement:
        return regret_readouts(params, state.game)

    def fields(self, params: BanditParams, state: BanditState) -> Mapping[str, np.ndarray]:
        return regret_curves(params, state.game)

    def labels(self, params: BanditParams) -> Mapping[str, str | tuple[str, ...]]:
        many = 2 if params.world == "doors" else 10
        doors = ("left", "right") if many == 2 else tuple(str(k + 1) for k in range(many))
        players = params.players
        return {"doors": doors, "players": players} | dict(zip(ORDER, players, strict=False))

    def draw(self, scene: Scene, params: BanditParams, state: BanditState) -> None:
        draw_doors(scene, params, state.live, state.opened)

    @classmethod
    def prepare(cls) -> None:
        """Compiles the loop of the turns; all strategies share it."""
        params = BanditParams()
        assert set(params.strategies) <= set(STRATEGIES)
        work = cls().solve(params, cls().init(params, np.random.default_rng(0)))
        next(snapshot for snapshot in work if snapshot is not None)


def _no_choices(live: Game) -> np.ndarray:
    return np.full(len(live["q"]), -1)
