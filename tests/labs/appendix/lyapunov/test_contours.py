"""Level lines against a circle."""

import numpy as np
import pytest

from labs.appendix.lyapunov.contours import level_lines


def test_the_level_line_of_a_circle_is_the_circle() -> None:
    axis = np.linspace(-2.0, 2.0, 81)
    X = np.stack(np.meshgrid(axis, axis), axis=-1)
    V = np.square(X).sum(axis=-1)
    lines = level_lines(X, V, 1.0)
    np.testing.assert_allclose(np.linalg.norm(lines, axis=2), 1.0, atol=2e-3)
    length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum()
    assert length == pytest.approx(2 * np.pi, rel=1e-3)
    assert level_lines(X, V, 99.0).shape == (0, 2, 2)
    half = level_lines(X, np.where(X[..., 0] > 0.0, np.nan, V), 1.0)
    length = np.linalg.norm(half[:, 1] - half[:, 0], axis=1).sum()
    assert length == pytest.approx(np.pi, rel=1e-3)
