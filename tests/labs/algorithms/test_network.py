"""The network's gradient against finite differences, and Adam against a hand calculation."""

from itertools import pairwise

import numpy as np
import pytest

from labs.algorithms.network import (
    adam_step,
    backpropagate,
    forward,
    random_weights,
    zero_moments,
)


def plain_forward(sizes: np.ndarray, w: np.ndarray, x: np.ndarray) -> np.ndarray:
    """By the equations, layer by layer."""
    at, h = 0, x
    for k, (rows, columns) in enumerate(pairwise(sizes)):
        W, at = w[at : at + rows * columns].reshape(rows, columns), at + rows * columns
        b, at = w[at : at + columns], at + columns
        h = h @ W + b
        if k < len(sizes) - 2:
            h = np.maximum(h, 0.0)
    return h


@pytest.mark.parametrize("sizes", [(3, 2), (3, 7, 2), (4, 8, 6, 5), (2, 5, 5, 5, 1)])
def test_gradients_are_those_of_finite_differences(sizes: tuple[int, ...]) -> None:
    rng, widths, n, eps = np.random.default_rng(1), np.array(sizes), 6, 1e-6
    w = random_weights(widths, rng).astype(float)
    w += 0.1 * rng.normal(size=len(w))
    x, c = rng.normal(size=(n, sizes[0])), rng.normal(size=(n, sizes[-1]))
    memory, gradient = np.empty(n * widths.sum()), np.empty_like(w)
    y = forward(widths, w, x, memory)
    np.testing.assert_allclose(y, plain_forward(widths, w, x), atol=1e-13)
    backpropagate(widths, w, memory, c, gradient)
    for i in range(len(w)):
        sides = []
        for sign in (1.0, -1.0):
            moved = w.copy()
            moved[i] += sign * eps
            sides.append((plain_forward(widths, moved, x) * c).sum())
        assert gradient[i] == pytest.approx((sides[0] - sides[1]) / (2 * eps), abs=2e-8, rel=2e-8)


def test_adam_by_hand() -> None:
    """Two steps with g = 1, then g = -1: m = 0.1, then -0.01; s = 1e-3, then 1.999e-3; freed of
    their bias 1 and -0.01 / 0.19; 1 and 1."""
    w, adam = np.array([5.0], np.float32), zero_moments(1)
    adam_step(adam, w, np.array([1.0], np.float32), 0.1)
    assert w[0] == pytest.approx(4.9, abs=1e-6)
    adam_step(adam, w, np.array([-1.0], np.float32), 0.1)
    assert adam.mean[0] == pytest.approx(-0.01, abs=1e-7)
    assert adam.square[0] == pytest.approx(1.999e-3, abs=1e-8)
    assert w[0] == pytest.approx(4.9 + 0.1 * 0.01 / 0.19, abs=1e-6)


def test_adam_alone_finds_the_least_of_a_parabola() -> None:
    w = np.zeros(3, np.float32)
    least = np.array([1.0, -2.0, 0.5], np.float32)
    adam = zero_moments(3)
    for _ in range(2000):
        adam_step(adam, w, w - least, 0.01)
    np.testing.assert_allclose(w, least, atol=1e-4)


def test_what_is_random_keeps_the_size_of_what_goes_through() -> None:
    rng, sizes = np.random.default_rng(0), np.array([64, 256, 256, 256, 4])
    w, x = random_weights(sizes, rng), rng.normal(size=(512, 64)).astype(np.float32)
    memory = np.empty(512 * sizes.sum(), np.float32)
    y = forward(sizes, w, x, memory)
    last = memory[512 * (64 + 256 + 256) : 512 * (64 + 256 + 256 + 256)]
    assert np.mean(last**2) == pytest.approx(1.0, rel=0.3)
    assert np.std(y) < 0.2
