"""Drawing a value along a line: the truth, the estimates of all learners, and the features below.

The line stands upright before the viewer, states from left to right, values upwards."""

import numpy as np

from labs.scene import Scene

WIDTH, SCALE = 3.0, 0.5
"""[m] of the line; [m] for a unit of value."""
POINTS = 250
"""Of a curve, about."""
FLOOR, STRIP, ZERO = 0.03, 0.2, 0.85
"""[m] z of the features' foot; height of the largest feature above it; z of the value 0."""


def draw_line(
    scene: Scene,
    truth: np.ndarray,
    estimates: np.ndarray,
    shown: int,
    features: np.ndarray,
    place: int,
) -> None:
    """`truth` (X,), `estimates` (S, X), the one `shown`, `features` (X, k), and the walker."""
    some = np.unique(np.linspace(0, len(truth) - 1, POINTS).astype(int))
    x = WIDTH * (some / (len(truth) - 1) - 0.5)
    scene.camera((0.0, -3.4, 1.0), (0.0, 0.0, 0.66), _core())
    zero = np.array([[x[0], 0.0, ZERO], [x[-1], 0.0, ZERO]])
    scene.trail("zero", zero, "muted", 0.5)
    others = np.delete(estimates, shown, axis=0)
    scene.trail("others", np.stack([_line(x, v[some]) for v in others]), "actual", 0.25)
    scene.trail("truth", _line(x, truth[some]), "reference")
    scene.trail("estimate", _line(x, estimates[shown][some]), "actual")
    largest = max(float(np.abs(features).max()), 1e-9)
    strips = [
        np.stack([x, np.zeros(len(x)), FLOOR + STRIP * phi[some] / largest], axis=1)
        for phi in features.T
    ]
    scene.trail("features", np.stack(strips), "muted")
    scene.label("features below", "features", (-0.43 * WIDTH, 0.0, FLOOR + STRIP + 0.07))
    scene.label("truth above", "truth", (0.44 * WIDTH, 0.0, _height(float(truth[-1])) - 0.07))
    at = WIDTH * (place / (len(truth) - 1) - 0.5)
    here = float(np.interp(place, some, estimates[shown][some]))
    scene.sphere("walker", (at, -0.02, _height(here)), 0.035, "warning")


def _height(value: float) -> float:
    return float(ZERO + SCALE * np.clip(value, -1.6, 1.6))


def _line(x: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(k, 3) [m]"""
    return np.stack([x, np.zeros(len(x)), ZERO + SCALE * np.clip(values, -1.6, 1.6)], axis=1)


def _core() -> np.ndarray:
    half = 0.5 * WIDTH
    return np.array([[-half, 0.0, FLOOR], [half, 0.0, FLOOR], [half, 0.0, ZERO + SCALE]])
