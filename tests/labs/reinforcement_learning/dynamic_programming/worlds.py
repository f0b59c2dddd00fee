"""Worlds of the lab on dynamic programming, for its tests."""

from collections.abc import Mapping

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.params import Value
from labs.reinforcement_learning.dynamic_programming.params import DynamicProgrammingParams

SLUG = "dynamic-programming"
Setting = Mapping[str, Value]


def solved(setting: Setting) -> World:
    """A world whose iterations are over."""
    world = World(find_lab(SLUG), setting)
    while world.solving:
        world.iterate()
    return world


def params_of(world: World) -> DynamicProgrammingParams:
    """With their type."""
    assert isinstance(world.params, DynamicProgrammingParams)
    return world.params
