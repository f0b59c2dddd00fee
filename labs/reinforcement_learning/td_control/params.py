"""How the lab of model-free control learns: its tunables, as the algorithms take them."""

import numpy as np

from labs.algorithms import exploration
from labs.algorithms.exploration import Behavior
from labs.params import Group
from labs.problems.episodes import Rule
from labs.reinforcement_learning.td_control.tasks import Task, TaskParams

METHODS = {
    "q-learning": "Q-learning",
    "sarsa": "SARSA",
    "sarsa-n": "SARSA(n)",
    "sarsa-lambda": "SARSA(λ)",
}
"""In the order of the numbers in labs/algorithms/td_control.py."""
EXPLORERS = {
    "epsilon-greedy": "ε-greedy",
    "boltzmann": "Boltzmann",
    "confidence": "Lowest confidence bound",
    "follow": "Another controller drives",
}
"""In the order of the numbers in labs/algorithms/exploration.py."""
BATCHES = 250
"""Iterations of a training, or more while its episodes are long."""
DIVERGED = 1e6
"""Times the largest cost: what no estimate reaches that converges."""


LEARNING = Group("Learning", effect="solve")
EXPLORATION = Group("Exploration", effect="solve")


class LearningParams(TaskParams):
    """What fixes a training."""

    method: str = LEARNING.choice("q-learning", METHODS, "Method", effect="restart")
    """Blue in the scene."""
    second: str = LEARNING.choice(
        "sarsa", {"none": "None", **METHODS}, "Second method", effect="restart"
    )
    """Orange. Both begin with the same luck."""
    n: float = LEARNING.knob(4, 1, 20, "n", "", "Steps", step=1)
    """Costs that SARSA(n) waits for before it trusts its estimate of the rest."""
    decay: float = LEARNING.knob(0.5, 0.0, 1.0, r"\lambda", "", "Trace decay", step=0.01)
    """Of SARSA(λ): 0 is SARSA, 1 waits for all costs of the episode."""
    replacing: bool = LEARNING.toggle(False, "Replacing traces")
    """A pair met again has trace 1 instead of one more; keeps SARSA(λ) from diverging."""
    offline: bool = LEARNING.toggle(False, "Learn at the end")
    """SARSA(λ) takes all updates of an episode at its end."""
    alpha: float = LEARNING.knob(0.5, 0.0, 1.0, r"\alpha", "", "Step size", step=0.01)
    """How far one surprise moves an estimate."""
    omega: float = LEARNING.knob(0.0, 0.0, 1.0, r"\omega", "", "Step decay", step=0.01)
    """The k-th update has α/k^ω: 0 is constant, above 1/2 Robbins-Monro."""
    q0: float = LEARNING.knob(0.0, 0.0, 50.0, "Q_0", "", "First guess", step=0.5, effect="restart")
    """Of every Q. Below the truth is optimistic, above pessimistic."""
    episodes: float = LEARNING.knob(500, BATCHES, 2000, "K", "", "Episodes", scale="log")
    """Of one training, each of ten learners (pendulum: five); in about 250 batches."""
    explorer: str = EXPLORATION.choice("epsilon-greedy", EXPLORERS, "Exploration")
    """Who decides while learning. The other controller walks along the top row, or is PD."""
    epsilon: float = EXPLORATION.knob(
        0.1, 0.0, 1.0, r"\varepsilon", "", "Chance of any control", step=0.01
    )
    """For ε-greedy and for the other controller."""
    fading: float = EXPLORATION.knob(0.0, 0.0, 1.0, "d", "", "Fading", step=0.01)
    """At the k-th visit of a state ε/k^d: above 0 greedy in the limit (GLIE); β grows."""
    beta: float = EXPLORATION.knob(
        1.0, 0.01, 100.0, r"\beta", "", "Inverse temperature", scale="log"
    )
    """Boltzmann: 0 tries all alike, large is greedy."""
    bound: float = EXPLORATION.knob(1.0, 0.0, 100.0, "L", "", "Confidence", scale="log")
    """Width of the confidence bound, in units of cost."""

    @property
    def methods(self) -> list[str]:
        """The names of one or two methods."""
        return [self.method] if self.second == "none" else [self.method, self.second]

    @property
    def kinds(self) -> list[int]:
        """The same as the algorithms number them."""
        return [list(METHODS).index(name) for name in self.methods]

    def behavior(self, task: Task) -> Behavior:
        """Who decides while learning."""
        kind = list(EXPLORERS).index(self.explorer)
        follows = kind == exploration.FOLLOW
        policy = task.teacher if follows else np.zeros(0, np.int64)
        return Behavior(kind, self.epsilon, self.fading, self.beta, self.bound, policy)

    def rule(self, task: Task) -> Rule:
        """How estimates move."""
        limit = DIVERGED * max(1.0, float(np.abs(task.mdp.C).max()))
        n = round(self.n)
        return Rule(self.alpha, self.omega, n, self.decay, self.replacing, self.offline, limit)
