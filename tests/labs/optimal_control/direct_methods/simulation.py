"""Races of the lab direct-methods, run to their end."""

from labs.engine.headless import run
from labs.engine.run import World
from labs.optimal_control.direct_methods.lab import DirectMethodsState
from labs.optimal_control.direct_methods.race import Entrants
from tests.labs.solving import Settings as Settings
from tests.labs.solving import solved_world

NAMES = ("single", "multiple", "collocation")


def solved(setting: Settings) -> World:
    return solved_world("direct-methods", setting)


def race(setting: Settings) -> Entrants:
    return state(solved(setting)).race


def state(world: World) -> DirectMethodsState:
    assert isinstance(world.state, DirectMethodsState)
    return world.state


def iterations(found: Entrants) -> list[int]:
    return [found[name].history.iterations for name in NAMES]


def costs(found: Entrants) -> list[float]:
    return [float(found[name].history.cost[-1]) for name in NAMES]


def missed(setting: Settings) -> tuple[float, float]:
    """By how much [m] the robot and its open-loop ghost miss the goal, once played."""
    world = run("direct-methods", setting, seconds=2.4)
    feedback, open_loop = state(world).missed
    return float(feedback), float(open_loop)
