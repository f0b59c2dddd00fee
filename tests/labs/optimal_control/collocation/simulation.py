"""Worlds of the lab collocation, solved and played."""

from collections.abc import Mapping

from labs.engine.events import Event
from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.optimal_control.collocation.lab import CollocationState
from labs.optimal_control.collocation.params import CollocationParams
from tests.labs.solving import Settings as Settings
from tests.labs.solving import readouts as tiles
from tests.labs.solving import solve as solve
from tests.labs.solving import solved_world
from tests.labs.solving import stop_reason as stop_reason


def solved(setting: Settings) -> World:
    return solved_world("collocation", setting)


def state(world: World) -> CollocationState:
    assert isinstance(world.state, CollocationState)
    return world.state


def params(world: World) -> CollocationParams:
    assert isinstance(world.params, CollocationParams)
    return world.params


def readouts(setting: Settings, seconds: float, *events: Event) -> Mapping[str, float]:
    """What the page shows when the motion has been played once."""
    return tiles(run_headless("collocation", setting, seconds=seconds, events=events))
