"""Runs of the lab differential-kinematics, for its tests, and a scene that remembers."""

from collections.abc import Iterator, Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from labs.lab import Inputs
from labs.params import Value
from labs.reactive_control.differential_kinematics.lab import (
    DifferentialKinematics,
    DifferentialState,
)
from labs.reactive_control.differential_kinematics.params import DifferentialParams
from labs.scene import Color, NullScene
from tests.labs.experiments import ArticleExperiments
from tests.labs.recording import record

LAB = DifferentialKinematics()
ARTICLE = ArticleExperiments("labs.reactive_control", "differential_kinematics")


def parameters(setting: Mapping[str, Value], **changes: Value) -> DifferentialParams:
    return DifferentialParams().change({**setting, **changes})


def start(params: DifferentialParams) -> DifferentialState:
    return LAB.init(params, np.random.default_rng(0))


def states(
    params: DifferentialParams, seconds: float, inputs: Inputs | None = None
) -> Iterator[DifferentialState]:
    state = start(params)
    yield state
    for _ in range(round(seconds / LAB.period)):
        state = LAB.step(params, inputs or Inputs(), state)
        yield state


@lru_cache
def recorded(params: DifferentialParams, seconds: float) -> Mapping[str, np.ndarray]:
    """All measured channels at every step from t = 0 on."""
    return record(LAB, params, states(params, seconds))


def channel(params: DifferentialParams, name: str, seconds: float) -> np.ndarray:
    """One of them."""
    return recorded(params, seconds)[name]


def fields(setting: Mapping[str, Value], **changes: Value) -> Mapping[str, np.ndarray]:
    params = parameters(setting, **changes)
    return LAB.fields(params, start(params))


def sigma_min(setting: Mapping[str, Value], **changes: Value) -> float:
    return float(fields(setting, **changes)["sigma"][-1])


class Arrows(NullScene):
    """Remembers what an arrow, an arc or an ellipsoid was drawn with."""

    def __init__(self, setting: Mapping[str, Value], **changes: Value) -> None:
        super().__init__()
        self.vectors: dict[str, np.ndarray] = {}
        self.axes: dict[str, np.ndarray] = {}
        params = parameters(setting, **changes)
        LAB.draw(self, params, start(params))

    def arrow(self, name: str, start: ArrayLike, end: ArrayLike, color: Color = "force") -> None:
        super().arrow(name, start, end, color)
        self.vectors[name] = np.array([start, end])

    def ellipsoid(
        self, name: str, center: ArrayLike, axes: np.ndarray, color: Color = "actual"
    ) -> None:
        super().ellipsoid(name, center, axes, color)
        self.axes[name] = axes
