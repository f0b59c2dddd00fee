"""A Hessian learnt from gradients, by damped BFGS updates (notes, 2.3.1; damping beyond them:
Powell 1978). After a step s that changed the gradient of the Lagrangian by r,

    B+ = B - B s s'B / s'B s + w w' / s'w,    w = theta r + (1 - theta) B s

with theta = 1 where s'r >= 0.2 s'B s, and else as small as makes s'w = 0.2 s'B s, which keeps B
positive definite. Where the Lagrangian is a sum over groups of variables that do not meet in it,
as the points of a grid, each group has a B of its own: sparse, and learnt from every step.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.csgraph import connected_components

from labs.algorithms.assembly import Assembly, block_terms
from labs.errors import LabError

LARGEST_GROUP = 400
"""A dense B of more variables is no longer worth it."""
DAMPING = 0.2
INITIAL_DIAGONAL = 1e-3
"""Of the size of the first B, on its diagonal."""


@dataclass(frozen=True, eq=False)
class BlockBfgs:
    """B by groups of variables."""

    groups: tuple[np.ndarray, ...]
    blocks: tuple[np.ndarray, ...]

    def matrix(self) -> csc_array:
        """All of it (n, n)."""
        n, source, terms = sum(len(group) for group in self.groups), 0, []
        for group in self.groups:
            terms.append(block_terms(group[None], group[None], source))
            source += len(group) ** 2
        entries = np.concatenate([block.ravel() for block in self.blocks])
        return Assembly((n, n), source, *terms).matrix(entries)

    def update(self, s: np.ndarray, r: np.ndarray) -> "BlockBfgs":
        """B+, from the step s (n,) and the change of the gradient r (n,)."""
        pairs = zip(self.blocks, self.groups, strict=True)
        blocks = tuple(_damped_update(block, s[group], r[group]) for block, group in pairs)
        return BlockBfgs(self.groups, blocks)


def initial_hessian(H: csc_array) -> BlockBfgs:
    """To begin with: H, never indefinite, and a small part of its size on the diagonal. Raises
    LabError where a group is too large."""
    groups = _variable_groups(H)
    size = max(float(np.abs(H.diagonal()).max(initial=0.0)), 1e-300)
    rows = H.tocsr()
    blocks = [
        rows[group][:, group].toarray() + INITIAL_DIAGONAL * size * np.eye(len(group))
        for group in groups
    ]
    return BlockBfgs(tuple(groups), tuple(blocks))


def _variable_groups(pattern: csc_array) -> list[np.ndarray]:
    """The variables of each, by the pattern of the Hessian; a last one that meets most others, as
    a free final time does, is a group by itself."""
    n = pattern.shape[0]
    columns = np.repeat(np.arange(n), np.diff(pattern.indptr))
    counts = np.diff(pattern.indptr)
    border = np.zeros(n, bool)
    border[-1] = counts[-1] > n // 2 and counts[:-1].max(initial=0) <= n // 2
    kept = ~border[pattern.indices] & ~border[columns]
    places = (pattern.indices[kept], columns[kept])
    graph = csc_array((np.ones(len(places[0])), places), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    found = np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])
    largest = max(len(group) for group in found)
    if largest > LARGEST_GROUP:
        raise LabError(
            f"BFGS would learn a dense Hessian of {largest} variables here, {LARGEST_GROUP} are "
            "the most: choose Gauss-Newton or exact second derivatives"
        )
    return found


def _damped_update(B: np.ndarray, s: np.ndarray, r: np.ndarray) -> np.ndarray:
    Bs = B @ s
    curvature = float(s @ Bs)
    if not curvature > 1e-300:
        return B
    slope = float(s @ r)
    theta = 1.0
    if slope < DAMPING * curvature:
        theta = (1.0 - DAMPING) * curvature / (curvature - slope)
    w = theta * r + (1.0 - theta) * Bs
    new: np.ndarray = B - np.outer(Bs, Bs) / curvature + np.outer(w, w) / (s @ w)
    return new if np.isfinite(new).all() else B
