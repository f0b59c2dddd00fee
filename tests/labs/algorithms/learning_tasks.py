"""Tasks to learn, and learners of them, for the tests of model-free control."""

import numpy as np

from labs.algorithms.td_control import (
    Learners,
    init,
)
from labs.problems.episodes import EpisodicTask, episodic_task
from labs.problems.finite_mdp import FiniteMDP
from labs.tasks.grid_world.map import MAPS, GridWorld


def random_mdp(states: int, controls: int, gamma: float, seed: int) -> FiniteMDP:
    """All states lead to all, none is terminal."""
    rng = np.random.default_rng(seed)
    return FiniteMDP(
        C=rng.uniform(0.0, 1.0, (states, controls)),
        gamma=gamma,
        terminal=np.zeros(states, bool),
        P=rng.dirichlet(np.full(states, 0.5), (controls, states)),
    )


def optimum(mdp: FiniteMDP) -> np.ndarray:
    """Q* (X, U), by fixed-point iteration."""
    q = np.zeros((mdp.X, mdp.U))
    for _ in range(5000):
        q = mdp.C + mdp.gamma * np.einsum("uxy,y->xu", mdp.probabilities, q.min(axis=1))
    return q


def grid(name: str, slip: float = 0.0, horizon: int = 500) -> tuple[GridWorld, EpisodicTask]:
    world = GridWorld.parse(MAPS[name])
    return world, episodic_task(world.mdp(1.0, slip), [world.start], horizon)


def initial_learners(
    experience: EpisodicTask, seeds: int = 1, seed: int = 0, q0: float = 0.0
) -> Learners:
    states, controls = experience.cost.shape
    return init((states, controls), seeds, np.random.default_rng(seed), q0)


def same(one: Learners, other: Learners) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("q", "visits", "random")
    )
