"""Closed loops of the plane: x+ = f(x), a system under a law that holds its control for a step.

The pendulum hangs under u = -k_p q - k_d v; upright, under LQR, u = K x cut to |u| <= u_max; the
cart is driven by MPC within the same limits; Van der Pol's oscillator, its time reversed, is left
alone. x = 0 is where each of them rests.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from labs.algorithms.linear_mpc import LinearPlanner
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron, box
from labs.resumable import Resumable, run_to_completion
from labs.tasks.phase_plane.systems import PlaneSystem, plane_system

LOOPS: Mapping[str, str] = {
    "pd": "Pendulum under PD",
    "lqr": "Pendulum upright under LQR",
    "mpc": "Cart under MPC",
    "vanderpol": "Van der Pol, reversed",
}
STATE_WINDOWS: Mapping[str, tuple[float, float]] = {
    "pd": (np.pi, 15.0),
    "lqr": (0.6, 4.0),
    "mpc": (1.25, 1.25),
    "vanderpol": (1.25, 1.5),
}
"""What is shown, and studied, of q and of v, either way."""
STATE_LIMIT = 1e3
"""Where what runs away is stopped."""
GRID_PIECES = 16
"""In which the grid is stepped."""
DIFFERENCE_STEP = 1e-4
"""In parts of the window, of differences about the origin."""


@cache
def loop_system(name: str) -> PlaneSystem:
    """What the loop of this name controls."""
    match name:
        case "pd":
            return plane_system("joint").resting_at(0.0)
        case "lqr":
            return plane_system("unstable")
        case "mpc":
            return plane_system("cart")
        case _:
            return plane_system("oscillator")


class ClosedLoopSettings(NamedTuple):
    """What a closed loop depends on."""

    system: str
    T: float
    kp: float
    kd: float
    u_max: float
    q: tuple[float, float]
    r: float
    N: int
    terminal: bool


@dataclass(frozen=True)
class ClosedLoop:
    """x+ = f(x), with what is linear about it."""

    settings: ClosedLoopSettings
    _next_grid_states: list[np.ndarray] = field(default_factory=list, compare=False, repr=False)

    @property
    def system(self) -> PlaneSystem:
        return loop_system(self.settings.system)

    @property
    def window(self) -> tuple[float, float]:
        return STATE_WINDOWS[self.settings.system]

    @property
    def Q(self) -> np.ndarray:
        return np.diag(self.settings.q)

    @cached_property
    def riccati(self) -> np.ndarray:
        """P (2, 2) of the system near its rest, of the cost x'Qx + r u^2 summed up."""
        A, B, _ = self.system.linear(self.settings.T)
        return np.asarray(solve_discrete_are(A, B, self.Q, np.array([[self.settings.r]])))

    @cached_property
    def gain(self) -> np.ndarray:
        """K (1, 2) of u = K x: of PD, or LQR's."""
        if self.settings.system == "pd":
            return -np.array([[self.settings.kp, self.settings.kd]])
        A, B, _ = self.system.linear(self.settings.T)
        P = self.riccati
        return -np.linalg.solve(self.settings.r + B.T @ P @ B, B.T @ P @ A)

    @cached_property
    def planner(self) -> LinearPlanner:
        """MPC, with no limits but those of u."""
        A, B, _ = self.system.linear(self.settings.T)
        u_max = [self.settings.u_max]
        return LinearPlanner(
            LinearMpcProblem(
                N=self.settings.N,
                A=A,
                B=B,
                Q=self.Q,
                R=np.array([[self.settings.r]]),
                Q_f=self.riccati if self.settings.terminal else np.zeros((2, 2)),
                state_set=Polyhedron(np.empty((0, 2)), np.empty(0)),
                control_set=box([-u_max[0]], u_max),
            )
        )

    def control(self, X: np.ndarray) -> Resumable[np.ndarray]:
        """u (k, 1) at states X (k, 2)."""
        match self.settings.system:
            case "mpc":
                found = yield from self.planner.values(X)
                return found.u
            case "vanderpol":
                return np.zeros((len(X), 1))
            case "pd":
                return np.asarray(X @ self.gain.T)
            case _:
                u_max = self.settings.u_max
                return np.asarray(np.clip(X @ self.gain.T, -u_max, u_max))

    def next_state(self, X: np.ndarray) -> Resumable[np.ndarray]:
        """f(x) (k, 2) of states X (k, 2)."""
        U = yield from self.control(X)
        return clip_states(self.system.step(X, U, self.settings.T))

    def next_grid_states(self, X: np.ndarray) -> Resumable[np.ndarray]:
        """f(x) (k, 2) of the grid of its window, which is always the same: found once."""
        if not self._next_grid_states:
            parts = []
            for part in np.array_split(X, GRID_PIECES):
                parts.append((yield from self.next_state(part)))
                yield
            self._next_grid_states.append(np.concatenate(parts))
        return self._next_grid_states[0]

    @cached_property
    def A(self) -> np.ndarray:
        """(2, 2): df/dx at the rest, by central differences; of LQR and MPC it is exact."""
        sizes = DIFFERENCE_STEP * np.array(self.window)
        X = np.vstack([np.diag(sizes), -np.diag(sizes)])
        F = run_to_completion(self.next_state(X))
        return np.asarray(((F[:2] - F[2:]) / (2.0 * sizes[:, None])).T)


def clip_states(X: np.ndarray) -> np.ndarray:
    """X, with what ran away stopped at STATE_LIMIT."""
    return np.asarray(
        np.clip(
            np.nan_to_num(X, nan=STATE_LIMIT, posinf=STATE_LIMIT, neginf=-STATE_LIMIT),
            -STATE_LIMIT,
            STATE_LIMIT,
        )
    )


@lru_cache(maxsize=16)
def closed_loop(settings: ClosedLoopSettings) -> ClosedLoop:
    """The loop of these settings."""
    return ClosedLoop(settings)
