"""Optimal control problems with random weights, references and starts."""

import numpy as np

from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import mechanism
from labs.problems.optimal_control import OptimalControlProblem, rollout
from labs.tasks.motion.cost import MotionCost, TipCost


def random_problem(
    rng: np.random.Generator, name: str = "ur5", N: int = 6, method: str = "semi-implicit-euler"
) -> OptimalControlProblem:
    """Of a mechanism, in steps of 20 ms, with a place for its tip."""
    m = mechanism(name)
    n, k = m.nx, m.nu

    def weight(size: int) -> np.ndarray:
        half = rng.normal(size=(size, size))
        weight: np.ndarray = half @ half.T / size
        return weight

    cost = MotionCost(
        N,
        weight(n),
        weight(k),
        weight(n),
        rng.normal(size=(N + 1, n)),
        rng.normal(size=k),
        TipCost(m, np.array([0.1, 0.3, 0.5]), 7.0),
    )
    return OptimalControlProblem(DiscreteMechanism(m, 0.02, method), cost, rng.normal(size=n), N)


def simulate(p: OptimalControlProblem, U: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """States, controls and cost under U (N, nu) alone."""
    nothing = np.zeros((p.N, p.dynamics.nu, p.dynamics.nx))
    return rollout(p, np.zeros((p.N + 1, p.dynamics.nx)), U, nothing)
