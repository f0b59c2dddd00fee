"""What the user turns in model-free prediction: whose value is learned, how, and what is shown."""

from labs.params import Group, Params
from labs.problems.episodes import UpdateRule
from labs.reinforcement_learning.prediction.worlds import (
    LARGEST_GAMMA,
    PredictionWorld,
    grid_prediction,
    pendulum_prediction,
    walk_prediction,
)
from labs.tasks.random_walk.walks import FIVE_STATE_WALK, NINETEEN_STATE_WALK, WalkShape

PREDICTION_METHODS = {"mc": "Monte Carlo", "td": "TD(0)"}
WALKS = {"five": FIVE_STATE_WALK, "nineteen": NINETEEN_STATE_WALK}
PREDICTOR = WalkShape(2, 0.0, -1.0)
"""What the two states of eight given episodes are drawn on."""

ONLINE, BATCH = {"study": "online"}, {"study": "batch"}
LEARNED = {"study": ["online", "corners"]}
PENDULUM = {"study": "online", "world": "pendulum"}

TASK = Group("Task", effect="restart")
LEARNING = Group("Learning", effect="solve")
VIEW = Group("View")


class PredictionParams(Params):
    """What the user can turn."""

    study: str = TASK.choice(
        "online",
        {
            "online": "Episode by episode",
            "batch": "The same episodes again and again",
            "corners": "Four kinds of update",
        },
        "What is compared",
        key=True,
    )
    """Learning from ever new episodes, from a fixed batch of them, or with and without samples."""
    world: str = TASK.choice(
        "five",
        {
            "five": "Walk of 5 states",
            "nineteen": "Walk of 19 states",
            "grid": "Grid world",
            "pendulum": "Pendulum under PD",
        },
        "World",
        key=True,
        when=ONLINE,
    )
    """And with it the policy: steps at random, or a PD controller."""
    data: str = TASK.choice(
        "predictor",
        {
            "predictor": "Eight episodes of A and B",
            "five": "Walk of 5 states",
            "nineteen": "Walk of 19 states",
        },
        "Episodes of",
        key=True,
        when=BATCH,
    )
    """What the batch consists of."""
    size: float = TASK.knob(
        20,
        1,
        100,
        "N",
        "",
        "Episodes of the batch",
        step=1,
        key=True,
        when={"study": "batch", "data": ["five", "nineteen"]},
    )
    """Of each learner."""
    ends: bool = TASK.toggle(True, "Ends upright", when=PENDULUM)
    """Whether an episode is over near upright at rest; else it is cut after 15 s."""
    noise: float = TASK.knob(
        0.2, 0.0, 1.0, r"\varepsilon", "", "Any torque", step=0.01, when=PENDULUM
    )
    """Probability of a torque drawn at random instead of the controller's."""
    gamma: float = TASK.knob(1.0, 0.0, 1.0, r"\gamma", "", "Discount", step=0.01, when=LEARNED)
    """Of the next step's cost; 0.95 at most where episodes need not end, on the pendulum."""
    v0: float = TASK.knob(-0.5, -50.0, 50.0, "V_0", "", "First guess", step=0.1)
    """What is expected of every state at first."""

    visits: str = LEARNING.choice(
        "every", {"first": "First visit", "every": "Every visit"}, "Monte Carlo", when=LEARNED
    )
    """Whether a state that is met again in an episode is learned from again."""
    alpha_mc: float = LEARNING.knob(
        0.03, 0.0, 1.0, r"\alpha_{MC}", "", "Step of Monte Carlo", step=0.01, key=True, when=LEARNED
    )
    """How far a cost-to-go moves its estimate."""
    alpha_td: float = LEARNING.knob(
        0.1, 0.0, 1.0, r"\alpha_{TD}", "", "Step of TD(0)", step=0.01, key=True, when=LEARNED
    )
    """How far a TD error moves its estimate."""
    omega: float = LEARNING.knob(
        0.0, 0.0, 1.0, r"\omega", "", "Step decay", step=0.01, key=True, when=LEARNED
    )
    """The N-th update of a state has α/N^ω: 0 is constant, above 1/2 Robbins-Monro."""
    episodes: float = LEARNING.knob(
        100, 1, 2000, "K", "", "Episodes", scale="log", step=1, when=LEARNED
    )
    """Of each learner in one training."""

    shown: str = VIEW.choice(
        "walker",
        {"walker": "One learner, step by step", "all": "All learners: mean and spread"},
        "Values shown",
        key=True,
        when=ONLINE,
    )
    """In the scene: of the one who walks there, or of those who have learned already."""
    method: str = VIEW.choice(
        "td", PREDICTION_METHODS, "Method", when={"study": "online", "world": ["grid", "pendulum"]}
    )
    """Whose values the scene shows; on a walk it shows both."""
    state: float = VIEW.knob(0, 0, 19, "x", "", "State looked at", step=1, when=ONLINE)
    """Number of the state, from 1, whose targets are drawn; 0: the start."""
    pace: float = VIEW.knob(4, 1, 50, "f", "1/s", "Steps a second", scale="log", when=LEARNED)
    """Of the walker in the scene."""

    @property
    def place(self) -> WalkShape:
        """The walk of a batch."""
        return WALKS.get(self.data, PREDICTOR) if self.study == "batch" else FIVE_STATE_WALK

    @property
    def prediction(self) -> PredictionWorld:
        """Whose value is learned."""
        if self.study == "batch":
            return walk_prediction(WALKS.get(self.data, FIVE_STATE_WALK), 1.0)
        if self.study == "corners":
            return walk_prediction(FIVE_STATE_WALK, self.gamma)
        if self.world == "pendulum":
            return pendulum_prediction(min(self.gamma, LARGEST_GAMMA), self.noise, self.ends)
        return (
            grid_prediction(self.gamma)
            if self.world == "grid"
            else walk_prediction(WALKS[self.world], self.gamma)
        )

    @property
    def rules(self) -> tuple[UpdateRule, UpdateRule]:
        """How estimates move: of Monte Carlo and of TD(0)."""
        return UpdateRule(self.alpha_mc, self.omega), UpdateRule(self.alpha_td, self.omega)

    @property
    def looked_at(self) -> int:
        """The state whose targets are drawn."""
        world = self.prediction
        return (
            world.states[min(round(self.state), len(world.states)) - 1]
            if round(self.state)
            else world.start
        )
