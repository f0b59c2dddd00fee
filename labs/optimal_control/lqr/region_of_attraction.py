"""The region of attraction: from where a linear policy brings a nonlinear system back, by rollouts
of the closed loop.

    x' = f(x, u),    u = clip(K_t (x - x_eq), limit), held for T,    K_t given for t = 0, 1, ...,
                                                                     M - 1 and then over again

for the cart-pole, the pendulum and the mass on a line, whose rest needs no control (u_eq = 0).
One cycle of M periods maps dx, where it is small, to Phi dx. If Phi is stable, the Lyapunov
equation L = Phi' L Phi + I has a solution, and dx' L dx decreases from cycle to cycle. A rollout
has recovered once it is in the largest ellipsoid dx' L dx <= c in which no angle exceeds
SMALL_ANGLE, no limit is met and no rail ends all through a cycle: an invariant set. It has not
at the rail's end, beyond two turns round, or if it takes longer than TIME_LIMIT. Integrated by
RK4 as in `linear_systems.py`, in closed form.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from labs.compiled import compiled
from labs.models import cart_pole, mass_on_a_line, pendulums
from labs.optimal_control.lqr.linear_systems import SIMULATION_STEP, linear_system

SMALL_ANGLE = 0.1
"""[rad] near enough to the rest for the linear map to hold."""
TIME_LIMIT = 20.0
"""[s] of a rollout."""
GRID_POINTS = 41
"""Along either axis of the phase plane."""
GRAVITY = 9.81

HALF_WIDTHS: Mapping[str, tuple[float, float]] = {
    "cart-pole": (1.2, 8.0),
    "pendulum": (pi, 12.0),
    "mass": (1.5, 5.0),
}
"""Of the phase plane: of the coordinate [rad; m] and of its rate."""
SYSTEM_CODES: Mapping[str, int] = {"mass": 0, "pendulum": 1, "cart-pole": 2}


@dataclass(frozen=True, eq=False)
class RegulatedSystem:
    """A system under a linear policy."""

    system: str
    """One of SYSTEM_CODES."""
    period: float
    """T [s]."""
    gains: np.ndarray
    """K (M, nx), one control."""
    limit: float
    """[N; N m], may be infinite."""

    def transition(self) -> np.ndarray:
        """Phi (M + 1, nx, nx): dx after t periods is Phi_t dx, where dx is small."""
        a, b = linear_system(self.system).linear(self.period)
        phi = [np.eye(len(a))]
        for gain in self.gains:
            phi.append((a + b @ gain[None]) @ phi[-1])
        return np.array(phi)

    def invariant_ellipsoid(self) -> tuple[np.ndarray, float]:
        """L (nx, nx) and c of dx' L dx <= c; c = -1 where the loop is unstable at its rest."""
        system, phi = linear_system(self.system), self.transition()
        n = system.nx
        with np.errstate(all="ignore"):
            radius = np.abs(np.linalg.eigvals(phi[-1])).max() if np.isfinite(phi).all() else np.inf
        if not radius < 1.0 - 1e-9:
            return np.eye(n), -1.0
        shape = solve_discrete_lyapunov(phi[-1].T, np.eye(n))
        controls = np.einsum("ti,tij->tj", self.gains, phi[:-1])
        bounded = [(controls, self.limit)]
        for i in range(system.mechanism.nq):
            bounded.append((phi[:, i], system.half_rail if i in system.prismatic else SMALL_ANGLE))
        inverse = np.linalg.inv(shape)
        level = np.inf
        for rows, bound in bounded:
            spread = np.einsum("ti,ij,tj->t", rows, inverse, rows).max()
            level = min(level, bound**2 / spread if spread > 0.0 else np.inf)
        return shape, level

    def recovers(self, deviations: np.ndarray) -> np.ndarray:
        """Which of the deviations dx (k, nx) from the rest are brought back, (k,) bool."""
        system = linear_system(self.system)
        shape, level = self.invariant_ellipsoid()
        starts = np.ascontiguousarray(deviations, float)
        recovered = np.zeros(len(starts), np.bool_)
        if level > 0.0:
            _roll_out(
                SYSTEM_CODES[self.system],
                starts,
                system.x_eq,
                np.ascontiguousarray(self.gains),
                self.limit,
                shape,
                level,
                system.half_rail,
                round(self.period / SIMULATION_STEP),
                round(TIME_LIMIT / self.period),
                recovered,
            )
        return recovered

    def from_phase_plane(self, points: np.ndarray) -> np.ndarray:
        """Deviations (k, nx) from points (k, 2) of the phase plane: a coordinate and its rate, all
        else at rest."""
        n = linear_system(self.system).mechanism.nq
        dx = np.zeros((len(points), 2 * n))
        dx[:, [n - 1, 2 * n - 1]] = points
        return dx

    def recovers_in_row(self, row: int) -> np.ndarray:
        """Which points of this row of the plane's grid are brought back, (GRID_POINTS,) bool."""
        places, speeds = grid_axes(self.system)
        points = np.column_stack([places, np.full(GRID_POINTS, speeds[row])])
        return self.recovers(self.from_phase_plane(points))

    def largest_recoverable_deviation(self) -> float:
        """The largest deviation [rad; m] from which it comes back, released at rest, and from all
        smaller ones alike, to a thousandth of the plane's width; zero if from none."""
        low, high = 0.0, HALF_WIDTHS[self.system][0]
        for _ in range(2):
            tried = np.linspace(low, high, 41)
            still = np.column_stack([tried, np.zeros_like(tried)])
            fails = ~self.recovers(self.from_phase_plane(still))
            fails[0] = False
            if not fails.any():
                return high
            first = int(np.argmax(fails))
            low, high = tried[first - 1], tried[first]
        return float(low)


def grid_axes(system: str) -> tuple[np.ndarray, np.ndarray]:
    """The grid of the phase plane, of deviations: coordinates and rates, (GRID_POINTS,) each."""
    coordinate, rate = (np.linspace(-most, most, GRID_POINTS) for most in HALF_WIDTHS[system])
    return coordinate, rate


def state_derivative(system: str, x: np.ndarray, u: float) -> np.ndarray:
    """x' (nx,) in closed form."""
    dx = np.zeros_like(x)
    _state_derivative(SYSTEM_CODES[system], x, u, dx)
    return dx


@compiled
def _state_derivative(code: int, x: np.ndarray, u: float, dx: np.ndarray) -> None:
    """x' = f(x, u) into dx."""
    n = len(x) // 2
    for i in range(n):
        dx[i] = x[n + i]
    if code == 0:
        dx[1] = u / mass_on_a_line.BLOCK_MASS
    elif code == 1:
        m, length, radius = pendulums.ROD_MASS, pendulums.ROD_LENGTH, pendulums.ROD_RADIUS
        inertia = m * (3.0 * radius**2 + 4.0 * length**2) / 12.0
        dx[1] = (u - m * GRAVITY * 0.5 * length * np.sin(x[0])) / inertia
    else:
        m, half, radius = cart_pole.POLE_MASS, 0.5 * cart_pole.POLE_LENGTH, cart_pole.POLE_RADIUS
        inertia = m * (3.0 * radius**2 + 16.0 * half**2) / 12.0
        sine, cosine = np.sin(x[1]), np.cos(x[1])
        total, coupling = cart_pole.CART_MASS + m, m * half * cosine
        right = u + m * half * x[3] ** 2 * sine
        down = -m * GRAVITY * half * sine
        determinant = total * inertia - coupling**2
        dx[2] = (inertia * right - coupling * down) / determinant
        dx[3] = (total * down - coupling * right) / determinant


@compiled
def _roll_out(
    code: int,
    starts: np.ndarray,
    x_eq: np.ndarray,
    gains: np.ndarray,
    limit: float,
    shape: np.ndarray,
    level: float,
    half_rail: float,
    substeps: int,
    periods: int,
    recovered: np.ndarray,
) -> None:
    """One rollout for each start (k, nx), its outcome into recovered (k,)."""
    n = len(x_eq)
    k1, k2, k3, k4 = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    y, dx = np.zeros(n), np.zeros(n)
    for which in range(len(starts)):
        x = x_eq + starts[which]
        for tick in range(periods):
            dx[:] = x - x_eq
            index = tick % len(gains)
            if index == 0:
                size = 0.0
                for i in range(n):
                    for j in range(n):
                        size += dx[i] * shape[i, j] * dx[j]
                if size <= level:
                    recovered[which] = True
                    break
            u = 0.0
            for i in range(n):
                u += gains[index, i] * dx[i]
            u = min(max(u, -limit), limit)
            for _ in range(substeps):
                _state_derivative(code, x, u, k1)
                for i in range(n):
                    y[i] = x[i] + 0.5 * SIMULATION_STEP * k1[i]
                _state_derivative(code, y, u, k2)
                for i in range(n):
                    y[i] = x[i] + 0.5 * SIMULATION_STEP * k2[i]
                _state_derivative(code, y, u, k3)
                for i in range(n):
                    y[i] = x[i] + SIMULATION_STEP * k3[i]
                _state_derivative(code, y, u, k4)
                for i in range(n):
                    x[i] += SIMULATION_STEP / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            slid = x[0] if code != 1 else 0.0
            turned = x[n // 2 - 1] - x_eq[n // 2 - 1] if code != 0 else 0.0
            if not (abs(slid) <= half_rail and abs(turned) <= 4.0 * np.pi):
                break
