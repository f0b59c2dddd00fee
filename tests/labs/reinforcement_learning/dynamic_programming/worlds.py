"""Worlds of the lab on dynamic programming, for its tests."""

from labs.engine.run import World
from labs.reinforcement_learning.dynamic_programming.params import DynamicProgrammingParams
from tests.labs.solving import Settings as Settings
from tests.labs.solving import solved_world

SLUG = "dynamic-programming"


def solved(setting: Settings) -> World:
    """A world whose iterations are over."""
    return solved_world(SLUG, setting)


def params_of(world: World) -> DynamicProgrammingParams:
    """With their type."""
    assert isinstance(world.params, DynamicProgrammingParams)
    return world.params
