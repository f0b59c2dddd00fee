"""Linear MPC in condensed form (notes, 2.5.1): a quadratic programme in the controls alone. With

    x_k = Phi_k x + phi_k + Gamma_k U,   U = (u_0, ..., u_(N-1)),

V_N(x, U) = U' H U / 2 + (F x + f)' U + V_N(x, 0), and every limit is a row of lower <= G U +
E x <= upper. H and G depend on the matrices alone, F x + f and the bounds change from period to
period. DAQP solves it by a dual active-set method: it starts at a guess of the active limits, and
where that is right it is done at once. Its cost grows as N^3.

Move blocking (beyond the notes): U = T W, where the controls W are held over several steps each.
"""

from collections.abc import Sequence
from typing import NamedTuple

import daqp
import numpy as np

from labs.algorithms.linear_mpc_limits import (
    LIMIT_KINDS,
    ProblemTerms,
    TwoSidedLimits,
    limit_sets,
    limit_tolerance,
)
from labs.problems.linear_mpc import LinearMpcProblem, check_holds

DAQP_SETTINGS = {"primal_tol": 1e-9, "dual_tol": 1e-9, "eq_reduction": -1}
SOLVED, INFEASIBLE, FAILED = 1, -1, -9
"""DAQP's exit flags, but for the last, of what it does not take at all."""
UPPER, LOWER, EQUALITY = 1, 3, 5
"""What DAQP is told of a row: that its upper or lower limit is active, that both always are."""
LARGEST_CONDITION = 1e10
"""Of an H whose programme may be called infeasible by this form alone."""
NEGLIGIBLE_ROW = 1e-12
"""A row of G so small, next to its limit's own row, is one on which no control has a grip."""


class CondensedData(NamedTuple):
    """What the terms of a problem make of the programme: all that changes while G and H stay."""

    f: np.ndarray
    """(w,)"""
    lower: np.ndarray
    """(rows,) where x = 0."""
    upper: np.ndarray
    uncontrolled_cost: tuple[np.ndarray, float]
    """V_N(x, 0) = x' M x / 2 + free[0]' x + free[1]."""


class CondensedQp:
    """The programme over N steps, for every x and all terms."""

    def __init__(
        self, problem: LinearMpcProblem, N: int, holds: Sequence[int] | None = None
    ) -> None:
        """Controls are held over holds[0], holds[1], ... steps, which add up to problem.N; of
        fewer steps the last ones count."""
        n, m = problem.n, problem.m
        self.N, self.m = N, m
        Phi, Gamma = np.zeros((N + 1, n, n)), np.zeros((N + 1, n, N * m))
        Phi[0] = np.eye(n)
        for k in range(N):
            Phi[k + 1] = problem.A @ Phi[k]
            Gamma[k + 1] = problem.A @ Gamma[k]
            Gamma[k + 1, :, k * m : (k + 1) * m] = problem.B
        self.T = _move_blocking_matrix(N, m, problem.N, holds)
        self.Phi, self.Gamma = Phi, Gamma @ self.T
        weights = np.concatenate([np.tile(problem.Q, (N, 1, 1)), problem.Q_f[None]])
        weighted = weights @ self.Gamma
        rows = (N + 1) * n
        H = self.Gamma.reshape(rows, -1).T @ weighted.reshape(rows, -1)
        H += self.T.T @ np.kron(np.eye(N), problem.R) @ self.T
        self.H = 0.5 * (H + H.T)
        self.trusted = bool(np.linalg.cond(self.H) < LARGEST_CONDITION)
        self.F = np.einsum("kiw,kij->wj", weighted, Phi)
        self.M = np.einsum("kia,kij,kjb->ab", Phi, weights, Phi)
        self._R = problem.R
        self._weights, self._A = weights, problem.A
        self._build_rows(problem)
        self._model: daqp.Model | None = None

    def _build_rows(self, problem: LinearMpcProblem) -> None:
        """G, E and, of every row, its step and kind."""
        N, m = self.N, self.m
        self.sides = {
            kind: TwoSidedLimits.of(limits) for kind, limits in limit_sets(problem).items()
        }
        X, U, end = (self.sides[kind].H for kind in LIMIT_KINDS)
        controls = self.T.reshape(N, m, -1)
        G = [X @ self.Gamma[:-1], U @ controls, (end @ self.Gamma[-1])[None]]
        E = [X @ self.Phi[:-1], np.zeros((N, len(U), problem.n)), (end @ self.Phi[-1])[None]]
        self.G = np.concatenate([rows.reshape(-1, self.H.shape[0]) for rows in G])
        self.E = np.concatenate([rows.reshape(-1, problem.n) for rows in E])
        # A control at k limits the way to x_(k+1).
        steps = (np.arange(N), np.arange(1, N + 1), np.array([N]))
        lengths = [rows.shape[1] for rows in G]
        self.steps = np.concatenate(
            [np.repeat(step, length) for step, length in zip(steps, lengths, strict=True)]
        )
        self.shapes = {kind: rows.shape[:2] for kind, rows in zip(LIMIT_KINDS, G, strict=True)}
        size = np.concatenate(
            [
                np.tile(np.linalg.norm(side.H, axis=1), len(step))
                for side, step in zip(self.sides.values(), steps, strict=True)
            ]
        )
        self.grip = np.linalg.norm(self.G, axis=1) > NEGLIGIBLE_ROW * size
        self._G = np.ascontiguousarray(self.G[self.grip])

    def data(self, terms: ProblemTerms) -> CondensedData:
        """For these terms."""
        N = self.N
        phi = np.zeros((N + 1, len(terms.c)))
        for k in range(N):
            phi[k + 1] = self._A @ phi[k] + terms.c
        linear = np.einsum("kij,kj->ki", self._weights, phi - terms.x_ref)
        linear[:-1] += terms.q
        away = phi - terms.x_ref
        square = np.einsum("ki,kij,kj->", away, self._weights, away)
        square += (terms.u_ref @ self._R * terms.u_ref).sum()
        controls = (terms.r - terms.u_ref @ self._R).ravel()
        lower, upper = [], []
        values = {"state": phi[:-1], "control": np.zeros((N, self.m)), "terminal": phi[-1:]}
        for kind in LIMIT_KINDS:
            side = self.sides[kind]
            low, high = side.bounds(terms.h[kind])
            shift = values[kind] @ side.H.T
            lower.append((low - shift).ravel())
            upper.append((high - shift).ravel())
        return CondensedData(
            np.einsum("kiw,ki->w", self.Gamma, linear) + self.T.T @ controls,
            np.concatenate(lower),
            np.concatenate(upper),
            (
                np.einsum("kij,ki->j", self.Phi, linear),
                float(0.5 * square + (phi[:-1] @ terms.q).sum()),
            ),
        )

    def solve(
        self, data: CondensedData, x: np.ndarray, active: np.ndarray | None
    ) -> tuple[int, np.ndarray, np.ndarray, float, int]:
        """DAQP's exit flag, W (w,), the rows' multipliers (rows,), V_N and the iterations, started
        where the rows' `active` sides are 1 (upper) or -1 (lower)."""
        shift = self.E @ x
        lower, upper = data.lower - shift, data.upper - shift
        if not self._limits_consistent(lower, upper):
            return INFEASIBLE, np.zeros(len(self.H)), np.zeros(len(lower)), np.nan, 0
        low, high = lower[self.grip], upper[self.grip]
        f = self.F @ x + data.f
        sense = np.zeros(len(low), dtype=np.int32)
        if active is not None:
            side = active[self.grip]
            sense[side > 0], sense[side < 0] = UPPER, LOWER
        sense[high - low <= 0.0] = EQUALITY
        if self._model is None:
            self._model = daqp.Model()
            self._set_up = self._model.setup(self.H, f, self._G, high, low, sense)[0]
            self._model.settings = DAQP_SETTINGS
        if self._set_up < 0:  # H has lost its digits
            return FAILED, np.zeros(len(self.H)), np.zeros(len(lower)), np.nan, 0
        # What it starts from is said anew, so that its answer depends on nothing that was before.
        self._model.update(f=f, bupper=high, blower=low, sense=sense)
        W, value, flag, info = self._model.solve()
        multipliers = np.zeros(len(lower))
        multipliers[self.grip] = info["lam"]
        free = x @ self.M @ x / 2.0 + data.uncontrolled_cost[0] @ x + data.uncontrolled_cost[1]
        return int(flag), W, multipliers, float(value + free), int(info["iterations"])

    def controls(self, W: np.ndarray) -> np.ndarray:
        """U (N, m) = T W."""
        return np.asarray((self.T @ W).reshape(self.N, self.m))

    def split_by_kind(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """What is of the joined rows (rows,), kind by kind (steps, p)."""
        sizes = [int(np.prod(self.shapes[kind])) for kind in LIMIT_KINDS]
        parts = np.split(rows, np.cumsum(sizes)[:-1])
        return {k: part.reshape(self.shapes[k]) for k, part in zip(LIMIT_KINDS, parts, strict=True)}

    def _limits_consistent(self, lower: np.ndarray, upper: np.ndarray) -> bool:
        """Whether no limit contradicts itself, and those without a grip are met as they are."""
        held = ~self.grip
        slack = limit_tolerance(np.where(np.isfinite(upper), upper, 0.0))
        return bool(
            (lower <= upper + slack).all()
            and (upper[held] >= -slack[held]).all()
            and (lower[held] <= slack[held]).all()
        )


def _move_blocking_matrix(N: int, m: int, total: int, holds: Sequence[int] | None) -> np.ndarray:
    """T (N m, w)."""
    if holds is None:
        return np.eye(N * m)
    check_holds(holds, total)
    blocks = np.repeat(np.arange(len(holds)), holds)[max(total - N, 0) :]
    blocks = np.concatenate([np.full(N - len(blocks), blocks[0]), blocks])
    used = np.unique(blocks)
    return np.kron((blocks[:, None] == used).astype(float), np.eye(m))
