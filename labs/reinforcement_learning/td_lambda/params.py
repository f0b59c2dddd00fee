"""What the user turns in TD(lambda): where, by which method, and what is measured and shown."""

from typing import Annotated

from pydantic import AfterValidator

from labs.algorithms import prediction
from labs.params import Group, Params
from labs.problems.episodes import UpdateRule
from labs.reinforcement_learning.td_lambda.tasks import PredictionPlace, grid_place, walk_place
from labs.tasks.grid_world.map import MAPS, grid_world
from labs.tasks.grid_world.params import MAP_LENGTH, MapText
from labs.tasks.method_pair.params import chosen_methods, where_chosen

TD_METHODS = {
    "n-step": "n-step TD",
    "forward": "Forward view",
    "backward": "Backward view",
    "true-online": "True online",
    "td0": "TD(0)",
    "monte-carlo": "Monte Carlo",
}
METHOD_NUMBERS = {
    "n-step": prediction.N_STEP,
    "forward": prediction.LAMBDA_RETURN,
    "backward": prediction.ELIGIBILITY_TRACES,
    "true-online": prediction.TRUE_ONLINE,
    "td0": prediction.TD0,
    "monte-carlo": prediction.EVERY_VISIT,
}
"""Of the methods in labs/algorithms/prediction.py."""
LAMBDA_METHODS = ("forward", "backward", "true-online")
OFFLINE_METHODS = tuple(name for name in TD_METHODS if name != "true-online")
"""That may take all updates of an episode at its end."""
DIVERGENCE_LIMIT = 1e6
"""Times the largest cost-to-go: what no estimate reaches that converges."""
GRID = {"system": "grid"}

WORLD = Group("World", effect="restart")
LEARNING = Group("Learning", effect="solve")
VIEW = Group("View")


def _require_reachable_goal(text: str) -> str:
    world = grid_world(text, False)
    if world.terminal.all():
        raise ValueError("every cell of the map is a goal: an episode needs one to start in")
    lost = world.cells[~world.mdp(1.0).can_end]
    if len(lost):
        row, column = lost[0] + 1
        raise ValueError(
            f"from row {row}, column {column} no way leads to the goal, and a policy without an "
            "end has no cost-to-go: open a way, or wall the cell up"
        )
    return text


OpenMap = Annotated[MapText, AfterValidator(_require_reachable_goal)]


class TdLambdaParams(Params):
    """What the user can turn."""

    system: str = WORLD.choice(
        "walk", {"walk": "19 states", "grid": "Grid world"}, "Walk", key=True
    )
    """Left or right by chance until an end is reached, or through rooms to the goal."""
    map: OpenMap = WORLD.text(MAPS["room"], "Map", rows=8, max_length=MAP_LENGTH, when=GRID)
    """S start, G goal, # wall, H hole (an end for 100), C cliff, . free, + and - ends that gain and
    cost 1; a last row of digits is wind, upwards; below, costs of letters: m = cost 3, or
    T = reward 5, end."""
    brush: str = WORLD.choice(
        "#",
        {"#": "walls up", "G": "moves the goal", "S": "moves the start", "C": "makes cliff"},
        "A click on a cell",
        effect="live",
        when=GRID,
    )
    """And walls or cliff clicked once more are free again."""
    wander: float = WORLD.knob(0.3, 0.0, 0.6, r"\varepsilon", "", "Random", step=0.05, when=GRID)
    """Probability of a random step; all others lead the shortest way to the goal."""
    gamma: float = WORLD.knob(1.0, 0.0, 1.0, r"\gamma", "", "Discount", step=0.01)
    """Of the next step's cost."""

    method: str = LEARNING.choice("backward", TD_METHODS, "Method", effect="restart", key=True)
    """Blue in the scene; the family of step sizes is its."""
    second: str = LEARNING.choice(
        "none", {"none": "None", **TD_METHODS}, "Second", effect="restart", key=True
    )
    """Orange. Both meet the same episodes."""
    n: float = LEARNING.knob(
        4, 1, 64, "n", "", "Steps", step=1, key=True, when=where_chosen("n-step")
    )
    """Costs to wait for before the rest is taken from the table."""
    lam: float = LEARNING.knob(
        0.8,
        0.0,
        1.0,
        r"\lambda",
        "",
        "Trace decay",
        step=0.01,
        key=True,
        when=where_chosen(*LAMBDA_METHODS),
    )
    """Of one n-step return to the next: 0 is TD(0), 1 Monte Carlo."""
    alpha: float = LEARNING.knob(0.4, 0.0, 1.0, r"\alpha", "", "Step size", step=0.01, key=True)
    """The part of the way to its target that an estimate moves."""
    offline: bool = LEARNING.toggle(
        False, "Learn at the end", key=True, when=where_chosen(*OFFLINE_METHODS)
    )
    """The values stand still through an episode and take all its updates at its end."""
    episodes: float = LEARNING.knob(10, 1, 100, "K", "", "Episodes", scale="linear", step=1)
    """Of the curves over step sizes: the error is the mean over so many, and over 100 learners."""

    rate: float = VIEW.knob(10.0, 1.0, 100.0, "r", "1/s", "Pace", scale="log")
    """Steps of the walk in the scene a second."""
    shown: str = VIEW.choice(
        "traces", {"traces": "traces", "values": "values"}, "Cells glow by", when=GRID
    )
    """How much a cell is concerned by what happens now, or what it is thought to cost."""
    ahead: float = VIEW.knob(12, 1, 40, "T - t", "", "Steps to the end", step=1)
    """Of the weights in the plot of bars."""

    @property
    def place(self) -> PredictionPlace:
        """Where the walk goes."""
        if self.system == "walk":
            return walk_place(self.gamma)
        return grid_place(self.map, self.wander, self.gamma)

    @property
    def place_key(self) -> tuple[object, ...]:
        """What `place` depends on."""
        own = (self.map, self.wander) if self.system == "grid" else ()
        return (self.system, self.gamma, *own)

    @property
    def methods(self) -> list[str]:
        """The names of one or two methods."""
        return chosen_methods(self.method, self.second)

    def rule(self, method: str) -> UpdateRule:
        """How estimates move by this method."""
        return UpdateRule(
            self.alpha,
            n=round(self.n),
            trace_decay=self.lam,
            offline=self.offline and method in OFFLINE_METHODS,
            limit=DIVERGENCE_LIMIT * self.place.scale,
        )
