"""Features of states, for value functions linear in their weights (notes, 3.7.1):

    v(x, w) = phi(x)' w,    gradient phi(x);    q(x, u, w) = phi(x)' w_u

Points s (X, k) are states scaled to the unit cube. d features of them:

    table          one a state, d = X
    aggregation    one a group of neighbouring states
    polynomials    products s_1^c_1 ... s_k^c_k, all c_i <= order, d = (order + 1)^k
    Fourier        cos(pi c's), the same c
    radial         exp(-|s - center|^2 / (2 width^2)); normalized, divided by their sum
    tiles          beyond the notes: one a cell in each of several grids that are shifted against
                   one another by fractions of a cell (Sutton and Barto, 2nd edition, 9.5.4)

Where few of many are not 0, only those are stored."""

from itertools import product
from typing import NamedTuple

import numpy as np
import scipy.sparse

from labs.compiled import inlined
from labs.errors import LabError


class Features(NamedTuple):
    """The features of X states, in each state m of them that may differ from 0."""

    active: np.ndarray
    """(X, m) int64: which ones, below d; within a row each at most once."""
    value: np.ndarray
    """(X, m) their values."""
    size: int
    """d."""

    @property
    def dense(self) -> np.ndarray:
        """Phi (X, d), a state a row."""
        phi = np.zeros((len(self.active), self.size))
        np.put_along_axis(phi, self.active, self.value, axis=1)
        return phi

    @property
    def sparse(self) -> scipy.sparse.csr_array:
        """The same, of which only what may differ from 0 is stored."""
        rows = np.arange(len(self.active) + 1) * self.active.shape[1]
        entries = (self.value.ravel(), self.active.ravel(), rows)
        return scipy.sparse.csr_array(entries, shape=(len(self.active), self.size))


def features_from_matrix(phi: np.ndarray) -> Features:
    """Given values (X, d)."""
    states, size = phi.shape
    return Features(np.tile(np.arange(size), (states, 1)), np.ascontiguousarray(phi, float), size)


def tabular_features(states: int) -> Features:
    """The linear form of a table."""
    return state_aggregation(np.arange(states))


def state_aggregation(groups: np.ndarray) -> Features:
    """States of one group (X,) share one weight; groups are numbered from 0."""
    index = groups.astype(np.int64)[:, None]
    return Features(index, np.ones(index.shape), int(groups.max()) + 1)


def zero_features_at(features: Features, where: np.ndarray) -> Features:
    """The same, but 0 in the states of `where` (X,) bool: in terminal states values are 0."""
    return features._replace(value=np.where(where[:, None], 0.0, features.value))


def polynomial_basis(points: np.ndarray, order: int) -> Features:
    """Of points (X, k)."""
    powers = _exponents(points, order)
    return features_from_matrix(np.prod(points[:, None, :] ** powers, axis=2))


def fourier_basis(points: np.ndarray, order: int) -> Features:
    """Of points (X, k)."""
    return features_from_matrix(np.cos(np.pi * points @ _exponents(points, order).T))


def radial_basis(
    points: np.ndarray, centers: np.ndarray, width: float, normalized: bool = False
) -> Features:
    """Of points (X, k) with centers (d, k); width > 0 in units of the cube."""
    _check_points(points)
    if not width > 0.0:
        raise LabError(f"width = {width}: takes a positive number")
    squares = ((points[:, None, :] - centers) ** 2).sum(axis=2)
    # Counted from the nearest center, so that far from all of them the sum is not 0.
    least = squares.min(axis=1, keepdims=True) if normalized else 0.0
    phi = np.exp(-(squares - least) / (2.0 * width**2))
    return features_from_matrix(phi / phi.sum(axis=1, keepdims=True) if normalized else phi)


def grid_centers(count: int, dimensions: int) -> np.ndarray:
    """(count^k, k) evenly over the cube, its faces included."""
    line = np.linspace(0.0, 1.0, count)
    return np.stack(np.meshgrid(*[line] * dimensions, indexing="ij"), -1).reshape(-1, dimensions)


def tile_coding(points: np.ndarray, tilings: int, cells: np.ndarray) -> Features:
    """Of points (X, k), in `tilings` grids of cells (k,) int along each side of the cube. Grid i is
    shifted by i / tilings of a cell times 1, 3, 5, ... along the sides (Miller and Glanz 1996), and
    has one more cell along each."""
    _check_points(points)
    k = points.shape[1]
    if tilings < 1 or len(cells) != k or not (np.asarray(cells) >= 1).all():
        raise LabError(f"tilings = {tilings}, cells = {cells}: at least 1, cells for each side")
    shift = np.arange(tilings)[:, None] * (2 * np.arange(k) + 1) % tilings / tilings
    # A face of the cube belongs to the last cell before it.
    inside = np.minimum(points * cells, np.nextafter(np.asarray(cells, float), 0.0))
    at = np.floor(inside[:, None, :] + shift).astype(np.int64)
    sides = np.asarray(cells) + 1
    cell = np.ravel_multi_index(tuple(np.moveaxis(at, 2, 0)), tuple(sides))
    each = int(np.prod(sides))
    index = cell + each * np.arange(tilings)
    return Features(index, np.ones(index.shape), each * tilings)


def state_values(features: Features, w: np.ndarray) -> np.ndarray:
    """(..., X) phi(x)' w of all states, of w (..., d)."""
    return np.asarray((features.value * w[..., features.active]).sum(axis=-1))


@inlined
def evaluate(features: Features, w: np.ndarray, x: int) -> float:
    """phi(x)' w of w (d,)."""
    total = 0.0
    for i in range(features.active.shape[1]):
        total += features.value[x, i] * w[features.active[x, i]]
    return total


@inlined
def add_features(features: Features, w: np.ndarray, x: int, amount: float) -> None:
    """w <- w + amount phi(x), in place."""
    for i in range(features.active.shape[1]):
        w[features.active[x, i]] += amount * features.value[x, i]


def _check_points(points: np.ndarray) -> None:
    if points.ndim != 2 or not ((points >= 0.0) & (points <= 1.0)).all():
        raise LabError("points are (X, k), scaled to the unit cube")


def _exponents(points: np.ndarray, order: int) -> np.ndarray:
    _check_points(points)
    if order < 0:
        raise LabError(f"order = {order}: takes a whole number from 0")
    return np.array(list(product(range(order + 1), repeat=points.shape[1])))
