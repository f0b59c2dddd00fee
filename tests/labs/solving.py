"""Worlds whose solver runs to its end."""

from collections.abc import Mapping

import numpy as np

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.params import Value

Settings = Mapping[str, Value]


def solved_world(slug: str, setting: Settings) -> World:
    """Of the lab of this name."""
    world = World(find_lab(slug), setting)
    solve(world)
    return world


def solve(world: World) -> int:
    """To the end; how many iterations it took."""
    while world.solving:
        world.iterate()
    assert world.latest is not None
    return world.latest.iteration


def solve_to_convergence(world: World) -> int:
    """The same, where the solver says that it has converged."""
    iterations = solve(world)
    assert stop_reason(world).startswith("Converged")
    return iterations


def stop_reason(world: World) -> str:
    """Why the solver stopped."""
    assert world.latest is not None
    return world.latest.done


def readouts(world: World) -> Mapping[str, float]:
    """What the tiles show."""
    channels = world.lab.measure(world.params, world.state)
    return {name: float(value) for name, value in channels.items() if np.ndim(value) == 0}
