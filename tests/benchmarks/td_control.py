"""Tabular Q-learning, compiled, against the same loop in plain Python."""

import random
import statistics
import time

import numpy as np

from labs.algorithms.exploration import EPSILON_GREEDY, BehaviourPolicy
from labs.algorithms.td_control import Q_LEARNING, SARSA, SARSA_LAMBDA, SARSA_N, init, step
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.problems.episodes import EpisodicTask, UpdateRule
from labs.reinforcement_learning.td_control.tasks import ControlTask, grid_task, pendulum_task
from labs.tasks.grid_world.map import MAPS

ROUNDS = 7
FRAME = 1 / 30
"""[s]"""


def q_learning_steps() -> None:
    """Transitions a second on the cliff and on the pendulum, epsilon-greedy, constant step: the
    ratio has to be 30 at least. Then every method of the lab, and the longest iteration of a
    training, which has to fit in a frame of the scene."""
    for name, task, episodes in (
        ("cliff", grid_task(MAPS["cliff"], False, 0.0, False, 1.0, 1.0, False), 2000),
        ("pendulum", pendulum_task(0.95, 0.05, False), 500),
    ):
        for method in (Q_LEARNING, SARSA, SARSA_N, SARSA_LAMBDA):
            _compiled(task, method, 1)
        fast, slow = [], []
        for _ in range(ROUNDS):
            fast.append(_compiled(task, Q_LEARNING, episodes))
            slow.append(_plain(task.learning, episodes // 20))
        ratios = [f / s for f, s in zip(fast, slow, strict=True)]
        print(f"{name}: {statistics.median(fast) / 1e6:.1f} million steps a second compiled,")
        print(f"  {statistics.median(slow) / 1e6:.3f} million in plain Python,")
        print(f"  ratio: median {statistics.median(ratios):.0f} ({min(ratios):.0f} at least)")
        for method, title in (
            (SARSA, "SARSA"),
            (SARSA_N, "SARSA(4)"),
            (SARSA_LAMBDA, "SARSA(0.5)"),
        ):
            print(
                f"  {title}: {_compiled(task, method, episodes) / 1e6:.1f} million steps a second"
            )
    for preset in ("Cliff", "Windy grid", "Pendulum"):
        seconds = _iterations(preset)
        print(
            f"{preset}: an iteration of the lab takes {1e3 * statistics.median(seconds):.1f} ms, "
            f"{1e3 * max(seconds):.1f} at most; {sum(t > FRAME for t in seconds)} of "
            f"{len(seconds)} longer than a frame"
        )


def _compiled(task: ControlTask, method: int, episodes: int) -> float:
    """Transitions a second of one learner."""
    learners = init((task.mdp.X, task.mdp.U), 1, np.random.default_rng(0))
    begin = time.process_time()
    learners = step(
        task.learning,
        BehaviourPolicy(),
        UpdateRule(n=4, trace_decay=0.5),
        method,
        learners,
        episodes,
    )
    return float(learners.lengths.sum()) / (time.process_time() - begin)


def _plain(task: EpisodicTask, episodes: int) -> float:
    """The same, statement by statement, in Python, with its lists and its random numbers."""
    cost, successor = task.cost.tolist(), task.successor.tolist()
    terminal, start, gamma = task.terminal.tolist(), int(task.starts[0]), task.gamma
    behaviour, rule, luck = BehaviourPolicy(), UpdateRule(), random.Random(0)
    q = [[0.0] * len(row) for row in cost]
    visits = [[0] * len(row) for row in cost]

    def choose(x: int) -> int:
        if behaviour.kind != EPSILON_GREEDY or behaviour.decay > 0.0:
            raise NotImplementedError
        if luck.random() < behaviour.epsilon:
            return int(luck.random() * len(q[x]))
        row = q[x]
        least, best, ties = row[0], 0, 1
        for u in range(1, len(row)):
            if row[u] < least:
                least, best, ties = row[u], u, 1
            elif row[u] == least:
                ties += 1
        if ties == 1:
            return best
        return luck.choice([u for u in range(len(row)) if row[u] == least])

    def step_size(n: int) -> float:
        return rule.alpha if rule.omega == 0.0 else rule.alpha * n**-rule.omega

    def episode() -> tuple[float, int, bool]:
        x, steps, total, discount = start, 0, 0.0, 1.0
        while steps < task.horizon and not terminal[x]:
            u = choose(x)
            following = successor[x][u]
            target = cost[x][u]
            if not terminal[following]:
                target += gamma * min(q[following])
            visits[x][u] += 1
            q[x][u] += step_size(visits[x][u]) * (target - q[x][u])
            total += discount * cost[x][u]
            discount *= gamma
            steps += 1
            if not abs(q[x][u]) <= rule.limit:
                return total, steps, False
            x = following
        return total, steps, True

    begin = time.process_time()
    steps = sum(episode()[1] for _ in range(episodes))
    return steps / (time.process_time() - begin)


def _iterations(preset: str) -> list[float]:
    """[s] each iteration of the lab's training."""
    entry = find_lab("td-control")
    entry.lab.prepare()
    world, seconds = World(entry, entry.lab.presets[preset]), []
    while world.solving:
        begin = time.perf_counter()
        world.iterate()
        seconds.append(time.perf_counter() - begin)
    return seconds
