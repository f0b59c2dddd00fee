"""Learning episode by episode: Monte Carlo and TD(0), many learners of each who meet the same
episodes, and how far they are from the truth.

Of M = 2 methods with S learners each, after k batches of episodes:

    V, visits, random          the learners (labs/algorithms/prediction.py), with M in front
    lengths, steps ()          mean steps of an episode of the last batch, of all episodes so far
    episodes (k,)              each learner's episodes so far
    error, bias, spread (M, k) over all states alike: root mean square of V - V^pi of all learners,
                               of the mean V - V^pi, and the standard deviation of V, so that
                               error^2 = bias^2 + spread^2
"""

from collections.abc import Iterator

import numpy as np

from labs.algorithms.prediction import EVERY_VISIT, FIRST_VISIT, TD0, Predictors, init, step
from labs.arrays import Training, episodes_done
from labs.lab import Snapshot
from labs.number_texts import count_text
from labs.reinforcement_learning.prediction.params import PredictionParams
from labs.reinforcement_learning.prediction.worlds import PredictionWorld

CURVES = ("error", "bias", "spread")
BATCHES = 100
"""Iterations of a training, or more while its episodes are long."""
BATCH_TRANSITIONS = 200_000
"""Transitions of a batch, about: some milliseconds."""
HISTORY_LENGTH = 1000
"""Batches whose curves are kept; older ones are dropped."""


def initial_training(params: PredictionParams, rng: np.random.Generator) -> Training:
    """Nothing learned yet: V = V_0 everywhere."""
    world = params.prediction
    learners = init(world.task, world.learners, rng, params.v0)
    return {
        "V": np.stack([learners.V] * 2),
        "visits": np.stack([learners.visits] * 2),
        "random": np.stack([learners.random] * 2),
        "lengths": np.array(0.0),
        "steps": np.array(0.0),
        "episodes": np.zeros(0),
    } | {name: np.zeros((2, 0)) for name in CURVES}


def learn(params: PredictionParams, training: Training) -> Iterator[Snapshot]:
    """A batch of episodes an iteration; goes on from what was learned."""
    wanted, learned, i = round(params.episodes), 0, 0
    while learned < wanted:
        batch = _batch_size(params, training, -(-wanted // BATCHES))
        batch = min(batch, wanted - learned)
        training, i, learned = _train(params, training, batch), i + 1, learned + batch
        done = (
            f"{count_text(episodes_done(training), 'episode')} learned."
            if learned == wanted
            else ""
        )
        yield Snapshot(i, training, done, learned / wanted)


def error_decomposition(world: PredictionWorld, V: np.ndarray) -> tuple[float, float, float]:
    """Error, bias and spread of V (S, X)."""
    off = V - world.truth
    bias = float(off.mean(axis=0) ** 2 @ world.task.weight)
    spread = float(V.var(axis=0) @ world.task.weight)
    return float(np.sqrt(bias + spread)), float(np.sqrt(bias)), float(np.sqrt(spread))


def _train(params: PredictionParams, training: Training, episodes: int) -> Training:
    world = params.prediction
    methods = (FIRST_VISIT if params.visits == "first" else EVERY_VISIT, TD0)
    after = [
        step(world.task, rule, method, _learners(training, m), episodes)
        for m, (method, rule) in enumerate(zip(methods, params.rules, strict=True))
    ]
    parts = np.array([error_decomposition(world, learners.V) for learners in after])
    done = float(episodes_done(training) + episodes)
    return {
        "V": np.stack([learners.V for learners in after]),
        "visits": np.stack([learners.visits for learners in after]),
        "random": np.stack([learners.random for learners in after]),
        "lengths": np.array(after[1].lengths.mean()),
        "steps": training["steps"] + episodes * after[1].lengths.mean(),
        "episodes": np.append(training["episodes"], done)[-HISTORY_LENGTH:],
    } | {
        name: np.concatenate([training[name], part[:, None]], axis=1)[:, -HISTORY_LENGTH:]
        for name, part in zip(CURVES, parts.T, strict=True)
    }


def _learners(training: Training, method: int) -> Predictors:
    V, visits, random = (training[name][method] for name in ("V", "visits", "random"))
    none = np.zeros((len(V), 0))
    return Predictors(V, visits, random, none, none.astype(np.int64), np.ones(len(V), bool))


def _batch_size(params: PredictionParams, training: Training, most: int) -> int:
    """Transitions are counted, not seconds: all machines do the same."""
    length = float(training["lengths"]) or 100.0
    return int(np.clip(BATCH_TRANSITIONS / (2.0 * params.prediction.learners * length), 1, most))
