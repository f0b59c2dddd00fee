"""Worlds of the lab single-shooting, solved."""

from collections.abc import Mapping

import numpy as np

from labs.engine.catalog import find
from labs.engine.run import World
from labs.optimal_control.single_shooting.lab import SingleShootingState
from labs.optimal_control.single_shooting.params import SingleShootingParams
from labs.params import Value

Settings = Mapping[str, Value]


def solved(setting: Settings) -> World:
    world = World(find("single-shooting"), setting)
    solve(world)
    return world


def solve(world: World) -> int:
    """To the end; how many iterations it took."""
    while world.solving:
        world.iterate()
    assert world.latest is not None
    return world.latest.iteration


def state(world: World) -> SingleShootingState:
    assert isinstance(world.state, SingleShootingState)
    return world.state


def params(world: World) -> SingleShootingParams:
    assert isinstance(world.params, SingleShootingParams)
    return world.params


def done(world: World) -> str:
    assert world.latest is not None
    return world.latest.done


def fields(world: World) -> Mapping[str, np.ndarray]:
    return world.lab.fields(world.params, world.state)


def readouts(world: World) -> Mapping[str, float]:
    """What the tiles show."""
    channels = world.lab.measure(world.params, world.state)
    return {name: float(value) for name, value in channels.items() if np.ndim(value) == 0}
