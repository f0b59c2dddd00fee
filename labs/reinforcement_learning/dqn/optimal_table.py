"""The best there is for the pendulum, to compare with: value iteration (notes, 3.4) on a fine grid
of angles and velocities, interpolated in between.

    V(x) <- min_u  l(x, u) + gamma V(f(x, u))

Its policy looks one step ahead from where the pendulum is, not from a node."""

from functools import cache

import numpy as np

from labs.compiled import compiled
from labs.reinforcement_learning.dqn.tasks import RobotTask, learning_task

ANGLES, VELOCITIES = 121, 121
GAMMA, SWEEPS = 0.99, 400
"""As the network's by default. What is left of the beginning after all sweeps: 2 %."""


def best_controls(X: np.ndarray) -> np.ndarray:
    """Indices (k,) of the best controls from X (k, 2)."""
    return np.asarray(np.argmin(_q_values(X), axis=0))


def least_costs(X: np.ndarray) -> np.ndarray:
    """V (k,) at X (k, 2)."""
    return np.asarray(np.min(_q_values(X), axis=0))


def _q_values(X: np.ndarray) -> np.ndarray:
    """Q (nu, k)."""
    task = learning_task("pendulum")
    return np.stack([
        costs + GAMMA * _interpolate(_optimal_values(), *_coordinates(task, after))
        for after, costs in _transitions(task, X)
    ])  # fmt: skip


def _transitions(task: RobotTask, X: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """For every control where it leads from X (k, 2), and at what cost."""
    controls = range(task.robot.control_count)
    return [task.robot.step(X, np.full(len(X), u))[:2] for u in controls]


@cache
def _optimal_values() -> np.ndarray:
    """V (ANGLES, VELOCITIES); angles all round."""
    task = learning_task("pendulum")
    angle = np.linspace(0.0, 2 * np.pi, ANGLES, endpoint=False)
    velocity = np.linspace(-task.half_range[1], task.half_range[1], VELOCITIES)
    X = np.stack(np.meshgrid(angle, velocity, indexing="ij"), axis=-1).reshape(-1, 2)
    moves = _transitions(task, X)
    places = [_coordinates(task, after) for after, _ in moves]
    costs = np.stack([costs for _, costs in moves])
    return _value_iteration(costs, *(np.stack(parts) for parts in zip(*places, strict=True)))


def _coordinates(task: RobotTask, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of states (k, 2), in nodes of the table."""
    velocity = (X[:, 1] / task.half_range[1] + 1.0) * 0.5 * (VELOCITIES - 1)
    return X[:, 0] % (2 * np.pi) / (2 * np.pi) * ANGLES, velocity


@compiled
def _interpolate(V: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of V at coordinates a, b (k,): bilinear, round in the first."""
    rows, columns = V.shape
    found = np.empty(len(a))
    for k in range(len(a)):
        i, j = int(a[k]), min(int(b[k]), columns - 2)
        s, t = a[k] - i, b[k] - j
        i, after = i % rows, (i + 1) % rows
        low = (1.0 - s) * V[i, j] + s * V[after, j]
        high = (1.0 - s) * V[i, j + 1] + s * V[after, j + 1]
        found[k] = (1.0 - t) * low + t * high
    return found


@compiled
def _value_iteration(costs: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """V after all sweeps, from costs and coordinates of what follows (nu, nodes)."""
    V = np.zeros((ANGLES, VELOCITIES))
    for _ in range(SWEEPS):
        best = np.full(ANGLES * VELOCITIES, np.inf)
        for u in range(len(costs)):
            best = np.minimum(best, costs[u] + GAMMA * _interpolate(V, a[u], b[u]))
        V = best.reshape(ANGLES, VELOCITIES)
    return V
