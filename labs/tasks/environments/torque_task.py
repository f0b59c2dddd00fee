"""What the learning robots share: motors that choose among a few torques, each held for a period of
some substeps; no state ends the task."""

from abc import ABC, abstractmethod

import numpy as np

CONTROL_PERIOD = 0.05
"""[s] for which a control is held."""
SUBSTEPS = 4
"""Of a period."""


class TorqueTask(ABC):
    """An `Environment`, as far as it is the same for all."""

    torques: np.ndarray
    """(nu, number of motors) [N m]: the controls to choose from."""

    substeps = SUBSTEPS

    @property
    def control_count(self) -> int:
        return len(self.torques)

    def substep(self, X: np.ndarray, U: np.ndarray) -> np.ndarray:
        return self.integrate(X, self.torques[U], 1)

    def step(self, X: np.ndarray, U: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        torques = self.torques[U]
        return self.integrate(X, torques), self.cost(X, torques), np.zeros(len(X), bool)

    @abstractmethod
    def cost(self, X: np.ndarray, torques: np.ndarray) -> np.ndarray:
        """l (k,) of a step from X (k, nx) under any torques (k, motors) [N m]."""

    @abstractmethod
    def integrate(self, X: np.ndarray, torques: np.ndarray, parts: int = SUBSTEPS) -> np.ndarray:
        """X (k, nx) so many substeps later, under torques (k, motors) [N m]."""
