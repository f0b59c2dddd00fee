"""The cost of the four families (notes, 2.1.2), with limits on q as a penalty:

l = w_q q^2 + w_v v^2 + w_u u^2 + rho max(0, q - q_max, q_min - q)^2,    l_f = w_f q^2 + w_vf v^2
"""

from dataclasses import dataclass

import numpy as np

from labs.problems.continuous_control import RunningDerivatives


@dataclass(frozen=True)
class SwingCost:
    """int l dt + l_f. All points at once: X (k, 2), U (k, 1)."""

    w_q: float
    w_v: float
    w_u: float
    w_f: float
    w_vf: float
    q_min: float = -np.inf
    q_max: float = np.inf
    rho: float = 0.0

    def excess(self, q: np.ndarray) -> np.ndarray:
        """By how much q is above q_max; negative where it is below q_min; else 0."""
        return np.maximum(q - self.q_max, 0.0) - np.maximum(self.q_min - q, 0.0)

    def running(self, X: np.ndarray, U: np.ndarray) -> np.ndarray:
        q, v = X.T
        square = self.w_q * q**2 + self.w_v * v**2 + self.w_u * U[:, 0] ** 2
        return np.asarray(square + self.rho * self.excess(q) ** 2)

    def running_derivatives(self, X: np.ndarray, U: np.ndarray, exact: bool) -> RunningDerivatives:
        k = len(X)
        excess = self.excess(X[:, 0])
        l_x = 2.0 * X * [self.w_q, self.w_v]
        l_x[:, 0] += 2.0 * self.rho * excess
        l_xx = np.zeros((k, 2, 2))
        l_xx[:, 0, 0] = 2.0 * self.w_q + 2.0 * self.rho * (excess != 0.0)
        l_xx[:, 1, 1] = 2.0 * self.w_v
        l_uu = np.full((k, 1, 1), 2.0 * self.w_u)
        return RunningDerivatives(l_x, 2.0 * self.w_u * U, l_xx, np.zeros((k, 1, 2)), l_uu)

    def final(self, x: np.ndarray) -> float:
        return float(self.w_f * x[0] ** 2 + self.w_vf * x[1] ** 2)

    def final_derivatives(self, x: np.ndarray, exact: bool) -> tuple[np.ndarray, np.ndarray]:
        weights = 2.0 * np.array([self.w_f, self.w_vf])
        return weights * x, np.diag(weights)
