"""Features against their definitions, a state at a time."""

from itertools import pairwise

import numpy as np
import pytest

from labs.algorithms.features import (
    Features,
    add_features,
    evaluate,
    features_from_matrix,
    fourier_basis,
    grid_centers,
    polynomial_basis,
    radial_basis,
    state_aggregation,
    tabular_features,
    tile_coding,
    zero_features_at,
)
from labs.compiled import compiled
from labs.errors import LabError

POINTS = np.random.default_rng(0).uniform(size=(7, 2))


@compiled
def update_twice(features: Features, w: np.ndarray, x: int, amount: float) -> float:
    add_features(features, w, x, amount)
    add_features(features, w, x, amount)
    return evaluate(features, w, x)


@pytest.mark.parametrize(
    "features",
    [
        tabular_features(7),
        state_aggregation(np.array([0, 0, 1, 1, 2, 2, 2])),
        fourier_basis(POINTS, 2),
        tile_coding(POINTS, 4, np.array([3, 2])),
        zero_features_at(polynomial_basis(POINTS, 1), np.arange(7) == 3),
    ],
)
def test_what_is_stored_is_the_matrix(features: Features) -> None:
    phi, w = features.dense, np.random.default_rng(1).normal(size=features.size)
    for x in range(7):
        moved = w + 0.6 * phi[x]
        changed = w.copy()
        assert update_twice(features, changed, x, 0.3) == pytest.approx(phi[x] @ moved)
        np.testing.assert_allclose(changed, moved, rtol=1e-13)


def test_polynomials_and_fourier_are_what_they_say() -> None:
    s, t = POINTS.T
    expected = [s**i * t**j for i in range(3) for j in range(3)]
    np.testing.assert_allclose(polynomial_basis(POINTS, 2).dense, np.transpose(expected))
    waves = [np.cos(np.pi * (i * s + j * t)) for i in range(4) for j in range(4)]
    np.testing.assert_allclose(fourier_basis(POINTS, 3).dense, np.transpose(waves), atol=1e-14)


def test_radial_functions_peak_at_their_centers_and_may_sum_to_one() -> None:
    centers = grid_centers(3, 2)
    assert centers.shape == (9, 2)
    np.testing.assert_allclose(np.diag(radial_basis(centers, centers, 0.2).dense), 1.0)
    x = radial_basis(np.array([[0.3, 0.5]]), np.array([[0.5, 0.5]]), 0.2).dense[0, 0]
    assert x == pytest.approx(np.exp(-0.5))
    for width in (0.3, 1e-3):
        normalized = radial_basis(POINTS, centers, width, normalized=True).dense
        np.testing.assert_allclose(normalized.sum(axis=1), 1.0)


def test_tiles_are_one_cell_a_tiling_and_shifted() -> None:
    """Points of one cell of the coarse grid share 1 - k / tilings of their features where k
    boundaries of shifted grids lie between them."""
    line = np.linspace(0.0, 1.0, 401)[:, None]
    phi = tile_coding(line, 4, np.array([5])).dense
    assert (phi.sum(axis=1) == 4.0).all()
    assert phi.shape[1] == 4 * 6
    shared = phi @ phi[0]
    bounds = [0.0, 0.05, 0.1, 0.15, 0.2, 1.01]  # a boundary every 0.2 / 4
    for k, (low, high) in enumerate(pairwise(bounds)):
        inside = (line[:, 0] > low + 1e-9) & (line[:, 0] < high - 1e-9)
        assert (shared[inside] == 4 - k).all()
    plane = tile_coding(POINTS, 8, np.array([4, 4]))
    assert plane.active.shape == (7, 8)
    assert (plane.dense.sum(axis=1) == 8.0).all()
    corners = tile_coding(np.array([[0.0, 0.0], [1.0, 1.0]]), 8, np.array([4, 4]))
    assert (corners.active < corners.size).all()


def test_aggregated_states_share_and_terminal_ones_have_none() -> None:
    features = zero_features_at(
        state_aggregation(np.array([0, 0, 1, 1])), np.array([1, 0, 0, 0], bool)
    )
    np.testing.assert_array_equal(features.dense, [[0, 0], [1, 0], [0, 1], [0, 1]])
    np.testing.assert_array_equal(features_from_matrix(features.dense).dense, features.dense)


def test_what_does_not_fit_is_refused() -> None:
    outside = np.array([[1.5]])
    with pytest.raises(LabError, match="unit cube"):
        polynomial_basis(outside, 2)
    with pytest.raises(LabError, match="unit cube"):
        fourier_basis(POINTS[:, 0], 2)
    with pytest.raises(LabError, match="unit cube"):
        radial_basis(outside, np.zeros((1, 1)), 0.1)
    with pytest.raises(LabError, match="unit cube"):
        tile_coding(outside, 2, np.array([2]))
    with pytest.raises(LabError, match="width = 0"):
        radial_basis(POINTS, POINTS, 0.0)
    with pytest.raises(LabError, match="tilings = 0"):
        tile_coding(POINTS, 0, np.array([2, 2]))
    with pytest.raises(LabError, match="order = -1"):
        fourier_basis(POINTS, -1)
