"""What the user turns in function approximation: the world, its features, how weights move."""

from labs.params import Group, Params, Value
from labs.reinforcement_learning.function_approximation.feature_sets import FEATURE_SETS

WORLDS = {
    "walk": "Random walk of 1000 states",
    "surface": "Pendulum, a given policy",
    "swing": "Pendulum, learning to swing up",
    "star": "Baird's star",
    "pair": "Two states, w and 2w",
    "spiral": "A spiral",
    "nine": "Nine learners",
}
TARGETS = {
    "oracle": "The true value",
    "mc": "Monte Carlo",
    "td": "TD(0)",
    "td-lambda": "TD(λ)",
}
BATCH_TARGETS = {name: label for name, label in TARGETS.items() if name != "td-lambda"}
"""A sample out of a batch has lost its episode, and with it its trace."""
CONTROLLERS = {"mc": "MC control", "sarsa": "SARSA", "q-learning": "Q-learning"}
"""In the order of the numbers in labs/algorithms/linear_control.py."""
DATA = {
    "latest": "The latest sample, once",
    "replay": "Samples out of a buffer",
    "batch": "Least squares",
}
LEARNERS = 6
SHOWN_FEATURES = 12
"""One at a time on the plane, as many at once on the line."""
ITERATIONS = 100

PLANE = {"world": ["surface", "swing"]}
PREDICTION = {"world": ["walk", "surface"]}
FITTED = {"world": ["walk", "surface", "swing"]}
TRIAD = {"world": ["star", "pair"]}
EXAMPLES: dict[str, Value | list[Value]] = {"world": ["star", "pair", "spiral"]}
BOOTSTRAPPED: dict[str, Value | list[Value]] = {**EXAMPLES, "bootstrap": True}
LEARNING_RATE = ({**FITTED, "data": ["latest", "replay"]}, EXAMPLES)
"""Least squares takes no steps; the nine learners have step sizes of their own."""
SIZED: dict[str, list[Value]] = {"features": [name for name in FEATURE_SETS if name != "table"]}

WORLD = Group("World", effect="restart")
FEATURES = Group("Features", effect="restart")
LEARNING = Group("Learning", effect="solve")
TOGETHER = Group("Three together", effect="restart")
VIEW = Group("View")


class ApproximationParams(Params):
    """What the user can turn."""

    world: str = WORLD.choice("walk", WORLDS, "World", key=True)
    """What is approximated: the value of a policy, an optimal Q, or something made to go wrong."""
    ending: float = WORLD.knob(
        0.1, 0.0, 1.0, "p", "", "Chance to end", step=0.01,
        when=({"world": "pair", "bootstrap": True}, {"world": "pair", "off_policy": False}),
    )  # fmt: skip
    """Of each step in the second state."""

    features: str = FEATURES.choice("aggregation", FEATURE_SETS, "Features", key=True, when=FITTED)
    """What the value is a weighted sum of."""
    n: float = FEATURES.knob(
        10, 1, 20, "n", "", "Groups, order, cells", step=1, key=True,
        when={"world": "walk", **SIZED},
    )  # fmt: skip
    """Groups, centers or cells along the line; the order of a polynomial or of a Fourier series."""
    m: float = FEATURES.knob(
        6, 1, 10, "m", "", "The same, each way", step=1, key=True, when={**PLANE, **SIZED}
    )
    """Along the angle and along the velocity: their products are the features."""

    data: str = LEARNING.choice(
        "latest", DATA, "Learns from", effect="restart", key=True, when=FITTED
    )
    """Each sample once as it comes; or from a fixed batch of episodes, in random order, again and
    again; or the weights that fit the batch best: at once for a given policy, else fit after fit
    to the targets of Q-learning."""
    target: str = LEARNING.choice(
        "mc", TARGETS, "Target", effect="restart", key=True, when={**PREDICTION, "data": "latest"}
    )
    """What v(x, w) is moved towards."""
    batch_target: str = LEARNING.choice(
        "mc", BATCH_TARGETS, "Batch target", effect="restart", key=True,
        when={**PREDICTION, "data": ["replay", "batch"]},
    )  # fmt: skip
    """What v(x, w) is moved towards, or fitted to."""
    controller: str = LEARNING.choice(
        "sarsa",
        CONTROLLERS,
        "Method",
        key=True,
        when={"world": "swing", "data": "latest"},
    )
    """Whose target q(x, u, w) is moved towards."""
    alpha: float = LEARNING.knob(
        2e-4,
        1e-5,
        1.0,
        r"\alpha",
        "",
        "Step size",
        scale="log",
        key=True,
        when=LEARNING_RATE,
    )
    """How far an error moves the weights, times the features."""
    omega: float = LEARNING.knob(
        0.0, 0.0, 1.0, r"\omega", "", "Step decay", step=0.01, when=LEARNING_RATE
    )
    """The k-th update has α/k^ω: 0 is constant, above 1/2 Robbins-Monro."""
    decay: float = LEARNING.knob(
        0.8,
        0.0,
        1.0,
        r"\lambda",
        "",
        "Trace decay",
        step=0.01,
        key=True,
        when={**PREDICTION, "data": "latest", "target": "td-lambda"},
    )
    """0 is TD(0), 1 close to Monte Carlo."""
    epsilon: float = LEARNING.knob(
        0.1,
        0.0,
        1.0,
        r"\varepsilon",
        "",
        "Chance of any control",
        step=0.01,
        key=True,
        when={"world": "swing", "data": "latest"},
    )
    """Instead of the one that seems best."""
    episodes: float = LEARNING.knob(
        5000, 100, 20000, "K", "", "Episodes", scale="log", key=True,
        when={**FITTED, "data": "latest"},
    )  # fmt: skip
    """Of each learner."""
    batch: float = LEARNING.knob(
        100, 10, 1000, "B", "", "Episodes of the batch", scale="log", effect="restart", key=True,
        when={**FITTED, "data": ["replay", "batch"]},
    )  # fmt: skip
    """Collected before learning begins, of each learner."""
    passes: float = LEARNING.knob(
        50, 1, 200, "r", "", "Uses of a sample", scale="log", key=True,
        when={**FITTED, "data": "replay"},
    )  # fmt: skip
    """How often a sample of the batch is drawn, on average."""
    updates: float = LEARNING.knob(
        2000, 100, 100000, "T", "", "Updates", scale="log", key=True, when=EXAMPLES
    )
    """Of each learner."""

    approximate: bool = TOGETHER.toggle(True, "Approximation", key=True, when=TRIAD)
    """Features that states share; else a table."""
    bootstrap: bool = TOGETHER.toggle(True, "Bootstrapping", key=True, when=EXAMPLES)
    """The target is l + γ v(x', w); else the true cost-to-go."""
    off_policy: bool = TOGETHER.toggle(True, "Off-policy", key=True, when=TRIAD)
    """States come as often as another policy than the one judged visits them."""
    gamma: float = WORLD.knob(
        0.99, 0.0, 1.0, r"\gamma", "", "Discount", step=0.01, key=True, when=BOOTSTRAPPED
    )
    """Of the next state's value."""
    correct: bool = TOGETHER.toggle(
        False, "Gradient correction (TDC)", key=True, when={**TRIAD, "bootstrap": True}
    )
    """The true gradient of another error, by second weights."""
    beta: float = TOGETHER.knob(
        0.05, 1e-3, 1.0, r"\beta", "", "Second step size", scale="log",
        when={**TRIAD, "bootstrap": True, "correct": True},
    )  # fmt: skip
    """Of TDC's second weights."""

    look: str = VIEW.choice(
        "estimate",
        {"estimate": "The estimate", "truth": "The truth", "feature": "One feature"},
        "Surface in the scene",
        when=PLANE,
    )
    """Thin lines are the truth."""
    feature: float = VIEW.knob(1, 1, 100, "i", "", "Feature", step=1, when=PLANE)
    """Which one the map shows."""
    learner: float = VIEW.knob(1, 1, LEARNERS, "s", "", "Learner", step=1, when=(FITTED, EXAMPLES))
    """Which of those who learn side by side is shown."""

    @property
    def shown(self) -> int:
        """The learner shown, from 0."""
        return round(self.learner) - 1
