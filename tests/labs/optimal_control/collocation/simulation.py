"""Worlds of the lab collocation, solved and played."""

from collections.abc import Mapping

import numpy as np

from labs.engine.catalog import find
from labs.engine.events import Event
from labs.engine.headless import run
from labs.engine.run import World
from labs.optimal_control.collocation.lab import CollocationState
from labs.optimal_control.collocation.params import CollocationParams
from labs.params import Value

Settings = Mapping[str, Value]


def solved(setting: Settings) -> World:
    world = World(find("collocation"), setting)
    solve(world)
    return world


def solve(world: World) -> int:
    """To the end; how many iterations it took."""
    while world.solving:
        world.iterate()
    assert world.latest is not None
    return world.latest.iteration


def state(world: World) -> CollocationState:
    assert isinstance(world.state, CollocationState)
    return world.state


def params(world: World) -> CollocationParams:
    assert isinstance(world.params, CollocationParams)
    return world.params


def done(world: World) -> str:
    assert world.latest is not None
    return world.latest.done


def readouts(setting: Settings, seconds: float, *events: Event) -> Mapping[str, float]:
    """What the page shows when the motion has been played once."""
    world = run("collocation", setting, seconds=seconds, events=events)
    channels = world.lab.measure(world.params, world.state)
    return {name: float(value) for name, value in channels.items() if np.ndim(value) == 0}
