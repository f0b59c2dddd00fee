"""The curve of fastest descent in closed form (notes, 2.1.1), across x and depth y from A, at rest.

Without friction it is the cycloid that a point of a wheel of radius r draws, rolled under the
level of A by the angle theta,

    x = r (theta - sin theta),   y = r (1 - cos theta),   T = theta_B sqrt(r / g).

With friction mu (`descent`), v^2 / 2 = g (y - mu x): the gravity that counts is
sqrt(1 + mu^2) g, tilted back by phi = arctan mu. The fastest curve is then a cycloid in axes that
are tilted with it. As it must not go back, it first falls plumb, by d_0, and joins this cycloid
where that is plumb, at theta = 2 phi:

    T = sqrt(2 d_0 / g) + (theta_B - 2 phi) sqrt(r / (g sqrt(1 + mu^2))).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

SMALLEST_ANGLE = 1e-3
"""[rad] Nobody rolls by less to any B; below it the formulas lose their digits."""


@dataclass(frozen=True)
class FastestDescent:
    """From A to a B that is `across` and `depth` [m] away."""

    radius: float
    """r [m]."""
    theta: float
    """theta_B [rad]."""
    plumb: float
    """d_0 [m], zero without friction."""
    mu: float
    g: float

    @property
    def time(self) -> float:
        """T [s]."""
        phi, stretch = np.arctan(self.mu), np.hypot(1.0, self.mu)
        rolled = (self.theta - 2.0 * phi) * np.sqrt(self.radius / (self.g * stretch))
        return float(np.sqrt(2.0 * self.plumb / self.g) + rolled)


@lru_cache(maxsize=64)
def fastest_descent(across: float, depth: float, g: float, mu: float = 0.0) -> FastestDescent:
    """Of all curves that do not go back, from rest. B must be in reach: depth > mu across > 0."""
    phi, stretch = np.arctan(mu), np.hypot(1.0, mu)
    along_B, fall_B = (across + mu * depth) / stretch, (depth - mu * across) / stretch
    turned = 1.0 - np.cos(2.0 * phi)

    def radius(theta: float) -> float:
        return float(fall_B / (1.0 - np.cos(theta)))

    def miss(theta: float) -> float:
        """How far short of B, in parts of r, so that neither end is infinite."""
        rolled = theta - np.sin(theta) - 2.0 * phi + np.sin(2.0 * phi)
        return float(along_B / radius(theta) - mu * turned - rolled)

    low, high = max(2.0 * phi, SMALLEST_ANGLE), 2.0 * np.pi - SMALLEST_ANGLE
    theta = float(brentq(miss, low, high, xtol=1e-14, rtol=1e-14))
    r = radius(theta)
    return FastestDescent(r, theta, stretch * r * turned, mu, g)


def cycloid_points(radius: float, theta: np.ndarray) -> np.ndarray:
    """(k, 2) [m]: across and depth of the cycloid at angles theta (k,) [rad]."""
    return radius * np.stack([theta - np.sin(theta), 1.0 - np.cos(theta)], axis=1)
