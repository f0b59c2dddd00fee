"""What the user turns in bandits: the costs behind the doors, and who opens them how."""

from labs.algorithms.bandits import SAMPLE_MEAN
from labs.algorithms.exploration import (
    BOLTZMANN,
    CONFIDENCE_BOUND,
    EPSILON_GREEDY,
    THOMPSON,
    BehaviourPolicy,
)
from labs.params import Condition, Group, Params, Value
from labs.problems.episodes import UpdateRule

STRATEGIES = {
    "greedy": "Greedy",
    "epsilon": "ε-greedy",
    "decaying": "ε decaying",
    "boltzmann": "Boltzmann",
    "bound": "LCB",
    "thompson": "Thompson",
    "uniform": "All doors alike",
}
KINDS = {"online": "Online", "active": "Active", "offline": "Non-interactive"}
"""Of learning (notes, 3.6.1)."""
KINDS_WITH_TEST = ("active", "offline")
"""Those in which a test follows, and it alone counts."""
TASK_COUNT = 1000
"""Played at once by each strategy."""
SELECTABLE_TASKS = 20
"""Of them can be looked at."""

WORLD = Group("Doors", effect="restart")
LEARNING = Group("Learning", effect="solve")
STRATEGY = Group("Strategies", effect="solve")
ESTIMATE = Group("Estimates", effect="solve")
VIEW = Group("View")

DOORS = {"world": "doors"}


def _if_strategy(strategy: str) -> Condition:
    """Where somebody plays this."""
    return *({name: [strategy]} for name in ("first", "second")), {"everybody": [True]}


class BanditParams(Params):
    """What the user can turn."""

    world: str = WORLD.choice("arms", {"doors": "Two doors", "arms": "Ten doors"}, "Task", key=True)
    """Two doors of given mean costs, or ten with means drawn anew for each task from N(0, 1)."""
    left: float = WORLD.knob(-2.5, -5.0, 5.0, r"\mu_1", "", "Left door", step=0.1, when=DOORS)
    """What it costs on average; below 0 is a gain."""
    right: float = WORLD.knob(-2.0, -5.0, 5.0, r"\mu_2", "", "Right door", step=0.1, when=DOORS)
    """What it costs on average."""
    deviation: float = WORLD.knob(1.0, 0.0, 3.0, r"\sigma", "", "Deviation", step=0.05)
    """Standard deviation of the cost behind each door."""
    drift: float = WORLD.knob(0.0, 0.0, 0.2, r"\sigma_\mu", "", "Drift", step=0.005)
    """Standard deviation of a step that each mean takes after each turn."""
    kind: str = LEARNING.choice("online", KINDS, "Learning", key=True)
    """Whose cost counts, and when. Online: every turn's. Active: the turns are free, a test of as
    many turns follows and counts. Non-interactive: the same, but others open the doors before the
    test, and the players only watch."""
    first: str = STRATEGY.choice("greedy", STRATEGIES, "Blue", key=True)
    """The strategy of blue, or of those whom blue watches. LCB: the lowest confidence bound."""
    second: str = STRATEGY.choice("epsilon", STRATEGIES, "Orange", key=True)
    """The strategy of orange, or of those whom orange watches. All meet the same luck."""
    everybody: bool = STRATEGY.toggle(False, "All strategies", key=True)
    """The others play, too, in the plots."""
    epsilon: float = STRATEGY.knob(
        0.1,
        0.0,
        1.0,
        r"\varepsilon",
        "",
        "Chance of any door",
        step=0.01,
        key=True,
        when=_if_strategy("epsilon"),
    )
    """Of ε-greedy, at each turn alike."""
    decay: float = STRATEGY.knob(
        0.7, 0.05, 1.0, "d", "", "Decay", step=0.05, key=True, when=_if_strategy("decaying")
    )
    """At turn t any door is opened with probability 1/t^d."""
    beta: float = STRATEGY.knob(
        4.0,
        0.1,
        100.0,
        r"\beta",
        "",
        "Inverse temperature",
        scale="log",
        key=True,
        when=_if_strategy("boltzmann"),
    )
    """0 tries all alike, large is greedy."""
    bound: float = STRATEGY.knob(
        1.0, 0.0, 10.0, "L", "", "Confidence", step=0.1, key=True, when=_if_strategy("bound")
    )
    """Width of the confidence bound, in units of cost."""
    measured: bool = STRATEGY.toggle(False, "L = largest |l| so far", when=_if_strategy("bound"))
    """The safe choice, where costs are bounded: instead of the slider."""
    turns: float = STRATEGY.knob(1000, 100, 5000, "T", "", "Turns", scale="log")
    """Doors that are opened before any test."""
    q0: float = ESTIMATE.knob(0.0, -5.0, 5.0, "Q_0", "", "First guess", step=0.1)
    """Of what every door costs. Below the truth is optimistic."""
    forget: bool = ESTIMATE.toggle(False, "Forget old costs")
    """A constant step instead of the mean of all costs."""
    alpha: float = ESTIMATE.knob(
        0.1, 0.01, 1.0, r"\alpha", "", "Step size", step=0.01, when={"forget": True}
    )
    """How far a new cost moves its estimate."""
    pace: float = VIEW.knob(5, 1, 50, "f", "1/s", "Turns a second", scale="log", step=1)
    """In the scene, where one of the tasks is played slowly."""
    task: float = VIEW.knob(1, 1, SELECTABLE_TASKS, "m", "", "Task shown", step=1)
    """Of a thousand that are played at once."""

    @property
    def strategies(self) -> tuple[str, ...]:
        """The names of all that play: blue's, orange's, and the others' where all do."""
        two = (self.first, self.second)
        rest = (name for name in STRATEGIES if name not in (*two, "uniform"))
        return (*two, *rest) if self.everybody else two

    @property
    def players(self) -> tuple[str, ...]:
        """Of all that play, as plots show them; told apart where blue and orange are the same."""
        names = [STRATEGIES[name] for name in self.strategies]
        if self.first == self.second:
            names[:2] = f"{names[0]}, blue", f"{names[1]}, orange"
        return tuple(names)

    @property
    def game_key(self) -> tuple[Value, ...]:
        """All that a game depends on, and the task shown of it."""
        return tuple(value for name, value in self.model_dump().items() if name != "pace")

    @property
    def training_turns(self) -> int:
        """T"""
        return round(self.turns)

    @property
    def total_turns(self) -> int:
        """Turns of a game: with a test, as many again."""
        return self.training_turns * (2 if self.kind in KINDS_WITH_TEST else 1)

    @property
    def rule(self) -> UpdateRule:
        """How estimates move."""
        return UpdateRule(self.alpha) if self.forget else SAMPLE_MEAN

    def behaviour(self, strategy: str) -> BehaviourPolicy:
        """How doors are chosen."""
        return {
            "greedy": BehaviourPolicy(epsilon=0.0),
            "epsilon": BehaviourPolicy(epsilon=self.epsilon),
            "decaying": BehaviourPolicy(EPSILON_GREEDY, epsilon=1.0, decay=self.decay),
            "boltzmann": BehaviourPolicy(BOLTZMANN, beta=self.beta),
            "bound": BehaviourPolicy(CONFIDENCE_BOUND, bound=self.bound),
            # Who knows how much luck there is; without any there is nothing to doubt.
            "thompson": BehaviourPolicy(THOMPSON, bound=self.deviation),
            "uniform": BehaviourPolicy(epsilon=1.0),
        }[strategy]

    @property
    def shown(self) -> int:
        """The task shown, from 0."""
        return round(self.task) - 1
