"""Pendulums of one or two rods (labs/models/pendulums.py) on a grid: a table for dynamic
programming (notes, 2.2.2).

Time, angles, velocities and torques are discretised. For a time step dt under a held torque the
equation of motion

    M(q) q'' + h(q, q') = tau - b q'

is integrated (classical Runge-Kutta, steps of at most MAX_STEP), and the state reached is moved to
the nearest node of the grid: x' = successor[x, u]. Angles run round the circle, velocities are
cut to [-v_max, v_max]. Hanging is q = 0; upright, the goal, is q = (pi, 0), and it is a node.

    l(x, u) = dt (w_q |q - q*|^2 + w_v |v|^2 + w_u |tau|^2),    q - q* wrapped to [-pi, pi)

States are numbered with the last axis fastest, in the order q_1, ..., q_n, v_1, ..., v_n.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product

import numpy as np

from labs.errors import LabError
from labs.models.pendulums import ROD_LENGTH, ROD_MASS, ROD_RADIUS
from labs.problems.finite_mdp import FiniteMDP

GRAVITY = 9.81
MAX_STEP = 0.025
"""[s] the longest step of integration."""
CENTER_INERTIA = ROD_MASS * (ROD_LENGTH**2 / 12 + ROD_RADIUS**2 / 4)
"""[kg m^2] moment of inertia of a rod about its centre."""
MAX_ENTRIES = 20_000_000
"""Entries of a table, X U, at most."""


def acceleration(q: np.ndarray, v: np.ndarray, tau: np.ndarray, friction: float) -> np.ndarray:
    """q'' (..., n) [rad/s^2] of n = 1 or 2 rods at q (..., n) [rad], v (..., n) [rad/s] under
    torques tau (..., n) [N m] at the hinges."""
    force = tau - friction * v
    half = ROD_LENGTH / 2
    moment = CENTER_INERTIA + ROD_MASS * half**2
    if q.shape[-1] == 1:
        return np.asarray((force - ROD_MASS * GRAVITY * half * np.sin(q)) / moment)
    c, s = np.cos(q[..., 1]), np.sin(q[..., 1])
    coupling = ROD_MASS * ROD_LENGTH * half
    m22 = moment
    m12 = moment + coupling * c
    m11 = 2 * moment + ROD_MASS * ROD_LENGTH**2 + 2 * coupling * c
    v1, v2 = v[..., 0], v[..., 1]
    lower = ROD_MASS * GRAVITY * half * np.sin(q[..., 0] + q[..., 1])
    upper = ROD_MASS * GRAVITY * (half + ROD_LENGTH) * np.sin(q[..., 0])
    r1 = force[..., 0] + coupling * s * v2 * (2 * v1 + v2) - upper - lower
    r2 = force[..., 1] - coupling * s * v1**2 - lower
    determinant = m11 * m22 - m12**2
    return np.stack(
        [(m22 * r1 - m12 * r2) / determinant, (m11 * r2 - m12 * r1) / determinant], axis=-1
    )


def integrate_pendulum(
    q: np.ndarray, v: np.ndarray, tau: np.ndarray, friction: float, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """q and v (..., n) a time dt [s] later under held torques."""
    steps = int(np.ceil(dt / MAX_STEP - 1e-9))
    h = dt / steps
    for _ in range(steps):
        a1 = acceleration(q, v, tau, friction)
        v2 = v + h / 2 * a1
        a2 = acceleration(q + h / 2 * v, v2, tau, friction)
        v3 = v + h / 2 * a2
        a3 = acceleration(q + h / 2 * v2, v3, tau, friction)
        v4 = v + h * a3
        a4 = acceleration(q + h * v3, v4, tau, friction)
        q = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return q, v


@dataclass(frozen=True)
class PendulumGrid:
    """What fixes the table of a pendulum. Raises LabError where a number is not allowed."""

    rods: int = 1
    """1 or 2."""
    q_nodes: int = 51
    """Angles round the circle, of each rod."""
    v_nodes: int = 51
    """Velocities of each rod, an odd number: zero is one of them."""
    levels: int = 5
    """Torques of each motor, an odd number: zero is one of them."""
    v_max: float = 8.0
    """[rad/s]"""
    torque: float = 2.5
    """[N m] the largest; to hold one rod level takes 4.9 N m."""
    dt: float = 0.1
    """[s]"""
    friction: float = 0.05
    """b [N m s/rad]."""

    def __post_init__(self) -> None:
        if self.rods not in (1, 2):
            raise LabError(f"a pendulum of {self.rods} rods has no table here: 1 or 2 rods go")
        if self.q_nodes < 3 or self.v_nodes < 3 or self.v_nodes % 2 == 0:
            raise LabError(
                f"{self.q_nodes} angles and {self.v_nodes} velocities: 3 angles or more and an "
                "odd number of velocities, 3 or more, go"
            )
        if self.levels < 1 or self.levels % 2 == 0:
            raise LabError(f"{self.levels} torque levels: an odd number goes")
        if min(self.v_max, self.torque, self.dt) <= 0.0 or self.friction < 0.0:
            raise LabError("v_max, torque and dt are above zero, friction is not below")
        if self.X * self.U > MAX_ENTRIES:
            raise LabError(
                f"{self.X} states times {self.U} controls are more than {MAX_ENTRIES} entries: "
                "take fewer nodes or levels"
            )

    @property
    def shape(self) -> tuple[int, ...]:
        """Nodes of each axis: the angles, then the velocities."""
        return (self.q_nodes,) * self.rods + (self.v_nodes,) * self.rods

    @property
    def X(self) -> int:
        """Number of states."""
        return int(np.prod(self.shape))

    @property
    def U(self) -> int:
        """Number of controls: every combination of the motors' levels."""
        return int(self.levels**self.rods)

    @property
    def goal(self) -> np.ndarray:
        """(rods,) [rad]: q* upright."""
        return np.array([np.pi, 0.0])[: self.rods]

    @property
    def torques(self) -> np.ndarray:
        """(U, rods) [N m] of each control."""
        if self.levels == 1:
            return np.zeros((1, self.rods))
        ladder = np.linspace(-self.torque, self.torque, self.levels)
        return np.array(list(product(ladder, repeat=self.rods)))

    @property
    def angles(self) -> np.ndarray:
        """(q_nodes,) [rad] from q*, ascending through 0 at q_nodes // 2."""
        around = np.arange(self.q_nodes) - self.q_nodes // 2
        return np.asarray(2 * np.pi / self.q_nodes * around)

    @property
    def velocities(self) -> np.ndarray:
        """(v_nodes,) [rad/s]."""
        return np.linspace(-self.v_max, self.v_max, self.v_nodes)

    @cached_property
    def nodes(self) -> np.ndarray:
        """(X, 2 rods): q [rad] and v [rad/s] of each state."""
        axes = [goal + self.angles for goal in self.goal] + [self.velocities] * self.rods
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(self.X, -1)

    def state(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(...) int32: the nodes nearest to q, v (..., rods)."""
        turns = np.rint((q - self.goal) * (self.q_nodes / (2 * np.pi))).astype(np.int64)
        i = (turns + self.q_nodes // 2) % self.q_nodes
        spacing = 2 * self.v_max / (self.v_nodes - 1)
        j = np.rint(np.clip(v, -self.v_max, self.v_max) / spacing).astype(np.int64)
        j += self.v_nodes // 2
        axes = tuple(np.moveaxis(i, -1, 0)) + tuple(np.moveaxis(j, -1, 0))
        return np.asarray(np.ravel_multi_index(axes, self.shape), dtype=np.int32)

    def successor_rows(self, chunk: int = 1 << 17) -> Iterator[tuple[slice, np.ndarray]]:
        """The table of successors piece by piece: which states, and their rows (k, U) int32."""
        for begin in range(0, self.X, chunk):
            part = slice(begin, min(begin + chunk, self.X))
            q, v = np.split(self.nodes[part], 2, axis=1)
            columns = [
                self.state(
                    *integrate_pendulum(q, v, np.broadcast_to(tau, q.shape), self.friction, self.dt)
                )
                for tau in self.torques
            ]
            yield part, np.stack(columns, axis=1)

    @cached_property
    def successor(self) -> np.ndarray:
        """(X, U) int32."""
        return np.concatenate([rows for _, rows in self.successor_rows()])

    def cost(self, w_q: float, w_v: float, w_u: float) -> np.ndarray:
        """(X, U): l(x, u) for the weights of angles, velocities and torques."""
        off = self.nodes - np.concatenate([self.goal, np.zeros(self.rods)])
        q, v = np.split(off**2, 2, axis=1)
        ahead = w_q * q.sum(axis=1) + w_v * v.sum(axis=1)
        effort = w_u * (self.torques**2).sum(axis=1)
        return np.asarray(self.dt * (ahead[:, None] + effort[None, :]))

    def mdp(
        self, gamma: float, w_q: float = 1.0, w_v: float = 0.05, w_u: float = 0.05
    ) -> FiniteMDP:
        """The pendulum as an MDP without terminal states: it is held upright for ever."""
        terminal = np.zeros(self.X, bool)
        return FiniteMDP(self.cost(w_q, w_v, w_u), gamma, terminal, successor=self.successor)


@lru_cache(maxsize=8)
def pendulum_grid(
    rods: int = 1,
    q_nodes: int = 51,
    v_nodes: int = 51,
    levels: int = 5,
    v_max: float = 8.0,
    torque: float = 2.5,
    dt: float = 0.1,
    friction: float = 0.05,
) -> PendulumGrid:
    """The same grid for the same numbers, so that its table is computed once."""
    return PendulumGrid(rods, q_nodes, v_nodes, levels, v_max, torque, dt, friction)


def table_size(joints: int, nodes: int) -> int:
    """States of a robot with this many joints, each angle and each velocity cut into `nodes`."""
    size: int = nodes ** (2 * joints)
    return size
