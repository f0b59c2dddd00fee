"""Worlds of the lab families, solved."""

from labs.engine.run import World
from labs.optimal_control.families.lab import FamiliesState
from labs.optimal_control.families.params import FamiliesParams
from labs.optimal_control.families.side_by_side import Results
from tests.labs.solving import Settings as Settings
from tests.labs.solving import solve as solve
from tests.labs.solving import solved_world
from tests.labs.solving import stop_reason as stop_reason

COARSE: Settings = {"nodes": 41.0, "hjb_steps": 20.0, "start": "cold"}
"""Where the tables do not matter."""


def solved(setting: Settings) -> World:
    return solved_world("families", setting)


def results(world: World) -> Results:
    assert isinstance(world.state, FamiliesState)
    return world.state.results


def params(world: World) -> FamiliesParams:
    assert isinstance(world.params, FamiliesParams)
    return world.params


def measured(world: World) -> dict[str, float]:
    return {name: float(v) for name, v in world.lab.measure(world.params, world.state).items()}


def costs(world: World) -> dict[str, float]:
    return {name: motion.cost for name, motion in results(world).motions.items()}
