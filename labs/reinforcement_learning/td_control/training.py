"""A training: learners of one or two methods side by side, and the curves of their progress.

Both methods begin with the same luck, so that what differs between them is the method. A training
is a mapping of arrays, M methods with S learners each, after k batches of episodes:

    q, visits, random          the learners (labs/algorithms/td_control.py), with M in front
    cells (X, 2)               the cells of the map the states stand for
    sound ()                   whether the estimates stayed within bounds
    lengths (M,)               transitions of an episode, the mean of the last batch
    episodes (k,)              each learner's episodes so far
    online (M, S, k)           mean discounted cost of a batch's episodes: what learning cost
    offline (M, S, k)          cost of the greedy policy after it: what was learned; where neither
                               luck nor gamma = 1 forbids it without end, else of cut episodes
    off, most (M, S, k)        root mean square and largest of |Q - Q*|
"""

from collections.abc import Sequence

import numpy as np

from labs.algorithms.exploration import BehaviourPolicy
from labs.algorithms.policy_evaluation import exact_values
from labs.algorithms.td_control import SARSA_LAMBDA, Learners, greedy_costs, init, step
from labs.algorithms.td_lambda import NEGLIGIBLE_TRACE
from labs.arrays import Training, episodes_done
from labs.problems.episodes import UpdateRule
from labs.reinforcement_learning.td_control.tasks import ControlTask

CURVES = ("online", "offline", "off", "most")
STEP_TIME, TRACE_TIME, BATCH_TIME = 40.0, 2.5, 4e6
"""[ns] About what a transition takes, a trace at each transition, and what a batch may take for
the scene to go on."""
EVALUATION_EPISODES = 20
"""Of a greedy policy where luck has a say in what it costs."""
HISTORY_LENGTH = 1000
"""Batches whose curves are kept; older ones are dropped."""


def initial_training(
    task: ControlTask, methods: int, seeds: int, rng: np.random.Generator, q0: float
) -> Training:
    """Nothing learned yet: Q = q0 everywhere."""
    learners = init((task.mdp.X, task.mdp.U), seeds, rng, q0)
    return {
        "q": np.stack([learners.q] * methods),
        "visits": np.stack([learners.visits] * methods),
        "random": np.stack([learners.random] * methods),
        "cells": task.cells,
        "sound": np.array(True),
        "lengths": np.full(methods, float(task.learning.horizon)),
        "episodes": np.zeros(0),
    } | {name: np.zeros((methods, seeds, 0)) for name in CURVES}


def _learners(training: Training, method: int) -> Learners:
    """The learners of one of the methods."""
    q, visits, random = (training[name][method] for name in ("q", "visits", "random"))
    none = np.zeros((len(q), 0))
    return Learners(q, visits, random, none, none.astype(np.int64), bool(training["sound"]))


def train(
    task: ControlTask,
    behaviour: BehaviourPolicy,
    rule: UpdateRule,
    methods: Sequence[int],
    training: Training,
    episodes: int,
) -> Training:
    """The training after a batch of so many further episodes."""
    after = [
        step(task.learning, behaviour, rule, method, _learners(training, m), episodes)
        for m, method in enumerate(methods)
    ]
    trials = 1 if task.mdp.deterministic else EVALUATION_EPISODES
    errors = np.array([[task.errors(q) for q in learners.q] for learners in after])
    points = {
        "online": np.array([learners.costs.mean(axis=1) for learners in after]),
        "offline": np.array([_greedy_policy_costs(task, learners, trials) for learners in after]),
        "off": errors[..., 0],
        "most": errors[..., 1],
    }
    done = episodes_done(training) + episodes
    return {
        "q": np.stack([learners.q for learners in after]),
        "visits": np.stack([learners.visits for learners in after]),
        "random": np.stack([learners.random for learners in after]),
        "cells": task.cells,
        "sound": np.array(all(learners.bounded for learners in after)),
        "lengths": np.array([learners.lengths.mean() for learners in after]),
        "episodes": np.append(training["episodes"], float(done))[-HISTORY_LENGTH:],
    } | {
        name: np.concatenate([training[name], point[..., None]], axis=2)[..., -HISTORY_LENGTH:]
        for name, point in points.items()
    }


def _greedy_policy_costs(task: ControlTask, learners: Learners, trials: int) -> np.ndarray:
    """(S,) from the start. An episode that is cut costs less than the policy does, and may cost
    less than the best."""
    if task.mdp.deterministic and task.mdp.gamma < 1.0:
        policies = learners.q.argmin(axis=2)
        return np.array([exact_values(task.mdp, policy)[task.start] for policy in policies])
    return greedy_costs(task.evaluation, learners, trials)


def batch_size(
    task: ControlTask, rule: UpdateRule, methods: Sequence[int], training: Training, most: int
) -> int:
    """Episodes of the next batch: `most`, or fewer while they are so long that it would take more
    than the budget. Transitions are counted, not seconds: all machines do the same."""
    seeds, load = training["q"].shape[1], 0.0
    fading = task.mdp.gamma * rule.trace_decay
    memory = (
        np.log(NEGLIGIBLE_TRACE) / np.log(fading)
        if 0.0 < fading < 1.0
        else task.q_star.size * fading
    )
    for method, length in zip(methods, training["lengths"], strict=True):
        traces = min(length, memory, task.q_star.size) if method == SARSA_LAMBDA else 0.0
        load += seeds * length * (STEP_TIME + TRACE_TIME * traces)
    return int(np.clip(BATCH_TIME / max(load, 1.0), 1, most))


def fits_task(training: Training, task: ControlTask) -> bool:
    """Whether its tables are those of this task's states and controls."""
    same = training["q"].shape[2:] == task.q_star.shape
    return same and np.array_equal(training["cells"], task.cells)


def transfer(training: Training, task: ControlTask, q0: float) -> Training:
    """The training on a map that was changed: what was learned of a cell stays with the cell."""
    places = {tuple(cell): x for x, cell in enumerate(training["cells"].tolist())}
    shared = [(x, places[c]) for x, c in enumerate(map(tuple, task.cells.tolist())) if c in places]
    new, old = np.array(shared, int).reshape(-1, 2).T
    q = np.full((*training["q"].shape[:2], *task.q_star.shape), q0)
    visits = np.zeros(q.shape, np.int32)
    q[:, :, new] = training["q"][:, :, old]
    visits[:, :, new] = training["visits"][:, :, old]
    return {**training, "q": q, "visits": visits, "cells": task.cells}
