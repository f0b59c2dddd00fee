"""Worlds of the lab ddp, solved and played."""

from collections.abc import Mapping

from labs.engine.events import Event
from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.optimal_control.ddp.lab import DdpState
from tests.labs.solving import Settings as Settings
from tests.labs.solving import readouts as tiles
from tests.labs.solving import solve as solve
from tests.labs.solving import solved_world
from tests.labs.solving import stop_reason as stop_reason

UR5: Settings = {"system": "ur5", "horizon": 1.0, "goal": 3000.0}


def solved(setting: Settings) -> World:
    return solved_world("ddp", setting)


def state(world: World) -> DdpState:
    assert isinstance(world.state, DdpState)
    return world.state


def readouts(setting: Settings, seconds: float, *events: Event) -> Mapping[str, float]:
    """What the page shows when the motion has been played once."""
    return tiles(run_headless("ddp", setting, seconds=seconds, events=events))
