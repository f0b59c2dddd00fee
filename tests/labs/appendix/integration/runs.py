"""Runs of the lab integration, for its tests."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labs.appendix.integration.lab import Integration, IntegrationState
from labs.appendix.integration.params import METHOD_NAMES, IntegrationParams
from labs.lab import Inputs
from labs.params import Value
from tests.labs.experiments import ArticleExperiments

LAB = Integration()
EXPERIMENTS = ArticleExperiments("labs.appendix", "integration")
ORDERS = {
    "euler": 1,
    "semi": 1,
    "midpoint": 2,
    "heun": 2,
    "rk3": 3,
    "rk4": 4,
    "implicit": 2,
    "yours": 3,
}
UPRIGHT = np.pi


@dataclass
class Run:
    """What one world came to."""

    params: IntegrationParams
    state: IntegrationState


def simulated(seconds: float, setting: Mapping[str, Value]) -> tuple[Run, list[IntegrationState]]:
    """A run, and its states from t = 0 on."""
    params = IntegrationParams().change(setting)
    states = [LAB.init(params, np.random.default_rng(0))]
    for _ in range(round(seconds / LAB.period)):
        states.append(LAB.step(params, Inputs(), states[-1]))
    return Run(params, states[-1]), states


def solved(setting: Mapping[str, Value]) -> Run:
    """A run at t = 0 whose study of errors is done."""
    params = IntegrationParams().change(setting)
    state = LAB.init(params, np.random.default_rng(0))
    for snapshot in LAB.solve(params, state):
        state = LAB.accept(params, state, snapshot)
    return Run(params, state)


def energies(world: Run, states: list[IntegrationState], method: str) -> np.ndarray:
    plant = world.params.plant
    return np.array([plant.energy(s.x[METHOD_NAMES.index(method)]) for s in states])


def angles(states: list[IntegrationState], method: str) -> np.ndarray:
    """Of the first rod [rad]."""
    return np.array([s.x[METHOD_NAMES.index(method), 0] for s in states])


def time_over_the_top(states: list[IntegrationState], method: str) -> float:
    """When it first passes the top [s]; infinite if it never does."""
    passed = np.abs(angles(states, method)) > UPRIGHT
    return float(np.argmax(passed)) * LAB.period if passed.any() else np.inf


def of_method(world: Run, field: str, method: str) -> float:
    """A field's number for a method."""
    return float(LAB.fields(world.params, world.state)[field][METHOD_NAMES.index(method)])
