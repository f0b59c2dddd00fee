"""What the user turns in model-free control: the task, how it is learned, and what is shown."""

import numpy as np

from labs.algorithms import exploration
from labs.algorithms.exploration import BehaviourPolicy
from labs.params import Group, Params
from labs.problems.episodes import UpdateRule
from labs.reinforcement_learning.td_control.tasks import (
    LARGEST_GAMMA,
    ControlTask,
    grid_task,
    pendulum_task,
    table_task,
)
from labs.tasks.grid_world.map import MAPS
from labs.tasks.grid_world.params import MAP_LENGTH, MapText
from labs.tasks.mdp_table.params import TABLE_LENGTH, TAXICAB, TableText
from labs.tasks.method_pair.params import chosen_methods, where_chosen

LEARNING_METHODS = {
    "q-learning": "Q-learning",
    "sarsa": "SARSA",
    "sarsa-n": "SARSA(n)",
    "sarsa-lambda": "SARSA(λ)",
}
"""In the order of the numbers in labs/algorithms/td_control.py."""
EXPLORATIONS = {
    "epsilon-greedy": "ε-greedy",
    "boltzmann": "Boltzmann",
    "confidence": "Lowest confidence bound",
    "follow": "Another controller drives",
}
"""In the order of the numbers in labs/algorithms/exploration.py."""
WORLDS = {"grid": "Grid world", "pendulum": "Pendulum", "table": "Your table"}
LEARNERS = {"grid": 10, "pendulum": 5, "table": 10}
"""Of each method."""
BATCHES = 250
"""Iterations of a training, or more while its episodes are long."""
DIVERGENCE_LIMIT = 1e6
"""Times the largest cost: what no estimate reaches that converges."""

GRID = {"system": "grid"}

WORLD = Group("World", effect="solve")
LEARNING = Group("Learning", effect="solve")
EXPLORATION = Group("Exploration", effect="solve")
VIEW = Group("View")


class TdParams(Params):
    """What the user can turn."""

    system: str = WORLD.choice("grid", WORLDS, "World", effect="restart", key=True)
    """A walk to the goal of the map below, a pendulum that a weak motor swings up, or a table of
    your own."""
    map: MapText = WORLD.text(MAPS["cliff"], "Map", rows=8, max_length=MAP_LENGTH, when=GRID)
    """S start, G goal, # wall, H hole (an end for 100), C cliff, . free, + and - ends that gain and
    cost 1; a last row of digits is wind, upwards; below, costs of letters: m = cost 3, or
    T = reward 5, end."""
    table: TableText = WORLD.text(
        TAXICAB,
        "Your table",
        rows=8,
        max_length=TABLE_LENGTH,
        effect="restart",
        when={"system": "table"},
    )
    """CSV or JSON, pasted or a file: from, action, to, probability, cost or reward, a row for each
    transition; or state, action, cost, then a column for each state. Start: the first state; what
    has no row is an end."""
    brush: str = WORLD.choice(
        "G",
        {
            "G": "moves the goal",
            "S": "moves the start",
            "#": "walls up",
            "H": "digs a hole",
            "C": "makes cliff",
        },
        "A click on a cell",
        effect="live",
        when=GRID,
    )
    """And walls or cliff clicked once more are free again."""
    kings: bool = WORLD.toggle(False, "King's moves", effect="restart", when=GRID)
    """Diagonal steps too: eight controls instead of four."""
    slip: float = WORLD.knob(0.0, 0.0, 0.8, r"p_{slip}", "", "Slip", step=0.01, when=GRID)
    """Probability that a step on the grid goes wherever it likes, or sideways."""
    sideways: bool = WORLD.toggle(False, "Slip to the sides only", when=GRID)
    """Half of it to either side of the direction wanted, as in the worlds of many books."""
    living: float = WORLD.knob(
        1.0, -0.1, 5.0, "l_{step}", "", "Cost of living", step=0.01, when=GRID
    )
    """What any step costs, beside what the cell costs that it leads to."""
    gamma: float = WORLD.knob(1.0, 0.0, 1.0, r"\gamma", "", "Discount", step=0.01)
    """Of the next step's cost. The pendulum's task never ends: 0.99 at most there. A table without
    an end needs less than 1, too."""
    effort: float = WORLD.knob(
        0.05,
        0.0,
        1.0,
        "w_u",
        "1/(N·m)²",
        "Price of torque",
        scale="log",
        when={"system": "pendulum"},
    )
    """In the pendulum's cost, dt (e² + 0.05 v² + w_u τ²)."""
    anywhere: bool = WORLD.toggle(False, "Start anywhere")
    """Episodes begin in any state instead of the start."""

    method: str = LEARNING.choice(
        "q-learning", LEARNING_METHODS, "Method", effect="restart", key=True
    )
    """Blue in the scene."""
    second: str = LEARNING.choice(
        "sarsa", {"none": "None", **LEARNING_METHODS}, "Second method", effect="restart", key=True
    )
    """Orange. Both begin with the same luck."""
    n: float = LEARNING.knob(
        4, 1, 20, "n", "", "Steps", step=1, key=True, when=where_chosen("sarsa-n")
    )
    """Costs that SARSA(n) waits for before it trusts its estimate of the rest."""
    decay: float = LEARNING.knob(
        0.5,
        0.0,
        1.0,
        r"\lambda",
        "",
        "Trace decay",
        step=0.01,
        key=True,
        when=where_chosen("sarsa-lambda"),
    )
    """Of SARSA(λ): 0 is SARSA, 1 waits for all costs of the episode."""
    replacing: bool = LEARNING.toggle(False, "Replacing traces", when=where_chosen("sarsa-lambda"))
    """A pair met again has trace 1 instead of one more; keeps SARSA(λ) from diverging."""
    offline: bool = LEARNING.toggle(False, "Learn at the end", when=where_chosen("sarsa-lambda"))
    """SARSA(λ) takes all updates of an episode at its end."""
    alpha: float = LEARNING.knob(0.5, 0.0, 1.0, r"\alpha", "", "Step size", step=0.01, key=True)
    """How far one surprise moves an estimate."""
    omega: float = LEARNING.knob(0.0, 0.0, 1.0, r"\omega", "", "Step decay", step=0.01)
    """The k-th update has α/k^ω: 0 is constant, above 1/2 Robbins-Monro."""
    q0: float = LEARNING.knob(0.0, 0.0, 50.0, "Q_0", "", "First guess", step=0.5, effect="restart")
    """Of every Q. Below the truth is optimistic, above pessimistic."""
    episodes: float = LEARNING.knob(500, BATCHES, 2000, "K", "", "Episodes", scale="log", key=True)
    """Of one training, each of ten learners (pendulum: five); in about 250 batches."""
    explorer: str = EXPLORATION.choice("epsilon-greedy", EXPLORATIONS, "Exploration", key=True)
    """Who decides while learning. The other controller walks along the top row, is PD, or
    takes what costs least at once."""
    epsilon: float = EXPLORATION.knob(
        0.1,
        0.0,
        1.0,
        r"\varepsilon",
        "",
        "Chance of any control",
        step=0.01,
        key=True,
        when={"explorer": ["epsilon-greedy", "follow"]},
    )
    """That it is tried instead of the best, or of the other controller's."""
    fading: float = EXPLORATION.knob(
        0.0,
        0.0,
        1.0,
        "d",
        "",
        "Fading",
        step=0.01,
        when={"explorer": ["epsilon-greedy", "boltzmann", "follow"]},
    )
    """At the k-th visit of a state ε/k^d: above 0 greedy in the limit (GLIE); β grows."""
    beta: float = EXPLORATION.knob(
        1.0,
        0.01,
        100.0,
        r"\beta",
        "",
        "Inverse temperature",
        scale="log",
        key=True,
        when={"explorer": "boltzmann"},
    )
    """0 tries all alike, large is greedy."""
    bound: float = EXPLORATION.knob(
        1.0,
        0.0,
        100.0,
        "L",
        "",
        "Confidence",
        scale="log",
        key=True,
        when={"explorer": "confidence"},
    )
    """Width of the confidence bound, in units of cost."""

    shown: str = VIEW.choice(
        "first",
        {"first": "First", "second": "Second"},
        "Values of method",
        when={"second": list(LEARNING_METHODS)},
    )
    """Whose estimates colour the scene and the maps."""
    learner: float = VIEW.knob(1, 1, 10, "s", "", "Learner", step=1)
    """Which of those who learn side by side is shown."""
    control: float = VIEW.knob(0, 0, 8, r"u_{map}", "", "Control of the map", step=1)
    """The map of Q shows this control; 0: the best in each state."""

    @property
    def task(self) -> ControlTask:
        """What is to be learned."""
        if self.system == "pendulum":
            gamma = min(self.gamma, LARGEST_GAMMA)
            return pendulum_task(gamma, self.effort, self.anywhere)
        if self.system == "table":
            return table_task(self.table, self.gamma, self.anywhere)
        happens = (self.slip, self.sideways, self.living)
        return grid_task(self.map, self.kings, *happens, self.gamma, self.anywhere)

    @property
    def methods(self) -> list[str]:
        """The names of one or two methods."""
        return chosen_methods(self.method, self.second)

    @property
    def method_numbers(self) -> list[int]:
        """The same as the algorithms number them."""
        return [list(LEARNING_METHODS).index(name) for name in self.methods]

    @property
    def learners(self) -> int:
        """Of each method."""
        return LEARNERS[self.system]

    @property
    def view(self) -> tuple[int, int]:
        """Which method's learner is shown, and which of its learners."""
        second = self.shown == "second" and self.second != "none"
        return int(second), min(round(self.learner), self.learners) - 1

    @property
    def behaviour(self) -> BehaviourPolicy:
        """Who decides while learning."""
        kind = list(EXPLORATIONS).index(self.explorer)
        follows = kind == exploration.FIXED_POLICY
        policy = self.task.reference_policy if follows else np.zeros(0, np.int64)
        return BehaviourPolicy(kind, self.epsilon, self.fading, self.beta, self.bound, policy)

    @property
    def rule(self) -> UpdateRule:
        """How estimates move."""
        limit = DIVERGENCE_LIMIT * max(1.0, self.task.mdp.largest_cost)
        n = round(self.n)
        return UpdateRule(
            self.alpha, self.omega, n, self.decay, self.replacing, self.offline, limit
        )
