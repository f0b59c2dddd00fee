"""Deep Q-learning (notes, 3.8.3): a network learns to drive a robot before your eyes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from labs.algorithms import dqn
from labs.arrays import Training
from labs.lab import Action, Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.params import Value
from labs.reinforcement_learning.dqn.controllers import (
    Controller,
    baseline_costs,
    energy_controller,
    network_controller,
    table_controller,
)
from labs.reinforcement_learning.dqn.driven_robot import (
    DrivenRobot,
    advance_robot,
    apply_push,
    initial_robot,
    set_target,
)
from labs.reinforcement_learning.dqn.params import DqnParams
from labs.reinforcement_learning.dqn.picture import draw_learned, draw_target
from labs.reinforcement_learning.dqn.plots import (
    PLOTS,
    learning_curves,
    map_fields,
    table_map,
    value_map,
)
from labs.reinforcement_learning.dqn.tasks import learning_task, posture_at
from labs.reinforcement_learning.dqn.training import (
    agent_of,
    initial_training,
    is_finite,
    train,
)
from labs.scene import Scene
from labs.tasks.environments.reach import reach
from labs.tasks.environments.torque_task import CONTROL_PERIOD, SUBSTEPS

PUSH = 3.0
"""[rad/s]"""


@dataclass(kw_only=True)
class DqnState(State):
    """What was learned, and a robot that shows it."""

    training: Training
    drive: DrivenRobot


class Dqn(Lab[DqnParams, DqnState]):
    """Learners with networks, and the greedy policy of one of them at work."""

    title = "Deep Q-learning"
    section = "3.8"
    summary = (
        "A network learns to swing up a pendulum in seconds: its value function takes shape while "
        "the robot tries its present policy. Take its replay or its fixed targets away and see."
    )
    Params = DqnParams
    period = CONTROL_PERIOD / SUBSTEPS
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Pendulum": {},
        "Double pendulum": {
            "system": "double-pendulum",
            "width": 128.0,
            "capacity": 50000.0,
            "epsilon_steps": 50000.0,
            "steps": 60000.0,
            "learners": 1.0,
            "weights": "best",
        },
        "UR5": {
            "system": "ur5",
            "width": 128.0,
            "gamma": 0.95,
            "capacity": 50000.0,
            "epsilon_steps": 30000.0,
            "steps": 60000.0,
            "learners": 1.0,
            "weights": "best",
        },
    }
    actions = (Action("push", "Push", "Makes the first joint 3 rad/s faster.", group="World"),)
    handles = (Handle("target", "Where the tip of the UR5 is to go."),)

    def init(self, params: DqnParams, rng: np.random.Generator) -> DqnState:
        task = params.task
        training = initial_training(task, params.network, round(params.learners), rng)
        return DqnState(training=training, drive=initial_robot(task))

    def step(self, params: DqnParams, inputs: Inputs, state: DqnState) -> DqnState:
        """12.5 ms under the greedy policy of the moment."""
        if state.trouble:
            return state
        task, at = params.task, state.drive
        if params.system == "ur5":
            at = set_target(at, posture_at(params.target_x, params.target_z))
        if "push" in inputs.actions:
            at = apply_push(task, at, PUSH)
        at = advance_robot(task, _controller(params, state), at)
        return replace(state, t=state.t + self.period, drive=at)

    def solve(self, params: DqnParams, state: DqnState) -> Iterator[Snapshot | None]:
        """Some rounds of all robots an iteration; goes on from what was learned."""
        task, options, training = params.task, params.options, state.training
        begun, wanted, i, done = _step_count(training), round(params.steps), 0, ""
        while not done:
            after, i = (yield from train(task, options, training)), i + 1
            if not is_finite(after):
                yield Snapshot(i, training, DIVERGENCE_MESSAGE)
                return
            training, made = after, _step_count(after) - begun
            if made >= wanted:
                done = f"{_step_count(training)} steps of each learner done."
            yield Snapshot(i, training, done, min(1.0, made / wanted))

    def accept(self, params: DqnParams, state: DqnState, snapshot: Snapshot) -> DqnState:
        return replace(state, training=snapshot.data)

    def edit(
        self, params: DqnParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The target of the tip, in the arm's plane."""
        return {
            "target_x": params.nearest("target_x", point[0]),
            "target_z": params.nearest("target_z", point[2]),
        }

    def measure(self, params: DqnParams, state: DqnState) -> Measurement:
        task, training, s, at = params.task, state.training, params.shown, state.drive
        measured: dict[str, float | np.ndarray] = {
            "q": at.x[: task.joints],
            "u": at.torque,
            "steps": float(_step_count(training)),
            "updates": float(training["last_updates"][s]),
            "epsilon": dqn.epsilon(params.options, _step_count(training)),
        }
        if training["tried"].size:
            measured["greedy"] = float(training["greedy"][s, -1])
            measured["best"] = float(training["best_cost"][s])
        if params.system == "pendulum":
            measured["table"], measured["energy"] = baseline_costs()
        if params.system == "ur5":
            tips = reach().tips(np.stack([at.x[:2], at.x[4:]]))
            measured["distance"] = float(np.linalg.norm(tips[0] - tips[1]))
        return measured

    def fields(self, params: DqnParams, state: DqnState) -> Mapping[str, np.ndarray]:
        s, training = params.shown, state.training
        others = baseline_costs() if params.system == "pendulum" else None
        shown = map_fields(params.task, training, s, _shown_map(params, state))
        return shown | learning_curves(training, s, others)

    def labels(self, params: DqnParams) -> Mapping[str, str | tuple[str, ...]]:
        across, up = params.task.axes
        return {"across": across, "up": up}

    def draw(self, scene: Scene, params: DqnParams, state: DqnState) -> None:
        task, (value, policy) = params.task, _shown_map(params, state)
        draw_learned(scene, task, value, policy, state.drive)
        if params.system == "ur5":
            draw_target(scene, task, state.drive, params.target_x, params.target_z)

    @classmethod
    def prepare(cls) -> None:
        """Compiles the network, the learner and the table."""
        lab, params = cls(), DqnParams()
        state = lab.init(params, np.random.default_rng(0))
        agent = agent_of(state.training, 0)
        for options in (params.options, params.options._replace(double_q_learning=True)):
            dqn.step(params.task.robot, options, agent, 40)
        lab.step(params, Inputs(), state)
        lab.fields(params, state)
        table_map()
        baseline_costs()
        learning_task("ur5")


DIVERGENCE_MESSAGE = (
    "Stopped where the weights of the network left all bounds, and kept those before: targets that "
    "move with the weights ran away with them. Lower the learning rate, keep fixed targets, or "
    "discount more; then reset."
)


def _step_count(training: Training) -> int:
    """Of each learner."""
    return int(training["last_steps"][0])


def _weights(params: DqnParams, state: DqnState) -> np.ndarray:
    """Of the learner that is shown."""
    training, s = state.training, params.shown
    best = params.weights == "best" and training["best_cost"][s] >= 0.0
    return np.asarray(training["best" if best else "w"][s])


def _controller(params: DqnParams, state: DqnState) -> Controller:
    """Of the robot in the scene."""
    match params.driven_by:
        case "table":
            return table_controller()
        case "energy":
            return energy_controller()
        case _:
            return network_controller(params.task, state.training["sizes"], _weights(params, state))


def _shown_map(params: DqnParams, state: DqnState) -> tuple[np.ndarray, np.ndarray]:
    """Values and policy: the table's where it drives, else the network's."""
    if params.driven_by == "table":
        return table_map()
    sizes, w = state.training["sizes"], _weights(params, state)
    return value_map(params.task, sizes, w, state.drive.x)
