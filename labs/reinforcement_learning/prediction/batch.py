"""Learning from a fixed batch: how good its two answers are as it grows, and the sweeps of batch
Monte Carlo and batch TD(0) that lead to them (labs/algorithms/batch_prediction.py).

The batch grows by an episode an iteration; then come the sweeps. Of S learners:

    V (2, S, X)                what Monte Carlo and TD(0) have come to
    answers (2, S, X)          least squares and certainty equivalence
    sizes (k,)                 episodes of the batch as it grew
    error (2, k)               mean error of its two answers
    sweeps (j,)                sweeps so far
    left (2, j)                largest distance from the answer after them, over all learners
    misfit (2,)                root mean square distance from the least-squares fit, over visits
    residual (2,)              the same of V - (C + gamma P V) in the most likely model
    seed ()                    of the episodes
"""

from collections.abc import Iterator

import numpy as np

from labs.algorithms.batch_prediction import (
    Batch,
    batch_from_episodes,
    certainty_equivalence,
    collect_episodes,
    empty_batch,
    least_squares,
    monte_carlo_sweep,
    td_sweep,
)
from labs.arrays import Training
from labs.lab import Snapshot
from labs.number_texts import count_text
from labs.problems.prediction import root_mean_square_error
from labs.reinforcement_learning.prediction.params import PredictionParams
from labs.reinforcement_learning.prediction.worlds import LEARNERS

A, B, GAIN = 1, 2, 3
PREDICTOR_EPISODES = (
    ([A, B, 0], [0.0, 0.0]),
    *[([B, GAIN], [-1.0])] * 6,
    ([B, 0], [0.0]),
)
"""States and costs. Sutton and Barto, example 6.4, its rewards as negative costs."""
ROUNDING = 1e-12
"""What is smaller is no misfit."""
ITERATIONS, TOLERANCE = 100, 1e-6
"""Of the sweeps at most, and how near to the answers they stop."""


def initial_training(params: PredictionParams, rng: np.random.Generator) -> Training:
    """No episode yet."""
    given = params.data == "predictor"
    X, many = params.place.states + 2, 1 if given else LEARNERS
    V = np.full((many, X), params.v0)
    V[:, [0, -1]] = 0.0
    both, none = np.stack([V, V]), np.zeros(0)
    return {
        "V": both,
        "answers": both,
        "sizes": none,
        "error": np.zeros((2, 0)),
        "sweeps": none,
        "left": np.zeros((2, 0)),
        "misfit": np.zeros(2),
        "residual": np.zeros(2),
        "seed": np.array(rng.integers(2**32)),
    }


def learn(params: PredictionParams, training: Training) -> Iterator[Snapshot]:
    """The batch grows, then it is learned from, from the first guess on."""
    found = dict(initial_training(params, np.random.default_rng(0))) | {"seed": training["seed"]}
    first, i = found["V"][0], 0
    batch = empty_batch(first.shape[1], len(first), np.random.default_rng(int(training["seed"])))
    given = params.data == "predictor"
    size = len(PREDICTOR_EPISODES) if given else round(params.size)
    for i in range(1, size + 1):
        more = batch_from_episodes(PREDICTOR_EPISODES[:i], first.shape[1], 1.0)
        batch = more if given else collect_episodes(params.prediction.task, batch, 1)
        found |= _batch_answers(params, found, batch, first, i)
        yield Snapshot(i, dict(found), "", 0.5 * i / size)
    alpha, stride = 1.0 / batch.visits.max(), 1 if given else 20
    sweeps, worst = 0, np.inf
    while worst > TOLERANCE and sweeps < ITERATIONS * stride:
        V = found["V"]
        for _ in range(stride):
            V = np.stack([monte_carlo_sweep(batch, V[0], alpha), td_sweep(batch, V[1], 1.0, alpha)])
        i, sweeps = i + 1, sweeps + stride
        left = np.abs(V - found["answers"]).max(axis=(1, 2))
        worst = float(left.max())
        found |= {
            "V": V,
            "sweeps": np.append(found["sweeps"], float(sweeps)),
            "left": np.concatenate([found["left"], left[:, None]], axis=1),
        }
        found |= _fit_errors(batch, V, first)
        done, spent = "", count_text(sweeps, "sweep")
        if worst <= TOLERANCE:
            done = f"Both settled after {spent} over {count_text(size, 'episode')}."
        elif sweeps >= ITERATIONS * stride:
            done = f"After {spent} they are still up to {worst:.2g} from their answers."
        yield Snapshot(
            i, dict(found), done, 1.0 if done else 0.5 + 0.5 * sweeps / ITERATIONS / stride
        )


def _batch_answers(
    params: PredictionParams, found: Training, batch: Batch, first: np.ndarray, size: int
) -> dict[str, np.ndarray]:
    answers = np.stack([least_squares(batch, first), certainty_equivalence(batch, first, 1.0)])
    grown = {"answers": answers} | _fit_errors(batch, found["V"], first)
    if params.data != "predictor":
        task = params.prediction.task
        error = np.array([root_mean_square_error(task, V).mean() for V in answers])
        grown["sizes"] = np.append(found["sizes"], float(size))
        grown["error"] = np.concatenate([found["error"], error[:, None]], axis=1)
    return grown


def _fit_errors(batch: Batch, V: np.ndarray, first: np.ndarray) -> dict[str, np.ndarray]:
    """How V (2, S, X) fits what was seen, and how consistent it is."""
    weight = batch.visits / batch.visits.sum()
    seen = np.maximum(batch.visits, 1.0)
    fit = least_squares(batch, first)
    ahead = (batch.costs + np.einsum("sxy,msy->msx", batch.transitions, V)) / seen
    squares = {"misfit": (V - fit) ** 2, "residual": (V - ahead) ** 2}
    judged = {name: np.sqrt((weight * of).sum(axis=(1, 2))) for name, of in squares.items()}
    return {name: np.where(of > ROUNDING, of, 0.0) for name, of in judged.items()}
