"""Linear MPC in sparse form (notes, 2.5.1): a quadratic programme in controls and states, stage
by stage z_k = (u_k, x_(k+1)), with the dynamics as equalities. PIQP, an interior-point method,
factorises it by stages, so that its cost grows as N, and an unstable A harms no digits.

Soft limits (beyond the notes): each row of X and X_f may be exceeded by s >= 0, which costs
w 1's, an exact penalty: where w exceeds the largest multiplier of the hard problem, that one's
solution is found. Then z_k = (u_k, x_(k+1), s_(k+1)). As x_0 is given, its own excess costs a
constant, which is left out here.
"""

from typing import NamedTuple

import numpy as np
import piqp
from scipy.sparse import block_diag, csc_matrix, eye_array, kron

from labs.algorithms.linear_mpc_limits import LIMIT_KINDS, ProblemTerms, TwoSidedLimits, limit_sets
from labs.problems.linear_mpc import LinearMpcProblem

TOLERANCE = 1e-10
"""Of the programme's residuals and its duality gap, absolute and relative."""
MAX_ITERATIONS = 100


class SparseData(NamedTuple):
    """What the terms of a problem make of the programme: all that changes while its matrices
    stay."""

    cost: np.ndarray
    """(z,)"""
    added: np.ndarray
    """(N n,) what the dynamics add, where x_0 = 0."""
    lower: np.ndarray
    """(rows,)"""
    upper: np.ndarray


class SparseSolution(NamedTuple):
    """As the solver left it."""

    solved: bool
    X: np.ndarray
    """(N + 1, n)"""
    U: np.ndarray
    """(N, m)"""
    rows: dict[str, np.ndarray]
    """By kind (steps, p), multipliers of the joined rows, negative where the lower side pushes."""
    iterations: int


class SparseQp:
    """The programme over N steps, for every x and all terms; with a penalty, softened."""

    def __init__(self, problem: LinearMpcProblem, N: int, penalty: float | None = None) -> None:
        n, m = problem.n, problem.m
        self.N, self.n, self.penalty, self._problem = N, n, penalty, problem
        self.sides = {
            kind: TwoSidedLimits.of(limits) for kind, limits in limit_sets(problem).items()
        }
        X, U, end = (self.sides[kind].H for kind in LIMIT_KINDS)
        blocks, weights, starts, rows, z = [], [], [], [], 0
        self.row_at: dict[str, list[np.ndarray]] = {kind: [] for kind in LIMIT_KINDS}
        at = 0
        for k in range(N):
            kind, limits = ("state", X) if k + 1 < N else ("terminal", end)
            soft = len(limits) if penalty is not None else 0
            starts.append(z)
            blocks.append(_stage_limits(U, limits, soft, n))
            Q = problem.Q if kind == "state" else problem.Q_f
            weights.append(block_diag([problem.R, Q, np.zeros((soft, soft))]))
            self.row_at["control"].append(at + np.arange(len(U)))
            self.row_at[kind].append(at + len(U) + np.arange(len(limits)))
            rows.append(blocks[-1].shape[0])
            at, z = at + rows[-1], z + m + n + soft
        first = np.array(starts)[:, None]
        self.u_at, self.x_at = first + np.arange(m), first + m + np.arange(n)
        self.P, self.G = csc_matrix(block_diag(weights)), csc_matrix(block_diag(blocks))
        self.A = self._dynamics(z)
        for matrix in (self.P, self.G, self.A):
            matrix.eliminate_zeros()
        self._solver: piqp.SparseSolver | None = None

    def _dynamics(self, size: int) -> csc_matrix:
        """B u_k + A x_k - x_(k+1) for every k, without the known A x_0, of z (size,)."""
        n, N, problem = self.n, self.N, self._problem
        here = kron(eye_array(N), np.hstack([problem.B, -np.eye(n)]))
        before = kron(eye_array(N, k=-1), np.hstack([0.0 * problem.B, problem.A]))
        used = np.hstack([self.u_at, self.x_at]).ravel()
        ones = np.ones(len(used))
        place = csc_matrix((ones, (np.arange(len(used)), used)), (len(used), size))
        return csc_matrix((here + before) @ place)

    def data(self, terms: ProblemTerms) -> SparseData:
        """For these terms."""
        problem = self._problem
        cost = np.full(self.P.shape[0], self.penalty or 0.0)
        cost[self.u_at] = terms.r - terms.u_ref @ problem.R
        cost[self.x_at[:-1]] = terms.q - terms.x_ref[1:-1] @ problem.Q
        cost[self.x_at[-1]] = -terms.x_ref[-1] @ problem.Q_f
        lower, upper = np.full(self.G.shape[0], -np.inf), np.full(self.G.shape[0], np.inf)
        if self.penalty is not None:
            lower[:] = 0.0  # of the slacks; the other rows follow
        for kind in LIMIT_KINDS:
            low, high = self.sides[kind].bounds(terms.h[kind])
            first = len(low) - len(self.row_at[kind])  # X limits x_0 as well, which is given
            for at, below, above in zip(self.row_at[kind], low[first:], high[first:], strict=True):
                upper[at] = above
                if self.penalty is not None and kind != "control":
                    lower[at] = -np.inf
                    at = at + len(at)
                lower[at] = below
        return SparseData(cost, -np.tile(terms.c, self.N), lower, upper)

    def solve(self, data: SparseData, x: np.ndarray) -> SparseSolution:
        """From x (n,)."""
        b = data.added.copy()
        b[: self.n] -= self._problem.A @ x
        solver = self._solver
        if solver is None:
            solver = self._solver = piqp.SparseSolver()
            solver.settings.kkt_solver = piqp.KKTSolver.sparse_multistage
            solver.settings.max_iter = MAX_ITERATIONS
            solver.settings.preconditioner_scale_cost = True
            solver.settings.check_duality_gap = True
            for name in ("eps_abs", "eps_rel", "eps_duality_gap_abs", "eps_duality_gap_rel"):
                setattr(solver.settings, name, TOLERANCE)
            # Of neutral numbers, by which it scales: its answers depend on nothing before.
            nothing, far = 0.0 * data.cost, np.ones_like(data.upper)
            solver.setup(self.P, nothing, self.A, 0.0 * b, self.G, -far, far)
        solver.update(c=data.cost, b=b, h_l=data.lower, h_u=data.upper)
        solved = solver.solve() == piqp.PIQP_SOLVED
        found = solver.result
        z = np.asarray(found.x)
        pushes = np.asarray(found.z_u) - np.asarray(found.z_l)
        return SparseSolution(
            solved,
            np.vstack([x, z[self.x_at]]),
            z[self.u_at],
            {kind: self._multipliers(pushes, kind) for kind in LIMIT_KINDS},
            int(found.info.iter),
        )

    def _multipliers(self, pushes: np.ndarray, kind: str) -> np.ndarray:
        """Of one kind's joined rows (steps, p); of the given x_0 there are none."""
        at = np.array(self.row_at[kind], dtype=int)
        found: np.ndarray = pushes[at]
        if self.penalty is not None and kind != "control":
            found = found + pushes[at + len(self.sides[kind].H)]
        if kind != "state":
            return found
        p = len(self.sides[kind].H)
        return np.vstack([np.zeros((1, p)), found.reshape(self.N - 1, p)])


def _stage_limits(U: np.ndarray, limits: np.ndarray, soft: int, n: int) -> np.ndarray:
    """The rows of a stage's limits on (u, x): U u and H x. Softened, on (u, x, s): U u, H x - s,
    H x + s and s."""
    if not soft:
        return np.asarray(block_diag([U, limits]).toarray().reshape(len(U) + len(limits), -1))
    eye, none = np.eye(soft), np.zeros((soft, U.shape[1]))
    return np.vstack(
        [
            np.hstack([U, np.zeros((len(U), n + soft))]),
            np.hstack([none, limits, -eye]),
            np.hstack([none, limits, eye]),
            np.hstack([none, 0.0 * limits, eye]),
        ]
    )
