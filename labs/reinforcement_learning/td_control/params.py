"""How the lab of model-free control learns: its tunables, as the algorithms take them."""

import numpy as np

from labs.algorithms import exploration
from labs.algorithms.exploration import Behavior
from labs.params import choice, knob, toggle
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


class LearningParams(TaskParams):
    """What fixes a training."""

    method: str = choice(
        "q-learning",
        METHODS,
        label="Method",
        group="Learning",
        effect="restart",
        help="Blue in the scene.",
    )
    second: str = choice(
        "sarsa",
        {"none": "None", **METHODS},
        label="Second method",
        group="Learning",
        effect="restart",
        help="Orange. Both begin with the same luck.",
    )
    n: float = knob(
        4,
        1,
        20,
        symbol="n",
        unit="",
        label="Steps",
        group="Learning",
        step=1,
        effect="solve",
        help="Costs that SARSA(n) waits for before it trusts its estimate of the rest.",
    )
    decay: float = knob(
        0.5,
        0.0,
        1.0,
        symbol=r"\lambda",
        unit="",
        label="Trace decay",
        group="Learning",
        step=0.01,
        effect="solve",
        help="Of SARSA(λ): 0 is SARSA, 1 waits for all costs of the episode.",
    )
    replacing: bool = toggle(
        False,
        label="Replacing traces",
        group="Learning",
        effect="solve",
        help="A pair met again has trace 1 instead of one more; keeps SARSA(λ) from diverging.",
    )
    offline: bool = toggle(
        False,
        label="Learn at the end",
        group="Learning",
        effect="solve",
        help="SARSA(λ) takes all updates of an episode at its end.",
    )
    alpha: float = knob(
        0.5,
        0.0,
        1.0,
        symbol=r"\alpha",
        unit="",
        label="Step size",
        group="Learning",
        step=0.01,
        effect="solve",
        help="How far one surprise moves an estimate.",
    )
    omega: float = knob(
        0.0,
        0.0,
        1.0,
        symbol=r"\omega",
        unit="",
        label="Step decay",
        group="Learning",
        step=0.01,
        effect="solve",
        help="The k-th update has α/k^ω: 0 is constant, above 1/2 Robbins-Monro.",
    )
    q0: float = knob(
        0.0,
        0.0,
        50.0,
        symbol="Q_0",
        unit="",
        label="First guess",
        group="Learning",
        step=0.5,
        effect="restart",
        help="Of every Q. Below the truth is optimistic, above pessimistic.",
    )
    episodes: float = knob(
        500,
        BATCHES,
        2000,
        symbol="K",
        unit="",
        label="Episodes",
        group="Learning",
        scale="log",
        effect="solve",
        help="Of one training, each of ten learners (pendulum: five); in about 250 batches.",
    )
    explorer: str = choice(
        "epsilon-greedy",
        EXPLORERS,
        label="Exploration",
        group="Exploration",
        effect="solve",
        help="Who decides while learning. The other controller walks along the top row, or is PD.",
    )
    epsilon: float = knob(
        0.1,
        0.0,
        1.0,
        symbol=r"\varepsilon",
        unit="",
        label="Chance of any control",
        group="Exploration",
        step=0.01,
        effect="solve",
        help="For ε-greedy and for the other controller.",
    )
    fading: float = knob(
        0.0,
        0.0,
        1.0,
        symbol="d",
        unit="",
        label="Fading",
        group="Exploration",
        step=0.01,
        effect="solve",
        help="At the k-th visit of a state ε/k^d: above 0 greedy in the limit (GLIE); β grows.",
    )
    beta: float = knob(
        1.0,
        0.01,
        100.0,
        symbol=r"\beta",
        unit="",
        label="Inverse temperature",
        group="Exploration",
        scale="log",
        effect="solve",
        help="Boltzmann: 0 tries all alike, large is greedy.",
    )
    bound: float = knob(
        1.0,
        0.0,
        100.0,
        symbol="L",
        unit="",
        label="Confidence",
        group="Exploration",
        scale="log",
        effect="solve",
        help="Width of the confidence bound, in units of cost.",
    )

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
