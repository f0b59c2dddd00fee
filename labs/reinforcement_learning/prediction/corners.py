"""The table of bootstrapping and sampling (notes, 3.5.4): four ways to update a value, each with
what it has looked at so far, on the walk of 5 states.

    exhaustive search     sum over all paths of d steps of their probability times their cost
    dynamic programming   V <- T^pi V, in all states at once
    Monte Carlo           the cost-to-go of one sampled path to the end
    TD(0)                 one sampled step, and V of where it leads

A transition is a look at one (x, u, y): in the model by the first two, by experience in the others.
Exhaustive search goes one step deeper an iteration and looks at every path anew from its root, each
for itself; V = 0 is all it knows of what lies deeper. The other three begin with the first guess.
After k iterations:

    V (4, S, X)           of the four; the first two have S equal learners
    visits, random        of the learners of the last two (labs/algorithms/prediction.py)
    looked (4, k)         transitions looked at so far, of each learner
    error (4, k)          mean error
    samples (k,)          episodes so far
"""

from collections.abc import Iterator

import numpy as np

from labs.algorithms.bellman import policy_backup
from labs.arrays import Training
from labs.lab import Snapshot
from labs.problems.finite_mdp import FiniteMDP
from labs.reinforcement_learning.prediction import online
from labs.reinforcement_learning.prediction.params import PredictionParams

UPDATE_KINDS = ("Exhaustive search", "Dynamic programming", "Monte Carlo", "TD(0)")
MAX_DEPTH = 14
"""Steps of the paths of exhaustive search at most: 2^14 paths from each state."""
TOLERANCE = 1e-3
"""A sweep of dynamic programming that changes no value by more is the last one."""


def initial_training(params: PredictionParams, rng: np.random.Generator) -> Training:
    """Nothing looked at yet."""
    sampled = online.initial_training(params, rng)
    V = sampled["V"]
    return {
        "V": np.concatenate([np.zeros_like(V[:1]), V[:1], V]),
        "looked": np.zeros((4, 0)),
        "error": np.zeros((4, 0)),
        "samples": np.zeros(0),
        "visits": sampled["visits"],
        "random": sampled["random"],
    }


def learn(params: PredictionParams, training: Training) -> Iterator[Snapshot]:
    """From the first guess on: a level deeper, a sweep, and some episodes an iteration."""
    world, mdp = params.prediction, params.prediction.mdp
    begun = initial_training(params, np.random.default_rng(0))
    sampled = {
        **online.initial_training(params, np.random.default_rng(0)),
        "random": training["random"],
    }
    tree, swept = ExhaustiveSearch(mdp, world.policy), begun["V"][1, 0]
    looked, error, samples = begun["looked"], begun["error"], begun["samples"]
    counts, change = np.zeros(4), np.inf
    for i, batch in enumerate(online.learn(params, sampled), 1):
        if i <= MAX_DEPTH:
            tree.deepen()
            counts[0] += tree.transitions
        if change > TOLERANCE:
            swept, change, _ = policy_backup(mdp, swept, world.policy)
            counts[1] += (world.policy[~mdp.terminal] > 0.0).sum()
        counts[2:] = batch.data["steps"]
        known = np.broadcast_to(np.stack([tree.values, swept])[:, None], batch.data["V"].shape)
        V = np.concatenate([known, batch.data["V"]])
        errors = [online.error_decomposition(world, each)[0] for each in V]
        looked = np.concatenate([looked, counts[:, None]], axis=1)
        error = np.concatenate([error, np.array(errors)[:, None]], axis=1)
        samples = batch.data["episodes"]
        found = {"V": V, "looked": looked, "error": error, "samples": samples}
        found |= {name: batch.data[name] for name in ("visits", "random")}
        yield Snapshot(i, found, batch.done, batch.progress)


class ExhaustiveSearch:
    """All paths from each state, step by step."""

    def __init__(self, mdp: FiniteMDP, policy: np.ndarray) -> None:
        self._mdp, self._policy = mdp, policy
        self._ends = np.arange(mdp.X)[:, None]
        self._chances = np.ones((mdp.X, 1))
        self.values = np.zeros(mdp.X)
        """(X,) expected cost of the steps so far."""
        self.transitions = 0.0
        """Transitions of the last level."""
        self._discount = 1.0

    def deepen(self) -> None:
        """One step more at the end of every path that has not ended."""
        mdp, ends = self._mdp, self._ends
        alive = ~mdp.terminal[ends] & (self._chances > 0.0)
        chances = (self._chances * alive)[..., None] * self._policy[ends]
        self.values = self.values + self._discount * (chances * mdp.C[ends]).sum(axis=(1, 2))
        self.transitions = float((chances > 0.0).sum())
        self._ends = mdp.successors[ends].reshape(mdp.X, -1)
        self._chances = chances.reshape(mdp.X, -1)
        self._discount *= mdp.gamma
