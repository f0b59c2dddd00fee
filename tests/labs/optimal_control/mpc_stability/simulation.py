"""Runs of the lab mpc-stability."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labs.engine.run import World
from labs.optimal_control.mpc_stability.closed_loop import ClosedLoopRun
from labs.params import Value
from tests.labs.solving import readouts, solved_world

Settings = Mapping[str, Value]


@dataclass(frozen=True)
class Outcome:
    """What the page shows after some seconds."""

    world: World
    tiles: Mapping[str, float]
    notes: Mapping[str, str]
    run: ClosedLoopRun


def simulate(setting: Settings, seconds: float) -> Outcome:
    """With V* over the plane."""
    world = solved_world("mpc-stability", setting)
    while world.t < seconds - 1e-9:
        world.advance()
    notes = world.lab.notes(world.params, world.state)
    return Outcome(world, readouts(world), notes, world.state.run)


def value_changes(outcome: Outcome) -> np.ndarray:
    """V*(x+) - V*(x) of every period."""
    return np.diff(outcome.run.V)
