"""A training by deep Q-learning: learners side by side, and the curves of their progress, as plain
arrays, S learners in front:

    sizes                        of the network's layers
    w, target, mean, square, adam_steps, random, X, ages, paid, whole    the agents
    observations, controls, costs, next_observations, ends, stored                  their buffers
    last_loss, ... (S,)          of the last update; recent (S, EPISODES) costs while learning
    best (S, P), best_cost (S,)  the weights whose greedy policy cost least, and its cost
    tried (k,)                   steps of a learner when its greedy policy was tried
    greedy (S, k)                the mean cost of an episode under it,
    paid_greedy (S, k)           the same discounted,
    believed (S, k)              and what the network says of that: min_u Q where episodes begin
    online (S, k)                of the last episodes while learning; UNKNOWN before any has ended
    loss, td_error, gradient_norm (S, k)
"""

from typing import Any

import numpy as np

from labs.algorithms import dqn
from labs.algorithms.dqn import DqnAgent, DqnOptions, choose, q_values
from labs.algorithms.network import Adam
from labs.algorithms.replay import Replay
from labs.arrays import Training
from labs.reinforcement_learning.dqn.tasks import RobotTask
from labs.resumable import Resumable

ROUNDS, UPDATES = 20, 24
"""Of the sixteen robots in an iteration; and the most updates in a piece of it: milliseconds."""
TRY_EVERY = 5
"""Iterations from one trial of the greedy policies to the next; their cost stays in between."""
UNKNOWN = -1.0
"""No cost is below 0."""
EPISODES = 10
"""The last so many are averaged."""
TRIAL = ("greedy", "paid_greedy", "believed")
"""What is found out when a greedy policy is tried."""
CURVES = (*TRIAL, "online", "loss", "td_error", "gradient_norm")
OF_AGENT = ("w", "target", "random", "X", "ages", "paid", "whole")
OF_UPDATE = CURVES[-3:]
NUMBERS = ("steps", "updates", *OF_UPDATE)


def initial_training(
    task: RobotTask, network: dict[str, Any], learners: int, rng: np.random.Generator
) -> Training:
    """Nothing learned yet."""
    agents = [dqn.init(task.robot, rng=rng, **network) for _ in range(learners)]
    recent = np.full((learners, EPISODES), UNKNOWN)
    best = {
        "best": np.stack([agent.w for agent in agents]),
        "best_cost": np.full(learners, UNKNOWN),
    }
    curves = {name: np.zeros((learners, 0)) for name in CURVES}
    return _stacked(agents) | best | curves | {"tried": np.zeros(0), "recent": recent}


def agent_of(training: Training, s: int) -> DqnAgent:
    """Learner s."""
    parts = {name: training[name][s] for name in OF_AGENT}
    numbers = {name: training[f"last_{name}"][s].item() for name in NUMBERS}
    adam = Adam(*(training[f"adam_{name}"][s] for name in Adam._fields))
    replay = Replay(*(training[name][s] for name in Replay._fields))
    return DqnAgent(sizes=training["sizes"], adam=adam, replay=replay, **parts, **numbers)


def train(task: RobotTask, options: DqnOptions, training: Training) -> Resumable[Training]:
    """Another iteration of all learners."""
    agents, recent = [], training["recent"].copy()
    for s in range(len(training["w"])):
        agent, left = agent_of(training, s), ROUNDS
        piece = max(1, UPDATES * options.update_every // len(agent.X))
        while left:
            agent = dqn.step(task.robot, options, agent, min(left, piece))
            recent[s] = np.concatenate([recent[s], agent.episode_costs])[-EPISODES:]
            left -= min(left, piece)
            yield
        agents.append(agent)
    after = dict(training) | _stacked(agents) | {"recent": recent}
    if agents[0].steps // (ROUNDS * len(agents[0].X)) % TRY_EVERY == 1:
        trials = []
        for agent in agents:
            trials.append((yield from _trial(task, options, agent)))
        trial = np.array(trials).T
    else:
        trial = np.array([training[name][:, -1] for name in TRIAL])
    return _recorded(agents, trial, after)


def sound(training: Training) -> bool:
    """Whether all weights and what was learned last are finite."""
    return all(bool(np.isfinite(training[name]).all()) for name in ("w", *CURVES))


def _recorded(
    agents: list[DqnAgent], trial: np.ndarray, training: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """With another point of each curve; `trial` (3, S) are those of TRIAL."""
    costs, recent, known = trial[0], training["recent"], training["best_cost"]
    better = (known == UNKNOWN) | (costs < known)
    filled = recent[:, -1] != UNKNOWN
    mean = np.array([row[row != UNKNOWN].mean() if row[-1] != UNKNOWN else 0.0 for row in recent])
    points = dict(zip(TRIAL, trial, strict=True)) | {"online": np.where(filled, mean, UNKNOWN)}
    points |= {name: np.array([getattr(agent, name) for agent in agents]) for name in OF_UPDATE}
    curves = {name: np.column_stack([training[name], points[name]]) for name in CURVES}
    return (
        training
        | curves
        | {
            "tried": np.append(training["tried"], agents[0].steps),
            "best": np.where(better[:, None], training["w"], training["best"]),
            "best_cost": np.where(better, costs, known),
        }
    )


def _trial(
    task: RobotTask, options: DqnOptions, agent: DqnAgent
) -> Resumable[tuple[float, float, float]]:
    """What TRIAL names, on average over the test's starts; pauses every fifty steps."""
    robot, X, total, discounted = task.robot, task.tests(), 0.0, 0.0
    q = q_values(agent.sizes, agent.w, robot.observe(X))
    for k in range(robot.horizon):
        U = choose(agent.sizes, agent.w, robot.observe(X), 0.0, agent.random)
        X, costs, _ = robot.step(X, U)
        total += float(costs.mean())
        discounted += options.gamma**k * float(costs.mean())
        if k % 50 == 49:
            yield
    return total, discounted, task.cost_scale * float(q.min(axis=1).mean())


def _stacked(agents: list[DqnAgent]) -> dict[str, np.ndarray]:
    parts = {name: np.stack([getattr(agent, name) for agent in agents]) for name in OF_AGENT}
    numbers = {f"last_{n}": np.array([getattr(agent, n) for agent in agents]) for n in NUMBERS}
    adam = {
        f"adam_{name}": np.stack([getattr(agent.adam, name) for agent in agents])
        for name in Adam._fields
    }
    replay = {
        name: np.stack([getattr(agent.replay, name) for agent in agents]) for name in Replay._fields
    }
    return {"sizes": agents[0].sizes} | parts | numbers | adam | replay
