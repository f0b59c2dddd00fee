"""A mechanism in discrete time: x+ = f(x, u), one step of an integration method, u held."""

from typing import final

import numpy as np

from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.sensitivities import SENSITIVITIES, Sensitivities
from labs.errors import LabError
from labs.models.mechanisms import Mechanism


@final
class DiscreteMechanism:
    """x+ = Phi(x, u) with a step of h [s] of `method`, a name of INTEGRATORS."""

    def __init__(self, mechanism: Mechanism, h: float, method: str = "semi-implicit-euler") -> None:
        if method not in INTEGRATORS:
            raise LabError(f"no method is named {method!r}; there are {', '.join(INTEGRATORS)}")
        if not 0.0 < h < np.inf:
            raise LabError(f"h = {h}: a step takes a positive time in seconds")
        self.mechanism, self.h, self.method = mechanism, h, method
        self._held = np.zeros(mechanism.nu)
        self._a = mechanism.acceleration(self._held)
        self._step = INTEGRATORS[method].step

    @property
    def nx(self) -> int:
        return self.mechanism.nx

    @property
    def nu(self) -> int:
        return self.mechanism.nu

    def step(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """x+ (nx,)."""
        n = len(x) // 2
        self._held[:] = u
        after = np.empty(2 * n)
        after[:n], after[n:] = self._step(self._a, x[:n], x[n:], self.h)
        return after

    def rollout(self, x0: np.ndarray, U: np.ndarray) -> np.ndarray:
        """X (N + 1, nx) from x0 under U (N, nu)."""
        X = np.empty((len(U) + 1, len(x0)))
        X[0] = x0
        for t, u in enumerate(U):
            X[t + 1] = self.step(X[t], u)
        return X

    def linearize(self, X: np.ndarray, U: np.ndarray) -> Sensitivities:
        """X+ (N, nx), A (N, nx, nx), B (N, nx, nu) at the points of X (N or more, nx), U (N, nu).

        A = dx+/dx, B = dx+/du, by the chain rule through the method."""
        points = np.asarray(X[: len(U)])
        return SENSITIVITIES[self.method](self.mechanism.derivatives, points, U, self.h)
