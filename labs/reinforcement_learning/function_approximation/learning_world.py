"""What the lab's worlds have in common: each is a subject that learners learn.

A training is a mapping of arrays, complete: it holds all that goes on from there. Every one has

    steps (k,)         what has been learned from after each iteration: episodes, or updates
    sound ()           whether all weights stayed within bounds
"""

from typing import Protocol

import numpy as np

from labs.arrays import Training
from labs.reinforcement_learning.function_approximation.motion import PolicyMotion
from labs.reinforcement_learning.function_approximation.params import ApproximationParams
from labs.resumable import Resumable
from labs.scene import Scene

Fields = dict[str, np.ndarray]


class LearningWorld(Protocol):
    """One world."""

    def initial_training(self, params: ApproximationParams, rng: np.random.Generator) -> Training:
        """Nothing learned yet."""
        ...

    def learn(self, params: ApproximationParams, training: Training) -> Resumable[Training]:
        """The training after one of ITERATIONS."""
        ...

    def move(
        self, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> PolicyMotion:
        """One PERIOD later."""
        ...

    def measure(self, params: ApproximationParams, training: Training) -> dict[str, float]:
        """Numbers of the tiles."""
        ...

    def fields(self, params: ApproximationParams, training: Training) -> Fields:
        """Arrays of this world's plots."""
        ...

    def draw(
        self, scene: Scene, params: ApproximationParams, training: Training, motion: PolicyMotion
    ) -> None: ...
