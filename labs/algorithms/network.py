"""A multilayer perceptron, the Q-function of deep Q-learning (notes, 3.7.1, 3.8.3), and Adam.

    h_0 = x,   h_k = max(0, h_(k-1) W_k + b_k)  for k < L,   y = h_(L-1) W_L + b_L

All weights stand in one array w: W_1 (row by row), b_1, W_2, b_2, ... Its gradient follows the
chain rule backwards. With d_L = dF/dy (n, .) over n inputs,

    dF/dW_k = h_(k-1)' d_k,   dF/db_k = 1' d_k,   d_(k-1) = (d_k W_k') where h_(k-1) > 0, else 0

Compiled, with products of matrices by BLAS: at the size of these networks four times as fast as
NumPy, which spends its time between the calls.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from labs.compiled import compiled


def random_weights(sizes: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """w, float32, of layers of `sizes` (L + 1,): W_k uniform with variance 2 / (its number of
    rows), which keeps the size of what goes through (He et al., 2015); b = 0; the last layer a
    tenth of that, so that nothing is believed before something was learned."""
    parts = []
    for k, (rows, columns) in enumerate(pairwise(sizes)):
        largest = np.sqrt(6.0 / rows) * (0.1 if k == len(sizes) - 2 else 1.0)
        parts += [rng.uniform(-largest, largest, rows * columns), np.zeros(columns)]
    return np.concatenate(parts).astype(np.float32)


@compiled
def forward(sizes: np.ndarray, w: np.ndarray, x: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """y (n, .) of x (n, .), a view of `memory`, which keeps all h for the gradient: one array of
    n times the sum of the sizes. All of one type of float."""
    n, layers = len(x), len(sizes) - 1
    at, here = 0, n * sizes[0]
    memory[:here] = x.ravel()
    before = memory[:here].reshape(n, sizes[0])
    for k in range(layers):
        rows, columns = sizes[k], sizes[k + 1]
        weights = w[at : at + rows * columns].reshape(rows, columns)
        at += rows * columns
        h = memory[here : here + n * columns].reshape(n, columns)
        here += n * columns
        np.dot(before, weights, h)
        for i in range(n):
            for j in range(columns):
                z = h[i, j] + w[at + j]
                h[i, j] = z if k == layers - 1 else max(z, w.dtype.type(0.0))
        at += columns
        before = h
    return before


@compiled
def backpropagate(
    sizes: np.ndarray, w: np.ndarray, memory: np.ndarray, dy: np.ndarray, gradient: np.ndarray
) -> None:
    """Writes dF/dw into `gradient`, given dF/dy (n, .) and what `forward` kept in `memory`."""
    n, layers = len(dy), len(sizes) - 1
    at, here = len(w), n * (sizes.sum() - sizes[layers])
    d = dy
    for k in range(layers - 1, -1, -1):
        rows, columns = sizes[k], sizes[k + 1]
        at -= columns
        for j in range(columns):
            gradient[at + j] = d[:, j].sum()
        at -= rows * columns
        here -= n * rows
        h = memory[here : here + n * rows].reshape(n, rows)
        np.dot(h.T, d, gradient[at : at + rows * columns].reshape(rows, columns))
        if k > 0:
            d = np.dot(d, w[at : at + rows * columns].reshape(rows, columns).T)
            for i in range(n):
                for j in range(rows):
                    if h[i, j] <= 0.0:
                        d[i, j] = 0.0


class AdamState(NamedTuple):
    """Moments of the gradient (Kingma and Ba, 2015); arrays change in place."""

    mean: np.ndarray
    """(P,) decaying mean of g."""
    square: np.ndarray
    """(P,) and of g^2."""
    steps: np.ndarray
    """(1,) int64: done so far."""


MEAN_DECAY, SQUARE_DECAY, ADAM_EPSILON = 0.9, 0.999, 1e-8


def zero_moments(count: int) -> AdamState:
    """Before the first step, for `count` weights."""
    return AdamState(
        np.zeros(count, np.float32), np.zeros(count, np.float32), np.zeros(1, np.int64)
    )


@compiled
def adam_step(adam: AdamState, w: np.ndarray, gradient: np.ndarray, rate: float) -> None:
    """w <- w - rate m / (sqrt(s) + 1e-8), with mean m and square s of g freed of the bias of their
    beginning at zero."""
    adam.steps[0] += 1
    t = adam.steps[0]
    by_mean = rate / (1.0 - MEAN_DECAY**t)
    by_square = 1.0 / (1.0 - SQUARE_DECAY**t)
    for i in range(len(w)):
        g = gradient[i]
        adam.mean[i] += (1.0 - MEAN_DECAY) * (g - adam.mean[i])
        adam.square[i] += (1.0 - SQUARE_DECAY) * (g * g - adam.square[i])
        w[i] -= by_mean * adam.mean[i] / (np.sqrt(by_square * adam.square[i]) + ADAM_EPSILON)
