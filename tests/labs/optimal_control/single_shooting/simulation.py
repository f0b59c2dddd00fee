"""Worlds of the lab single-shooting, solved."""

from collections.abc import Mapping

import numpy as np

from labs.engine.run import World
from labs.optimal_control.single_shooting.lab import SingleShootingState
from labs.optimal_control.single_shooting.params import SingleShootingParams
from tests.labs.solving import Settings as Settings
from tests.labs.solving import readouts as readouts
from tests.labs.solving import solve as solve
from tests.labs.solving import solved_world
from tests.labs.solving import stop_reason as stop_reason


def solved(setting: Settings) -> World:
    return solved_world("single-shooting", setting)


def state(world: World) -> SingleShootingState:
    assert isinstance(world.state, SingleShootingState)
    return world.state


def params(world: World) -> SingleShootingParams:
    assert isinstance(world.params, SingleShootingParams)
    return world.params


def fields(world: World) -> Mapping[str, np.ndarray]:
    return world.lab.fields(world.params, world.state)
