"""A motion to follow that the system itself can make: under a control held over each period,

    u_r(k) = Re(w z^k),   x_r(k) = Re((z I - A)^-1 B w z^k),   z = exp(2 pi i f T),

so that x_r(k + 1) = A x_r(k) + B u_r(k). With w such that the position swings by a, from zero.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Reference:
    """x_r and u_r at every period."""

    z: complex
    x: np.ndarray
    """(2,) complex amplitude."""
    u: complex

    @classmethod
    def of(
        cls, A: np.ndarray, B: np.ndarray, amplitude: float, frequency: float, period: float
    ) -> "Reference":
        """A (2, 2), B (2, 1), amplitude in the position's unit, frequency [Hz], period [s]."""
        z = complex(np.exp(2j * np.pi * frequency * period))
        response = np.linalg.solve(z * np.eye(2) - A, B[:, 0])
        w = -1j * amplitude / response[0]
        return cls(z, response * w, complex(w))

    def states(self, k: np.ndarray) -> np.ndarray:
        """x_r (..., 2) at periods k (...)."""
        return np.real(np.multiply.outer(self.z**k, self.x))

    def controls(self, k: np.ndarray) -> np.ndarray:
        """u_r (..., 1) at periods k (...)."""
        return np.real(self.u * self.z**k)[..., None]
