"""The minimal robust positively invariant set, from outside."""

import numpy as np
import pytest

from labs.algorithms.polygons import support_of_points
from labs.algorithms.robust_invariant_set import RobustInvariantSet, robust_invariant_set
from labs.errors import LabError
from labs.problems.polyhedron import Polyhedron, box

ANGLES = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
LONG = 400
"""Terms of a sum that has converged to rounding."""


def published() -> tuple[np.ndarray, Polyhedron]:
    """Rakovic et al. 2005, equation 15: a double integrator under u = -(1.17, 1.03) x, with
    disturbances up to 1 in each component."""
    A = np.array([[1.0, 1.0], [0.0, 1.0]]) - np.ones((2, 1)) @ np.array([[1.17, 1.03]])
    return A, box([-1.0, -1.0], [1.0, 1.0])


def random_problem(seed: int) -> tuple[np.ndarray, Polyhedron, np.ndarray]:
    """A of spectral radius 0.9, and W with its corners: a triangle around the origin."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((2, 2))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    turn = rng.uniform(0.0, 2.0 * np.pi) + 2.0 * np.pi / 3.0 * np.arange(3)
    corners = rng.uniform(0.5, 2.0, (3, 1)) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    edges = np.roll(corners, -1, axis=0) - corners
    H = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    return A, Polyhedron(H, (H * corners).sum(axis=1)), corners


def test_the_published_example() -> None:
    found = robust_invariant_set(*published(), error=5e-5)
    assert found.s == 10
    assert found.alpha == pytest.approx(1.9e-5, abs=5e-7)
    assert found.error <= 5e-5


@pytest.mark.parametrize("seed", range(5))
def test_it_lies_around_all_sums_and_within_its_error(seed: int) -> None:
    A, W, corners = random_problem(seed)
    found = robust_invariant_set(A, W, error=1e-2)
    minimal, d = np.zeros(len(DIRECTIONS)), DIRECTIONS
    for _ in range(LONG):
        minimal += support_of_points(corners, d)
        d = d @ A
    outer = found.support(DIRECTIONS)
    assert (outer >= minimal - 1e-12).all()
    # A ball of the maximum norm reaches |d|_1 in direction d.
    assert (outer <= minimal + found.error * np.abs(DIRECTIONS).sum(axis=1)).all()
    assert found.error <= 1e-2
    np.testing.assert_allclose(support_of_points(found.polygon(), DIRECTIONS), outer, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_neither_disturbances_nor_the_dynamics_lead_out_of_it(seed: int) -> None:
    A, W, corners = random_problem(seed)
    found = robust_invariant_set(A, W, error=1e-2)
    S = found.polyhedron()
    reached = found.support(S.H @ A) + support_of_points(corners, S.H)
    assert (reached <= S.h + 1e-9).all()
    rng = np.random.default_rng(seed)
    x = np.zeros((500, 2))
    for _ in range(60):
        x = x @ A.T + corners[rng.integers(0, 3, 500)]
        assert S.contains(x, 1e-9).all()


def test_it_takes_the_fewest_terms() -> None:
    A, W = published()
    found = robust_invariant_set(A, W, error=5e-5)
    power = np.linalg.matrix_power(A, found.s - 1)
    alpha = np.abs(power).sum(axis=1).max()
    extent = np.sum([np.abs(np.linalg.matrix_power(A, k)).sum(axis=1) for k in range(9)], axis=0)
    assert alpha * extent.max() / (1.0 - alpha) > 5e-5


def test_three_dimensions_against_the_closed_form() -> None:
    a, w = np.array([0.5, -0.8, 0.0]), np.array([1.0, 0.1, 2.0])
    found = robust_invariant_set(np.diag(a), box(-w, w), error=1e-3)
    exact = w / (1.0 - np.abs(a))
    reach = found.support(np.eye(3))
    assert (reach >= exact - 1e-9).all()
    assert (reach <= exact + found.error).all()
    with pytest.raises(LabError, match="plane"):
        found.polygon()


@pytest.mark.parametrize(
    ("A", "W", "complaint"),
    [
        (1.01 * np.eye(2), box([-1.0, -1.0], [1.0, 1.0]), "spectral radius"),
        (0.9999 * np.eye(2), box([-1.0, -1.0], [1.0, 1.0]), "contracts faster"),
        (0.5 * np.eye(2), box([0.0, -1.0], [1.0, 1.0]), "origin"),
        (0.5 * np.eye(2), box([-1.0, -np.inf], [1.0, 1.0]), "bounded"),
        (0.5 * np.eye(1), box([-1.0], [np.inf]), "bounded"),
    ],
)
def test_what_has_no_such_set(A: np.ndarray, W: Polyhedron, complaint: str) -> None:
    with pytest.raises(LabError, match=complaint):
        robust_invariant_set(A, W, error=1e-3)


def test_scale() -> None:
    """Twice the disturbance, twice the set: nothing in it is absolute but the error asked for."""
    A, W = published()
    one = robust_invariant_set(A, W, error=1e-4)
    two = robust_invariant_set(A, Polyhedron(W.H, 2.0 * W.h), error=2e-4)
    assert isinstance(two, RobustInvariantSet)
    np.testing.assert_allclose(two.polygon(), 2.0 * one.polygon(), atol=1e-12)
