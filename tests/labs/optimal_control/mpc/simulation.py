"""Worlds of the lab mpc, step by step."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.mpc.lab import MpcState
from labs.optimal_control.mpc.params import MpcParams
from labs.params import Value

Settings = Mapping[str, Value]


@dataclass
class RecordedRun:
    """A run: its world, and what was measured after each step."""

    world: World
    measured: dict[str, np.ndarray]

    @property
    def state(self) -> MpcState:
        assert isinstance(self.world.state, MpcState)
        return self.world.state

    @property
    def params(self) -> MpcParams:
        assert isinstance(self.world.params, MpcParams)
        return self.world.params

    def last(self, name: str) -> float:
        """Of a scalar."""
        return float(self.measured[name][-1])


def begun(setting: Settings) -> World:
    return World(find_lab("mpc"), setting)


def run(world: World, seconds: float) -> RecordedRun:
    """So long; channels that are there all the time."""
    rows = []
    for _ in range(round(seconds / world.lab.period)):
        world.advance()
        rows.append(world.lab.measure(world.params, world.state))
    names = [name for name in rows[-1] if all(name in row for row in rows)]
    last = {name: np.asarray(rows[-1][name])[None] for name in rows[-1]}
    return RecordedRun(
        world, last | {name: np.array([row[name] for row in rows]) for name in names}
    )


def run_for(setting: Settings, seconds: float) -> RecordedRun:
    return run(begun(setting), seconds)
