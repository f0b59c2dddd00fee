"""What the four families control: two bodies with one motor each, x = (q, v).

pendulum    I q'' = tau + m g l sin q       q = 0 upright, l to the centre of mass
mass        m q'' = u                       the double integrator
"""

from dataclasses import dataclass

import numpy as np

from labs.models.mass_on_a_line import BLOCK_MASS as BLOCK
from labs.models.pendulums import ROD_LENGTH, ROD_MASS, ROD_RADIUS

GRAVITY = 9.81
"""[m/s^2]"""
INERTIA = ROD_MASS * (ROD_LENGTH**2 / 3.0 + ROD_RADIUS**2 / 4.0)
"""I [kg m^2] of the rod about its hinge."""
TORQUE_LEVEL = ROD_MASS * GRAVITY * ROD_LENGTH / 2.0
"""m g l [N m], what holds the rod level."""


@dataclass(frozen=True)
class UprightBody:
    """q'' = stiffness sin(q) + u / inertia. All points at once: X (k, 2), U (k, 1)."""

    inertia: float
    """[kg m^2; kg]"""
    stiffness: float
    """[1/s^2]"""

    nx = 2
    nu = 1

    def f(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """x' (2,)."""
        return np.array([x[1], self.stiffness * np.sin(x[0]) + u[0] / self.inertia])

    def derivatives(
        self, X: np.ndarray, U: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """f (k, 2), f_x (k, 2, 2), f_u (k, 2, 1)."""
        q, v = X.T
        f = np.stack([v, self.stiffness * np.sin(q) + U[:, 0] / self.inertia], axis=1)
        f_x, f_u = np.zeros((len(X), 2, 2)), np.zeros((len(X), 2, 1))
        f_x[:, 0, 1] = 1.0
        f_x[:, 1, 0] = self.stiffness * np.cos(q)
        f_u[:, 1, 0] = 1.0 / self.inertia
        return f, f_x, f_u


PENDULUM = UprightBody(INERTIA, TORQUE_LEVEL / INERTIA)
BLOCK_ON_A_LINE = UprightBody(BLOCK, 0.0)
