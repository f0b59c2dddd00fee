"""A training by deep Q-learning: learners side by side, and the curves of their progress, as plain
arrays, S learners in front:

    sizes                        of the network's layers
    w, target, mean, square, adam_steps, random, X, ages, paid, whole    the agents
    observations, controls, costs, next_observations, ends, stored                  their buffers
    last_loss, ... (S,)          of the last update; recent (S, AVERAGED_EPISODES) costs
    best (S, P), best_cost (S,)  the weights whose greedy policy cost least, and its cost
    tried (k,)                   steps of a learner when its greedy policy was tried
    greedy (S, k)                the mean cost of an episode under it,
    paid_greedy (S, k)           the same discounted,
    believed (S, k)              and what the network says of that: min_u Q where episodes begin
    online (S, k)                of the last episodes learned from; UNKNOWN_COST before any ended
    loss, td_error, gradient_norm (S, k)
"""

from typing import Any

import numpy as np

from labs.algorithms import dqn
from labs.algorithms.dqn import DqnAgent, DqnOptions, epsilon_greedy, q_values
from labs.algorithms.network import AdamState
from labs.algorithms.replay import ReplayBuffer
from labs.arrays import Training
from labs.reinforcement_learning.dqn.tasks import RobotTask
from labs.resumable import Resumable

ROUNDS, UPDATES = 20, 24
"""Of the sixteen robots in an iteration; and the most updates in a piece of it: milliseconds."""
EVALUATION_INTERVAL = 5
"""Iterations from one trial of the greedy policies to the next; their cost stays in between."""
UNKNOWN_COST = -1.0
"""No cost is below 0."""
AVERAGED_EPISODES = 10
"""The last so many are averaged."""
EVALUATION_CURVES = ("greedy", "paid_greedy", "believed")
"""What is found out when a greedy policy is tried."""
CURVES = (*EVALUATION_CURVES, "online", "loss", "td_error", "gradient_norm")
AGENT_ARRAYS = ("w", "target", "random", "X", "ages", "paid", "whole")
UPDATE_CURVES = CURVES[-3:]
AGENT_NUMBERS = ("steps", "updates", *UPDATE_CURVES)


def initial_training(
    task: RobotTask, network: dict[str, Any], learners: int, rng: np.random.Generator
) -> Training:
    """Nothing learned yet."""
    agents = [dqn.init(task.robot, rng=rng, **network) for _ in range(learners)]
    recent = np.full((learners, AVERAGED_EPISODES), UNKNOWN_COST)
    best = {
        "best": np.stack([agent.w for agent in agents]),
        "best_cost": np.full(learners, UNKNOWN_COST),
    }
    curves = {name: np.zeros((learners, 0)) for name in CURVES}
    return _stack_agents(agents) | best | curves | {"tried": np.zeros(0), "recent": recent}


def agent_of(training: Training, s: int) -> DqnAgent:
    """Learner s."""
    parts = {name: training[name][s] for name in AGENT_ARRAYS}
    numbers = {name: training[f"last_{name}"][s].item() for name in AGENT_NUMBERS}
    adam = AdamState(*(training[f"adam_{name}"][s] for name in AdamState._fields))
    replay = ReplayBuffer(*(training[name][s] for name in ReplayBuffer._fields))
    return DqnAgent(sizes=training["sizes"], adam=adam, replay=replay, **parts, **numbers)


def train(task: RobotTask, options: DqnOptions, training: Training) -> Resumable[Training]:
    """Another iteration of all learners."""
    agents, recent = [], training["recent"].copy()
    for s in range(len(training["w"])):
        agent, left = agent_of(training, s), ROUNDS
        piece = max(1, UPDATES * options.update_every // len(agent.X))
        while left:
            agent = dqn.step(task.robot, options, agent, min(left, piece))
            recent[s] = np.concatenate([recent[s], agent.episode_costs])[-AVERAGED_EPISODES:]
            left -= min(left, piece)
            yield
        agents.append(agent)
    after = dict(training) | _stack_agents(agents) | {"recent": recent}
    if agents[0].steps // (ROUNDS * len(agents[0].X)) % EVALUATION_INTERVAL == 1:
        trials = []
        for agent in agents:
            trials.append((yield from _evaluate_greedy_policy(task, options, agent)))
        trial = np.array(trials).T
    else:
        trial = np.array([training[name][:, -1] for name in EVALUATION_CURVES])
    return _append_curves(agents, trial, after)


def is_finite(training: Training) -> bool:
    """Whether all weights and what was learned last are finite."""
    return all(bool(np.isfinite(training[name]).all()) for name in ("w", *CURVES))


def _append_curves(
    agents: list[DqnAgent], trial: np.ndarray, training: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """With another point of each curve; `trial` (3, S) are those of EVALUATION_CURVES."""
    costs, recent, known = trial[0], training["recent"], training["best_cost"]
    better = (known == UNKNOWN_COST) | (costs < known)
    filled = recent[:, -1] != UNKNOWN_COST
    mean = np.array(
        [row[row != UNKNOWN_COST].mean() if row[-1] != UNKNOWN_COST else 0.0 for row in recent]
    )
    points = dict(zip(EVALUATION_CURVES, trial, strict=True)) | {
        "online": np.where(filled, mean, UNKNOWN_COST)
    }
    points |= {name: np.array([getattr(agent, name) for agent in agents]) for name in UPDATE_CURVES}
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


def _evaluate_greedy_policy(
    task: RobotTask, options: DqnOptions, agent: DqnAgent
) -> Resumable[tuple[float, float, float]]:
    """What EVALUATION_CURVES names, on average over the test's starts; pauses every fifty steps."""
    robot, X, total, discounted = task.robot, task.test_states(), 0.0, 0.0
    q = q_values(agent.sizes, agent.w, robot.observe(X))
    for k in range(robot.horizon):
        U = epsilon_greedy(agent.sizes, agent.w, robot.observe(X), 0.0, agent.random)
        X, costs, _ = robot.step(X, U)
        total += float(costs.mean())
        discounted += options.gamma**k * float(costs.mean())
        if k % 50 == 49:
            yield
    return total, discounted, task.cost_scale * float(q.min(axis=1).mean())


def _stack_agents(agents: list[DqnAgent]) -> dict[str, np.ndarray]:
    parts = {name: np.stack([getattr(agent, name) for agent in agents]) for name in AGENT_ARRAYS}
    numbers = {
        f"last_{n}": np.array([getattr(agent, n) for agent in agents]) for n in AGENT_NUMBERS
    }
    adam = {
        f"adam_{name}": np.stack([getattr(agent.adam, name) for agent in agents])
        for name in AdamState._fields
    }
    replay = {
        name: np.stack([getattr(agent.replay, name) for agent in agents])
        for name in ReplayBuffer._fields
    }
    return {"sizes": agents[0].sizes} | parts | numbers | adam | replay
