"""The small box-constrained quadratic programme against its KKT conditions, which suffice."""

import numpy as np
import pytest

from labs.algorithms.box_qp import box_qp


def solved(
    H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray, mu: float = 0.0
) -> tuple[bool, np.ndarray, np.ndarray]:
    m = len(g)
    w, held, L = np.empty(m), np.zeros(m, np.bool_), np.empty((m, m))
    found = box_qp(H, mu, g, low, high, w, held, L)
    return found, w, held


def violation(
    H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray, w: np.ndarray
) -> float:
    """How far a projected gradient step moves w, in units of its terms."""
    gradient = H @ w + g
    size = np.abs(H) @ np.abs(w) + np.abs(g)
    inner = np.where(w <= low, np.minimum(gradient, 0.0), gradient)
    inner = np.where(w >= high, np.maximum(inner, 0.0), inner)
    return float((np.abs(inner) / np.where(size > 0.0, size, 1.0)).max())


@pytest.mark.parametrize("m", [1, 2, 6])
@pytest.mark.parametrize("scale", [1e-15, 1.0, 1e12])
def test_the_kkt_conditions_hold_at_any_scale(m: int, scale: float) -> None:
    rng = np.random.default_rng(m)
    held_ever = 0
    for _ in range(200):
        root = rng.normal(size=(m, m)) * 10.0 ** rng.uniform(-2, 2, m)
        H, g = scale * (root @ root.T + 1e-6 * np.eye(m)), scale * rng.normal(size=m)
        low, high = -(10.0 ** rng.uniform(-3, 1, m)), 10.0 ** rng.uniform(-3, 1, m)
        low[rng.random(m) < 0.3] = 0.0  # already at a bound, exactly
        high[rng.random(m) < 0.3] = 1e-16  # or a rounding within
        found, w, held = solved(H, g, low, high)
        assert found
        assert ((low <= w) & (w <= high)).all()
        assert (held <= ((w == low) | (w == high))).all()
        assert violation(H, g, low, high, w) < 1e-11
        held_ever += held.sum()
    assert held_ever > 100


def test_an_entry_a_rounding_within_its_bound_is_held() -> None:
    """Both gradients push against the bounds; the first has next to no way to go. Newton's step
    over both together points away from the second's minimum."""
    H, g = np.array([[1.0, 0.9], [0.9, 1.0]]), np.array([1.0, -1.0])
    low, high = np.array([-1e-16, -1.0]), np.array([1.0, 0.5])
    found, w, held = solved(H, g, low, high)
    assert found
    assert w.tolist() == [-1e-16, 0.5]
    assert held.all()


def test_what_is_not_positive_definite_is_said() -> None:
    H, one = np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones(2)
    assert not solved(H, 0.1 * one, -one, one)[0]
    assert solved(H, 0.1 * one, -one, one, mu=2.0)[0]
