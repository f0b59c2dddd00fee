"""The Hamilton-Jacobi-Bellman equation (notes, 2.1.3) of a problem with two states and one control,
over a fixed horizon T, on a grid, backward in time.

    -V_t(x, t) = min over u of l(x, u) + V_x(x, t)' f(x, u),    V(x, T) = l_f(x)

V is the least cost from x at t to the end. Semi-Lagrangian scheme: with the control held, a motion
is followed from each node for a step h, to its foot, where the V of the later instant is known,

    V(x, t) = min over u of  int l dt + V(foot(x, u), t + h)

foot and integral by Taylor's formula of order 2; the minimum among so many levels of u and the
vertex of the parabola through the best of them and its neighbours. At the foot V is interpolated by
cubics that do not oscillate at kinks (WENO: Carlini, Ferretti, Russo, SIAM J. Sci. Comput. 27,
2005). The error is O(h^2) + O(dx^4 / h) where V is smooth. The edge of the grid is a wall: a motion
that leaves it stays there. So a grid is to reach further than the motions asked for.

f is affine in u with a constant f_u, l is quadratic in u with l_ux = 0. Limits on u are kept to;
those on x have to be part of the cost: interpolation would spread an infinite value by a cell in
each step, at whatever speed the motions go.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from labs.compiled import compiled, inlined
from labs.errors import LabError
from labs.problems.continuous_control import ContinuousProblem
from labs.resumable import Resumable

STENCIL = 4
"""Nodes a cubic takes along each axis."""
SMOOTHNESS_FACTOR = 1.0
"""Second differences of V up to so many (max V - min V) / nodes are no sign of a kink: a smooth V
has some of that size, and at a kink they are larger by the number of nodes along an axis."""
NODES_BETWEEN_PAUSES = 4096
"""Nodes."""


@dataclass(frozen=True)
class StateGrid:
    """Nodes evenly over a rectangle of the plane of states."""

    lower: tuple[float, float]
    upper: tuple[float, float]
    shape: tuple[int, int]
    """Nodes along x_1 and x_2, at least STENCIL."""

    def __post_init__(self) -> None:
        if min(self.shape) < STENCIL:
            raise LabError(f"{self.shape} nodes: a cubic takes {STENCIL} or more along each axis")
        if not (np.array(self.lower) < np.array(self.upper)).all():
            raise LabError(f"a grid from {self.lower} to {self.upper} is empty")

    @cached_property
    def spacing(self) -> np.ndarray:
        """dx (2,)."""
        return (np.array(self.upper) - self.lower) / (np.array(self.shape) - 1.0)

    @property
    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """x_1 (n,) and x_2 (m,)."""
        ends = zip(self.lower, self.upper, self.shape, strict=True)
        first, second = (np.linspace(*end) for end in ends)
        return first, second

    @cached_property
    def nodes(self) -> np.ndarray:
        """(n m, 2), the second axis fastest."""
        return np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1).reshape(-1, 2)

    def cells(self, X: np.ndarray) -> np.ndarray:
        """X (..., 2) in units of cells from the first node."""
        return np.asarray((X - np.array(self.lower)) / self.spacing)


@dataclass(frozen=True, eq=False)
class ValueFunction:
    """V at the nodes and instants, and what follows from it anywhere."""

    T: float
    """[s]"""
    grid: StateGrid
    V: np.ndarray
    """(N + 1, n, m), from t = 0 to T."""

    @property
    def h(self) -> float:
        """[s]"""
        return self.T / (len(self.V) - 1)

    def value(self, x: np.ndarray, t: float) -> float:
        """V(x, t) at x (2,)."""
        return float(self._interpolate(x, t)[0])

    def gradient(self, x: np.ndarray, t: float, reach: float = 0.5) -> np.ndarray:
        """V_x(x, t) (2,) at x (2,), by central differences over so many cells each way."""
        return np.asarray(np.array(self._interpolate(x, t, reach)[1:]) / self.grid.spacing)

    def _interpolate(
        self, x: np.ndarray, t: float, reach: float = 0.5
    ) -> tuple[float, float, float]:
        """V and its derivatives by cells; linear in time."""
        a, b = self.grid.cells(x)
        place = min(max(t / self.h, 0.0), len(self.V) - 1.0)
        k = min(int(place), len(self.V) - 2)
        part = place - k
        before, after = (
            _interpolate_derivatives(V, a, b, reach, smoothness_threshold(V))
            for V in self.V[k : k + 2]
        )
        v, by_a, by_b = ((1.0 - part) * p + part * q for p, q in zip(before, after, strict=True))
        return v, by_a, by_b


@dataclass(frozen=True, eq=False)
class Characteristics:
    """One step h from every node under a held u: foot = foot_0 + foot_u u in cells, and the cost
    c_0 + c_1 u + c_2 u^2 on the way."""

    foot_0: np.ndarray
    """(n, m, 2)"""
    foot_u: np.ndarray
    """(n, m, 2)"""
    c: np.ndarray
    """(n, m, 3)"""


def characteristics(problem: ContinuousProblem, grid: StateGrid, h: float) -> Characteristics:
    """Raises LabError where the problem is not of the kind solved here."""
    if (problem.dynamics.nx, problem.dynamics.nu) != (2, 1):
        raise LabError("a value function on a grid is for two states and one control here")
    constraints = (problem.T_limits, problem.x_final, problem.path, problem.end)
    if any(constraint is not None for constraint in constraints):
        raise LabError("a fixed T and a free end go here: turn other constraints into costs")
    X = grid.nodes
    none = np.zeros((len(X), 1))
    f, f_x, f_u = problem.dynamics.derivatives(X, none)
    cost = problem.cost.running_derivatives(X, none, exact=True)
    if np.ptp(f_u, axis=0).any() or cost.l_ux.any():
        raise LabError("f_u is to be the same everywhere, and l_ux zero")
    b = f_u[:, :, 0]
    half = 0.5 * h * h
    drift = h * f + half * np.einsum("kxy,ky->kx", f_x, f)
    push = h * b + half * np.einsum("kxy,ky->kx", f_x, b)
    c_0 = h * problem.cost.running(X, none) + half * np.einsum("kx,kx->k", cost.l_x, f)
    c_1 = h * cost.l_u[:, 0] + half * np.einsum("kx,kx->k", cost.l_x, b)
    c_2 = 0.5 * h * cost.l_uu[:, 0, 0]
    shape = (*grid.shape, -1)
    return Characteristics(
        (grid.cells(X + drift)).reshape(shape),
        (push / grid.spacing).reshape(shape),
        np.stack([c_0, c_1, c_2], axis=1).reshape(shape),
    )


def final_values(problem: ContinuousProblem, grid: StateGrid) -> np.ndarray:
    """l_f at the nodes (n, m)."""
    return np.array([problem.cost.final(x) for x in grid.nodes]).reshape(grid.shape)


def control_levels(problem: ContinuousProblem, levels: int) -> np.ndarray:
    """So many levels of u, evenly within the limits. Raises LabError where there are none."""
    low, high = float(problem.u_lower[0]), float(problem.u_upper[0])
    if not np.isfinite(high - low) or levels < 3:
        raise LabError(
            "the minimum is looked for among three levels of u or more within finite limits"
        )
    return np.linspace(low, high, levels)


def step(ahead: np.ndarray, way: Characteristics, levels: np.ndarray) -> Resumable[np.ndarray]:
    """V (n, m) a step earlier than `ahead`. Pauses now and then."""
    V, bend = np.empty_like(ahead), smoothness_threshold(ahead)
    rows = max(1, NODES_BETWEEN_PAUSES // ahead.shape[1])
    for begin in range(0, len(V), rows):
        end = min(begin + rows, len(V))
        _backward_rows(ahead, bend, way.foot_0, way.foot_u, way.c, levels, V, begin, end)
        yield
    return V


def solve(
    problem: ContinuousProblem, grid: StateGrid, steps: int, levels: int = 5
) -> Resumable[ValueFunction]:
    """V at all instants of so many steps. Pauses now and then."""
    way, tried = characteristics(problem, grid, problem.T / steps), control_levels(problem, levels)
    V = np.empty((steps + 1, *grid.shape))
    V[steps] = final_values(problem, grid)
    for k in range(steps - 1, -1, -1):
        V[k] = yield from step(V[k + 1], way, tried)
    return ValueFunction(problem.T, grid, V)


def smoothness_threshold(V: np.ndarray) -> float:
    """The square of the second difference of V (n, m) up to which it counts as smooth."""
    return float((SMOOTHNESS_FACTOR * np.ptp(V) / V.size) ** 2) + np.finfo(float).tiny ** 0.25


@inlined
def _interpolate_cubic(
    p0: float, p1: float, p2: float, p3: float, s: float, smooth: float
) -> float:
    """At s between 0 and 1 of values at -1, 0, 1, 2: a blend of the parabolas through the first and
    the last three, which is the cubic where both are smooth, and the flatter one at a kink."""
    left, right = p0 - 2.0 * p1 + p2, p1 - 2.0 * p2 + p3
    a = (2.0 - s) / (smooth + left * left) ** 2
    b = (1.0 + s) / (smooth + right * right) ** 2
    bend = (a * left + b * right) / (a + b)
    return p1 + s * (p2 - p1) - 0.5 * s * (1.0 - s) * bend


@inlined
def _interpolate_value(V: np.ndarray, a: float, b: float, smooth: float) -> float:
    """At a place in cells, or where it enters the grid: cubic, but linear along an axis in the
    outermost cells, where a cubic that leans on one side could grow without end."""
    n, m = V.shape
    a = min(max(a, 0.0), n - 1.0)
    b = min(max(b, 0.0), m - 1.0)
    i, j = int(a), int(b)
    if 1 <= i < n - 2 and 1 <= j < m - 2:
        s, r = a - i, b - j
        return _interpolate_cubic(
            _interpolate_cubic(
                V[i - 1, j - 1], V[i - 1, j], V[i - 1, j + 1], V[i - 1, j + 2], r, smooth
            ),
            _interpolate_cubic(V[i, j - 1], V[i, j], V[i, j + 1], V[i, j + 2], r, smooth),
            _interpolate_cubic(
                V[i + 1, j - 1], V[i + 1, j], V[i + 1, j + 1], V[i + 1, j + 2], r, smooth
            ),
            _interpolate_cubic(
                V[i + 2, j - 1], V[i + 2, j], V[i + 2, j + 1], V[i + 2, j + 2], r, smooth
            ),
            s,
            smooth,
        )
    i, j = min(i, n - 2), min(j, m - 2)
    s, r = a - i, b - j
    near = (1.0 - r) * V[i, j] + r * V[i, j + 1]
    far = (1.0 - r) * V[i + 1, j] + r * V[i + 1, j + 1]
    between: float = (1.0 - s) * near + s * far
    return between


@compiled
def _interpolate_derivatives(
    V: np.ndarray, a: float, b: float, d: float, smooth: float
) -> tuple[float, float, float]:
    """V (n, m) and its derivatives along both axes, by central differences over d, at a place."""
    n, m = V.shape
    a = min(max(a, d), n - 1.0 - d)
    b = min(max(b, d), m - 1.0 - d)
    return (
        _interpolate_value(V, a, b, smooth),
        (_interpolate_value(V, a + d, b, smooth) - _interpolate_value(V, a - d, b, smooth))
        / (2.0 * d),
        (_interpolate_value(V, a, b + d, smooth) - _interpolate_value(V, a, b - d, smooth))
        / (2.0 * d),
    )


@compiled
def _backward_rows(
    ahead: np.ndarray,
    smooth: float,
    foot_0: np.ndarray,
    foot_u: np.ndarray,
    c: np.ndarray,
    levels: np.ndarray,
    V: np.ndarray,
    begin: int,
    end: int,
) -> None:
    """Writes some rows of V."""
    many = len(levels)
    gap = levels[1] - levels[0]
    tried = np.empty(many)
    for i in range(begin, end):
        for j in range(V.shape[1]):
            a, b = foot_0[i, j, 0], foot_0[i, j, 1]
            a_u, b_u = foot_u[i, j, 0], foot_u[i, j, 1]
            c_0, c_1, c_2 = c[i, j, 0], c[i, j, 1], c[i, j, 2]
            best = 0
            for k in range(many):
                u = levels[k]
                later = _interpolate_value(ahead, a + a_u * u, b + b_u * u, smooth)
                tried[k] = c_0 + u * (c_1 + u * c_2) + later
                if tried[k] < tried[best]:
                    best = k
            least = tried[best]
            middle = min(max(best, 1), many - 2)
            bend = tried[middle + 1] - 2.0 * tried[middle] + tried[middle - 1]
            if bend > 0.0:
                off = 0.5 * (tried[middle - 1] - tried[middle + 1]) / bend
                u = levels[middle] + gap * min(max(off, -1.0), 1.0)
                later = _interpolate_value(ahead, a + a_u * u, b + b_u * u, smooth)
                least = min(least, c_0 + u * (c_1 + u * c_2) + later)
            V[i, j] = least
