"""What the user turns in deep Q-learning: the task, the network, how it learns, what is shown."""

from typing import Any

from labs.algorithms.dqn import DqnOptions
from labs.params import Group, Params
from labs.reinforcement_learning.dqn.controllers import CONTROLLERS
from labs.reinforcement_learning.dqn.tasks import TITLES, RobotTask, learning_task

WORLD = Group("World", effect="restart")
NETWORK = Group("Network", effect="restart")
LEARNING = Group("Learning", effect="solve")
EXPLORATION = Group("Exploration", effect="solve")
VIEW = Group("View")
REACHING = {"system": "ur5"}
TARGETS = {
    "copied": "Copied every C updates",
    "polyak": "Following w slowly",
    "none": "w itself: no fixed targets",
}
WEIGHTS = {"latest": "Latest", "best": "Best so far"}
BY_NETWORK = ({"controller": "network"}, {"system": ["double-pendulum", "ur5"]})


class DqnParams(Params):
    """What the user can turn."""

    system: str = WORLD.choice("pendulum", TITLES, "Robot", key=True)
    """Pendulums are to be swung up by motors that cannot lift them; the UR5 is to reach."""
    target_x: float = WORLD.knob(
        0.45, -0.9, 0.9, "p_x", "m", "Target, ahead", step=0.01, effect="live", when=REACHING
    )
    """Of the tip; drag the ball."""
    target_z: float = WORLD.knob(
        0.45, 0.1, 1.1, "p_z", "m", "Target, up", step=0.01, effect="live", when=REACHING
    )
    """Above the floor."""
    learners: float = WORLD.knob(1, 1, 3, "S", "", "Learners", step=1)
    """Who differ in their luck only: first weights, starts, what is tried and drawn."""

    layers: float = NETWORK.knob(2, 1, 3, "L", "", "Hidden layers", step=1)
    """Of the network, besides the output."""
    width: float = NETWORK.knob(64, 8, 128, "n_h", "", "Width", step=8, key=True)
    """Neurons of a hidden layer."""
    capacity: float = NETWORK.knob(20000, 500, 50000, "N", "", "Buffer", scale="log")
    """Transitions the replay buffer holds; the newest replace the oldest."""

    alpha: float = LEARNING.knob(
        1e-3, 1e-5, 1e-1, r"\alpha", "", "Learning rate", scale="log", key=True
    )
    """Of Adam."""
    gamma: float = LEARNING.knob(0.99, 0.0, 0.999, r"\gamma", "", "Discount", step=0.001, key=True)
    """Of the next step's cost: of 0.05 s."""
    batch: float = LEARNING.knob(64, 4, 128, "k", "", "Mini-batch", step=4)
    """Transitions an update learns from."""
    replay: bool = LEARNING.toggle(True, "Experience replay", key=True)
    """Mini-batches drawn from the buffer at random; off: the latest transitions, as they come."""
    targets: str = LEARNING.choice("copied", TARGETS, "Weights of the targets", key=True)
    """w⁻: copies of w taken now and then, or a mean that follows (Polyak; not in the notes), or w
    itself."""
    period: float = LEARNING.knob(
        200, 2, 5000, "C", "", "Target period", scale="log", key=True, when={"targets": "copied"}
    )
    """Updates from one copy of the weights to the next."""
    tau: float = LEARNING.knob(
        0.005, 1e-4, 1.0, r"\tau", "", "Following", scale="log", when={"targets": "polyak"}
    )
    """At each update the weights of the targets go this part of the way to w."""
    double: bool = LEARNING.toggle(False, "Double DQN")
    """The present weights choose the next control, the fixed ones judge it. Not in the notes."""
    every: float = LEARNING.knob(4, 1, 32, "m", "", "Steps an update", step=1)
    """Steps of a robot from one update to the next."""
    steps: float = LEARNING.knob(25000, 2000, 400000, "K", "", "Steps", scale="log", key=True)
    """Of the sixteen robots of each learner together, in one training."""

    epsilon: float = EXPLORATION.knob(1.0, 0.0, 1.0, r"\varepsilon_0", "", "At first", step=0.01)
    """Share of controls that are tried blindly."""
    epsilon_end: float = EXPLORATION.knob(
        0.05, 0.0, 1.0, r"\varepsilon_1", "", "At last", step=0.01, key=True
    )
    """And once the steps below are done."""
    epsilon_steps: float = EXPLORATION.knob(
        10000, 500, 200000, "K_\\varepsilon", "", "Steps from first to last", scale="log"
    )
    """Along a straight line."""

    controller: str = VIEW.choice(
        "network", CONTROLLERS, "Drives the robot", when={"system": "pendulum"}
    )
    """The two others know the equation of motion and learn nothing: dynamic programming on a table,
    and pumping energy, then LQR near the top (not in the notes)."""
    weights: str = VIEW.choice("latest", WEIGHTS, "Weights", when=BY_NETWORK)
    """The best are those whose greedy policy cost least; learning may make worse what was good."""
    learner: float = VIEW.knob(1, 1, 3, "s", "", "Learner", step=1)
    """Which of those who learn side by side is shown."""

    @property
    def task(self) -> RobotTask:
        """What is to be learned."""
        return learning_task(self.system)

    @property
    def driven_by(self) -> str:
        """What drives the robot in the scene, a key of CONTROLLERS."""
        return self.controller if self.system == "pendulum" else "network"

    @property
    def hidden(self) -> tuple[int, ...]:
        """Sizes of the hidden layers."""
        return (round(self.width),) * round(self.layers)

    @property
    def shown(self) -> int:
        """The learner that is shown, from 0."""
        return min(round(self.learner), round(self.learners)) - 1

    @property
    def options(self) -> DqnOptions:
        """How it learns."""
        return DqnOptions(
            gamma=self.gamma,
            learning_rate=self.alpha,
            batch_size=round(self.batch),
            experience_replay=self.replay,
            update_every=round(self.every),
            target_every=round(self.period) if self.targets == "copied" else 1,
            polyak=self.tau if self.targets == "polyak" else 0.0,
            double_q_learning=self.double,
            epsilon=self.epsilon,
            epsilon_end=self.epsilon_end,
            epsilon_steps=round(self.epsilon_steps),
            cost_scale=self.task.cost_scale,
        )

    @property
    def network(self) -> dict[str, Any]:
        """What `dqn.init` takes besides the environment and the luck."""
        return {"hidden": self.hidden, "capacity": round(self.capacity)}
