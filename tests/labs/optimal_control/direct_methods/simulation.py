"""Races of the lab direct-methods, run to their end."""

from labs.engine.headless import run_headless
from labs.engine.run import World
from labs.optimal_control.direct_methods.lab import DirectMethodsState
from labs.optimal_control.direct_methods.method_runs import MethodRuns
from tests.labs.solving import Settings as Settings
from tests.labs.solving import solved_world

NAMES = ("single", "multiple", "collocation")


def solved(setting: Settings) -> World:
    return solved_world("direct-methods", setting)


def entrants(setting: Settings) -> MethodRuns:
    return state(solved(setting)).race


def state(world: World) -> DirectMethodsState:
    assert isinstance(world.state, DirectMethodsState)
    return world.state


def iterations(found: MethodRuns) -> list[int]:
    return [found[name].history.iterations for name in NAMES]


def costs(found: MethodRuns) -> list[float]:
    return [float(found[name].history.cost[-1]) for name in NAMES]


def goal_errors(setting: Settings) -> tuple[float, float]:
    """By how much [m] the robot and its open-loop ghost miss the goal, once played."""
    world = run_headless("direct-methods", setting, seconds=2.4)
    feedback, open_loop = state(world).goal_errors
    return float(feedback), float(open_loop)
