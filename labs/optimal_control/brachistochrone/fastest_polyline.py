"""The curve of fastest descent as a nonlinear programme: a polyline whose nodes move up and down.

    minimise  T(v) = sum_i t_i  [ms]  over the speeds v_1 ... v_(N-1) at its nodes,
    t_i = sqrt(p_i^2 + q_i^2),  p_i = 2 dx_i / (v_i + v_(i+1)),  q_i = (v_(i+1) - v_i) / g + mu p_i

The abscissae of the nodes are given, dx_i apart, and a speed tells the depth, y = v^2 / 2g + mu x.
Down a straight segment a bead has constant acceleration, so that its mean speed is that of its ends
and its time t_i exactly the length over it: p_i is what the way across takes at this speed, and q_i
without friction what a free fall takes to gain as much. Both are convex, and so is T where
p + mu q >= 0: where no segment climbs more steeply than 1 / mu. In the depths it is not. A speed
enters two segments: the Hessian is tridiagonal.

Near A the cycloid is steeper than any segment,

    x ~ theta^3,   y ~ theta^2,   v ~ theta,

and it matters where the nodes lie. A grid that is even in x has one segment where the bead turns
most, and the error of T is of order 1 in 1 / N. Nodes at x = w (i / N)^3 are even in theta and in
speed there, and the order is 2.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.sparse import csc_array, diags_array

from labs.problems.nonlinear_program import ProgramDerivatives, ProgramValues
from labs.resumable import Resumable

EXPONENTS = {"even": 1, "clustered": 3}
"""Of i / N, by the name of the grid."""
MILLISECONDS = 1e3
"""In a second: T is near 1000, and so are its gradients far from what rounds."""
MIN_SPEED = 1e-6
"""[m/s] the least speed at a node."""


def grid_abscissae(across: float, segments: int, name: str) -> np.ndarray:
    """Abscissae (segments + 1,) [m], from 0 to `across`; the name is one of EXPONENTS."""
    return np.asarray(across * np.linspace(0.0, 1.0, segments + 1) ** EXPONENTS[name])


@dataclass(frozen=True, eq=False)
class FastestPolyline:
    """`labs.problems.nonlinear_program.NonlinearProgram` in (v_1 ... v_(N-1)) [m/s]."""

    free_time: ClassVar[bool] = False
    x: np.ndarray
    """(N + 1,) [m] abscissae of the nodes, from 0 at A to B."""
    depth: float
    """[m] of B; it is in reach if that is more than mu times its distance across."""
    g: float
    mu: float = 0.0
    floor: float = np.inf
    """[m] the depth no node may be under, not less than B's."""

    @cached_property
    def lower(self) -> np.ndarray:
        return np.full(len(self.x) - 2, MIN_SPEED)

    @cached_property
    def upper(self) -> np.ndarray:
        head = np.maximum(self.floor - self.mu * self.x[1:-1], 0.0)
        return np.asarray(np.sqrt(2.0 * self.g * head))

    def nodes(self, y: np.ndarray) -> np.ndarray:
        """(N + 1, 2) [m]: across and depth, with both ends."""
        depth = self._speeds(y) ** 2 / (2.0 * self.g) + self.mu * self.x
        return np.stack([self.x, depth], axis=1)

    def speeds(self, depth: np.ndarray) -> np.ndarray:
        """(N - 1,) [m/s] within the bounds, of depths (N - 1,) [m] of the nodes between."""
        head = np.maximum(depth - self.mu * self.x[1:-1], 0.0)
        return np.clip(np.sqrt(2.0 * self.g * head), self.lower, self.upper)

    @property
    def straight_line_speeds(self) -> np.ndarray:
        """(N - 1,) [m/s] down the straight line to B."""
        return self.speeds(self.depth * self.x[1:-1] / self.x[-1])

    def values(self, y: np.ndarray) -> ProgramValues:
        none = np.zeros(0)
        if not (np.isfinite(y).all() and (y > 0.0).all()):
            return ProgramValues(np.inf, none, none)
        p, q, _ = self._segments(y)
        return ProgramValues(MILLISECONDS * float(np.hypot(p, q).sum()), none, none)

    def derivatives(self, y: np.ndarray) -> ProgramDerivatives:
        p, q, S = self._segments(y)
        t_v = _gradient(p, q, S, self.g, self.mu)[2]
        none = csc_array((0, len(y)))
        return ProgramDerivatives(MILLISECONDS * (t_v[1:, 0] + t_v[:-1, 1]), none, none)

    def hessian(
        self, y: np.ndarray, lam: np.ndarray, mu: np.ndarray, exact: bool
    ) -> Resumable[csc_array]:
        """Exactly, or without what is not convex in a segment."""
        yield from ()
        p, q, S = self._segments(y)
        t = np.hypot(p, q)
        p_v, q_v, t_v = (a[:, :, None] for a in _gradient(p, q, S, self.g, self.mu))
        bent = p + self.mu * q if exact else np.maximum(p + self.mu * q, 0.0)
        outer = p_v * p_v.swapaxes(1, 2) + q_v * q_v.swapaxes(1, 2) - t_v * t_v.swapaxes(1, 2)
        second = MILLISECONDS * (outer + (2.0 * bent * p / S**2)[:, None, None]) / t[:, None, None]
        diagonal = second[1:, 0, 0] + second[:-1, 1, 1]
        beside = second[1:-1, 0, 1]
        return csc_array(diags_array([beside, diagonal, beside], offsets=[-1, 0, 1]))

    def equality_name(self, i: int) -> str:
        raise IndexError("there are no equalities")

    def inequality_name(self, i: int) -> str:
        raise IndexError("there are no inequalities")

    def variable_name(self, i: int) -> str:
        return f"the speed {self.x[i + 1]:.2f} m across from A"

    def _speeds(self, y: np.ndarray) -> np.ndarray:
        """(N + 1,) with both ends'."""
        head = max(self.depth - self.mu * self.x[-1], 0.0)
        end = np.sqrt(2.0 * self.g * head)
        return np.concatenate([[0.0], y, [end]])

    def _segments(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """p, q [s] and v_i + v_(i+1) [m/s], (N,) each."""
        v = self._speeds(y)
        S = v[:-1] + v[1:]
        p = 2.0 * np.diff(self.x) / S
        return p, np.diff(v) / self.g + self.mu * p, S


def _gradient(
    p: np.ndarray, q: np.ndarray, S: np.ndarray, g: float, mu: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of p, q and t, (N, 2) each, by the speeds of a segment's two ends."""
    p_v = np.stack([-p / S, -p / S], axis=1)
    q_v = np.array([-1.0, 1.0]) / g + mu * p_v
    t_v = (p[:, None] * p_v + q[:, None] * q_v) / np.hypot(p, q)[:, None]
    return p_v, q_v, t_v
