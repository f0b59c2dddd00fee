"""What can drive a robot in the scene: a network's greedy policy, and for the pendulum two others
that need no learning, to compare with: the optimal table, and energy shaping.

A controller takes states X (k, nx) to torques (k, motors) [N m].
"""

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.linalg import solve_continuous_are

from labs.algorithms.dqn import epsilon_greedy
from labs.reinforcement_learning.dqn.optimal_table import best_controls
from labs.reinforcement_learning.dqn.tasks import RobotTask, learning_task

Controller = Callable[[np.ndarray], np.ndarray]
CONTROLLERS = {
    "network": "The network",
    "table": "Optimal table",
    "energy": "Energy, then LQR",
}
ENERGY_GAIN = 10.0
"""k [1]"""
STATE_WEIGHTS, TORQUE_WEIGHT = np.diag([1.0, 0.1]), np.eye(1)
"""Of LQR: [1/rad^2, s^2/rad^2], [1/(N m)^2]."""
UNUSED_RANDOM = np.ones(4, np.uint64)
"""A greedy policy draws nothing."""


def network_controller(task: RobotTask, sizes: np.ndarray, w: np.ndarray) -> Controller:
    """u = argmin_u Q(x, u, w)"""
    return lambda X: task.torques[
        epsilon_greedy(sizes, w, task.robot.observe(X), 0.0, UNUSED_RANDOM)
    ]


def table_controller() -> Controller:
    """One step of look-ahead on the table of the pendulum."""
    task = learning_task("pendulum")
    return lambda X: task.torques[best_controls(X)]


@cache
def energy_controller() -> Controller:
    """Of the pendulum I e'' = G sin e + u with |u| <= u_max, e its angle from upright.

    Far from the top it pumps until the energy E = I v^2 / 2 + G (cos e - 1) is that of rest at the
    top, 0 (Astrom and Furuta, 2000): u = -k E sign(v), within the limit. Near it LQR, u = -K x,
    x = (e, v): where x' P x <= c = u_max^2 / (K P^-1 K'), the largest ellipse on which K x obeys
    the limit, P of the algebraic Riccati equation. Its torque weighs more than in the task, or
    the ellipse would be missed between two decisions."""
    task = learning_task("pendulum")
    inertia, gravity = task.robot.dynamics.inertia[0], task.robot.dynamics.gravity[0, 1]
    limit = task.max_torque
    A, B = np.array([[0.0, 1.0], [gravity / inertia, 0.0]]), np.array([[0.0], [1.0 / inertia]])
    P = solve_continuous_are(A, B, STATE_WEIGHTS, TORQUE_WEIGHT)
    K = B.T @ P / TORQUE_WEIGHT
    level = limit**2 / (K @ np.linalg.solve(P, K.T)).item()

    def torque(X: np.ndarray) -> np.ndarray:
        e = np.remainder(X[:, 0], 2.0 * np.pi) - np.pi
        x = np.stack([e, X[:, 1]], axis=1)
        energy = 0.5 * inertia * x[:, 1] ** 2 + gravity * (np.cos(e) - 1.0)
        along = np.where(x[:, 1] < 0.0, -1.0, 1.0)
        near = np.einsum("ki,ij,kj->k", x, P, x) <= level
        u = np.where(near, -(x @ K[0]), -np.clip(ENERGY_GAIN * energy * along, -limit, limit))
        return np.asarray(u[:, None])

    return torque


def mean_cost(task: RobotTask, controller: Controller, X: np.ndarray) -> float:
    """Of an episode, undiscounted, from each of X (k, nx)."""
    total = 0.0
    for _ in range(task.robot.horizon):
        torques = controller(X)
        total += float(task.robot.cost(X, torques).mean())
        X = task.robot.integrate(X, torques)
    return total


@cache
def baseline_costs() -> tuple[float, float]:
    """What an episode of the pendulum costs by the optimal table, and by energy, on average over
    the starts that greedy policies are tried from."""
    task = learning_task("pendulum")
    both = (table_controller(), energy_controller())
    table, energy = (mean_cost(task, controller, task.test_states()) for controller in both)
    return table, energy
