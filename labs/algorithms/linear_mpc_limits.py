"""The limits of linear MPC along its horizon (notes, 2.5.1), as both forms of its QP take them."""

from typing import NamedTuple

import numpy as np

from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron

LIMIT_KINDS = ("state", "control", "terminal")
"""X at x_0 ... x_(N-1), U at u_0 ... u_(N-1), X_f at x_N alone."""
FEASIBILITY_TOLERANCE = 1e-7
"""By how much of 1 + |h| a limit may be exceeded and count as met: what rounding and the solvers
leave, period after period."""


class TwoSidedLimits(NamedTuple):
    """lower <= H y <= upper: a polyhedron whose opposite rows are one. Half as many rows, and
    where both sides meet an equality, which no solver mistakes for two rows in conflict."""

    H: np.ndarray
    """(p, n)"""
    above: np.ndarray
    """(p,) the polyhedron's row of each upper limit."""
    below: np.ndarray
    """(p,) that of each lower one; -1: none."""

    @classmethod
    def of(cls, limits: Polyhedron) -> "TwoSidedLimits":
        """Rows are joined only where they are opposite to the last digit."""
        seen: dict[bytes, int] = {}
        above: list[int] = []
        below: list[int] = []
        for i, row in enumerate(np.asarray(limits.H, float)):
            opposite = seen.pop((0.0 - row).tobytes(), None)
            if opposite is not None:
                below[opposite] = i
            else:
                seen[(row + 0.0).tobytes()] = len(above)
                above.append(i)
                below.append(-1)
        rows = np.array(above, dtype=int)
        return cls(np.asarray(limits.H, float)[rows], rows, np.array(below, dtype=int))

    def bounds(self, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """lower and upper (..., p) of h (..., rows)."""
        if not h.shape[-1]:
            return h, h
        lower = np.where(self.below >= 0, -h[..., self.below], -np.inf)
        return lower, h[..., self.above]

    def split(self, joined: np.ndarray, rows: int) -> np.ndarray:
        """Multipliers (..., rows) >= 0 of those (..., p) of the joined rows, positive where the
        upper limit pushes and negative where the lower one does."""
        apart = np.zeros((*joined.shape[:-1], rows))
        apart[..., self.above] = np.maximum(joined, 0.0)
        both = self.below >= 0
        apart[..., self.below[both]] = np.maximum(-joined[..., both], 0.0)
        return apart

    def join(self, apart: np.ndarray) -> np.ndarray:
        """The sides (..., p) that are active: 1 the upper, -1 the lower, 0 none, of booleans
        (..., rows)."""
        if not apart.shape[-1]:
            return np.zeros(apart.shape, dtype=int)
        lower = (self.below >= 0) & apart[..., self.below]
        return np.where(apart[..., self.above], 1, np.where(lower, -1, 0))


class ProblemTerms(NamedTuple):
    """What of a problem over its last N steps may change while its matrices stay."""

    N: int
    c: np.ndarray
    """(n,)"""
    x_ref: np.ndarray
    """(N + 1, n)"""
    u_ref: np.ndarray
    """(N, m)"""
    q: np.ndarray
    """(n,)"""
    r: np.ndarray
    """(m,)"""
    h: dict[str, np.ndarray]
    """By kind, (steps, rows)."""

    @classmethod
    def of(cls, problem: LinearMpcProblem, N: int) -> "ProblemTerms":
        """Those of the problem's last N steps: the tail that Bellman's principle speaks of."""
        n, m, X, U = problem.n, problem.m, problem.state_set, problem.control_set
        end = problem.terminal_set
        return cls(
            N,
            np.zeros(n) if problem.c is None else problem.c,
            _last_rows(problem.x_ref, N + 1, n),
            _last_rows(problem.u_ref, N, m),
            np.zeros(n) if problem.q is None else problem.q,
            np.zeros(m) if problem.r is None else problem.r,
            {
                "state": X.h - _last_rows(problem.state_margins, N, len(X.h)),
                "control": U.h - _last_rows(problem.control_margins, N, len(U.h)),
                "terminal": np.zeros((1, 0)) if end is None else end.h[None],
            },
        )

    def cost(self, problem: LinearMpcProblem, X: np.ndarray, U: np.ndarray) -> float:
        """V_N of X (N + 1, n) and U (N, m); infinite where squares overflow, as of what a solver
        that failed left behind."""
        dx, du = X - self.x_ref, U - self.u_ref
        with np.errstate(over="ignore"):
            stages = dx[:-1] @ problem.Q * dx[:-1]
            squares = stages.sum() + (du @ problem.R * du).sum() + dx[-1] @ problem.Q_f @ dx[-1]
            return float(0.5 * squares + (X[:-1] @ self.q).sum() + (U @ self.r).sum())

    def excess(
        self, problem: LinearMpcProblem, X: np.ndarray, U: np.ndarray
    ) -> dict[str, np.ndarray]:
        """By kind, how far each limit is exceeded (steps, rows); negative: how far it is away."""
        sides = limit_sets(problem)
        values = {"state": X[:-1], "control": U, "terminal": X[-1:]}
        return {kind: values[kind] @ sides[kind].H.T - self.h[kind] for kind in LIMIT_KINDS}


def limit_sets(problem: LinearMpcProblem) -> dict[str, Polyhedron]:
    """By kind; where there is no terminal set, one without rows."""
    end = problem.terminal_set
    none = Polyhedron(np.zeros((0, problem.n)), np.zeros(0))
    return {
        "state": problem.state_set,
        "control": problem.control_set,
        "terminal": none if end is None else end,
    }


def limit_tolerance(h: np.ndarray) -> np.ndarray:
    """How far limits h may be exceeded and count as met."""
    return np.asarray(FEASIBILITY_TOLERANCE * (1.0 + np.abs(h)))


def _last_rows(given: np.ndarray | None, steps: int, size: int) -> np.ndarray:
    """The last `steps` rows of what has a row a step, or one for all steps, or is zero. More than
    there are begin with the first repeated."""
    if given is None:
        return np.zeros((steps, size))
    if np.ndim(given) == 1:
        return np.tile(given, (steps, 1))
    first = np.tile(given[:1], (max(steps - len(given), 0), 1))
    return np.concatenate([first, given])[-steps:]
