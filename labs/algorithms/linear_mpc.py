"""Linear MPC (notes, 2.5.1 to 2.5.3): the quadratic programme of `labs/problems/linear_mpc.py`,
at every period from the state measured there.

`condensed` has the controls alone as variables and starts warm: the fastest while N m is small.
`sparse` has states as well, and its cost grows as N alone. Where the condensed form fails, as over
long horizons of an unstable A, whose powers cost all digits, the sparse one is asked.

With a penalty the limits of X and X_f are soft (beyond the notes): the hard problem's plan where
its multipliers do not exceed the penalty, which is then exact, else the one that balances cost
and excess. The limits of U are always hard.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Literal, NamedTuple, Self

import numpy as np

from labs.algorithms import linear_mpc_condensed as condensed
from labs.algorithms import linear_mpc_sparse as sparse
from labs.algorithms.linear_mpc_condensed import INFEASIBLE, SOLVED, CondensedQp
from labs.algorithms.linear_mpc_infeasible import Infeasibility, first_infeasibility
from labs.algorithms.linear_mpc_limits import LIMIT_KINDS, ProblemTerms, TwoSidedLimits, limit_sets
from labs.algorithms.linear_mpc_sparse import SparseQp
from labs.errors import LabError
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.receding_horizon import Plan
from labs.resumable import Resumable

QpForm = Literal["condensed", "sparse"]
CHANGEABLE_TERMS = ("c", "x_ref", "u_ref", "q", "r", "state_margins", "control_margins")
LIMIT_TOLERANCE = 1e-6
"""By how much of 1 + |h| what a solver calls solved may exceed a limit."""
SECONDS_BETWEEN_PAUSES = 0.004
"""[s] of work between two pauses of a batch."""


@dataclass(frozen=True, eq=False)
class LinearPlan(Plan):
    """With what says why it is optimal, or why there is none. `cost` is without the penalty."""

    multipliers: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Of each limit, shaped as `active`."""
    infeasibility: Infeasibility | None = None
    """The first step and limit that cannot be met."""


class OptimalValues(NamedTuple):
    """V*_N and the control of many states."""

    V: np.ndarray
    """(k,) NaN where the problem is infeasible."""
    u: np.ndarray
    """(k, m) u*_0, likewise."""


class LinearPlanner:
    """A `labs.problems.receding_horizon.Planner`. What it keeps are factorisations: a plan
    depends on nothing that was planned before but its guess."""

    def __init__(
        self,
        problem: LinearMpcProblem,
        form: QpForm = "condensed",
        penalty: float | None = None,
        holds: Sequence[int] | None = None,
    ) -> None:
        """`holds` is move blocking (beyond the notes), in condensed form: the controls are held
        over so many steps each. Raises LabError for a penalty that is not positive, and for
        `holds` that do not add up to N or ask for the sparse form."""
        if penalty is not None and not 0.0 < penalty < np.inf:
            raise LabError(f"a penalty of {penalty}: it takes a positive number, or None: hard")
        if holds is not None and (form == "sparse" or penalty is not None):
            raise LabError("controls are held over several steps in condensed form, limits hard")
        self.problem, self.form, self.penalty, self.holds = problem, form, penalty, holds
        self._condensed: dict[int, CondensedQp] = {}
        self._sparse: dict[tuple[int, bool], SparseQp] = {}
        self._condensed_data: dict[int, tuple[ProblemTerms, condensed.CondensedData]] = {}
        self._sparse_data: dict[tuple[int, bool], sparse.SparseData] = {}

    def with_terms(self, **terms: np.ndarray | None) -> Self:
        """The same with other terms of the problem: of c, x_ref, u_ref, q, r and the margins,
        which leave what is factorised as it is. Raises LabError for another name."""
        if wrong := sorted(set(terms) - set(CHANGEABLE_TERMS)):
            raise LabError(f"{', '.join(wrong)} may not change; {', '.join(CHANGEABLE_TERMS)} may")
        other = type(self)(
            replace(self.problem, **terms),  # type: ignore[arg-type]
            self.form,
            self.penalty,
            self.holds,
        )
        other._condensed, other._sparse = self._condensed, self._sparse
        return other

    def plan(
        self, x: np.ndarray, guess: Plan | None, N: int | None = None
    ) -> Resumable[LinearPlan]:
        """From x (n,), over N steps, of which fewer than the problem's are its last ones. The
        condensed form starts from the guess's active limits."""
        begun = perf_counter()
        N = self.problem.N if N is None else N
        if self.form == "condensed":
            plan = yield from self._plan_condensed(x, guess, N)
        else:
            plan = self._plan_sparse(x, N, hard=True)
        if self.penalty is not None and not (plan.found and self._is_exact(plan)):
            yield
            plan = self._plan_softened(x, N, plan)
        if not plan.found:
            yield
            form, _, data = yield from self._condense(N)
            why = first_infeasibility(self.problem, form, data, x)
            if why is not None:
                plan = replace(plan, infeasibility=why, message=why.message(N))
        qp = plan.seconds["QP"]
        return replace(plan, seconds={"QP": qp, "rest": perf_counter() - begun - qp})

    def values(self, X: np.ndarray) -> Resumable[OptimalValues]:
        """Of the states X (k, n), each solved from the one before: neighbours should follow each
        other. Limits are hard, whatever the penalty, and the form is the condensed one."""
        form, _, data = yield from self._condense(self.problem.N)
        V, u = np.full(len(X), np.nan), np.full((len(X), self.problem.m), np.nan)
        active, begun = None, perf_counter()
        for i, x in enumerate(X):
            flag, W, rows, value, _ = form.solve(data, x, active)
            if flag == SOLVED:
                V[i], u[i], active = value, form.controls(W)[0], np.sign(rows)
            elif not (flag == INFEASIBLE and form.trusted) and self.holds is None:
                plan = self._plan_sparse(x, self.problem.N, hard=True)
                V[i], u[i] = plan.cost, plan.U[0] if plan.found else np.nan
            if perf_counter() - begun > SECONDS_BETWEEN_PAUSES:
                yield
                begun = perf_counter()
        return OptimalValues(V, u)

    # The forms ----------------------------------------------------------------------------------

    def _plan_condensed(self, x: np.ndarray, guess: Plan | None, N: int) -> Resumable[LinearPlan]:
        """The hard problem's plan; by the sparse form where the condensed one fails."""
        form, terms, data = yield from self._condense(N)
        begun = perf_counter()
        active = None if guess is None else self._active_rows(form, guess.active)
        flag, W, rows, _, iterations = form.solve(data, x, active)
        seconds = perf_counter() - begun
        U = form.controls(W)
        multipliers = self._split_multipliers(form.sides, form.split_by_kind(rows))
        plan = self._make_plan(
            terms, self._rollout(terms, x, U), U, multipliers, iterations, seconds
        )
        if flag == SOLVED and plan.violation == 0.0:
            return plan
        if (flag == INFEASIBLE and form.trusted) or self.holds is not None:
            return _failed_plan(plan, "Infeasible.")
        return self._plan_sparse(x, N, hard=True)

    def _plan_sparse(self, x: np.ndarray, N: int, hard: bool) -> LinearPlan:
        """The hard or the softened problem's plan."""
        key = N, hard
        if key not in self._sparse:
            self._sparse[key] = SparseQp(self.problem, N, None if hard else self.penalty)
        form, terms = self._sparse[key], ProblemTerms.of(self.problem, N)
        if key not in self._sparse_data:
            self._sparse_data[key] = form.data(terms)
        begun = perf_counter()
        found = form.solve(self._sparse_data[key], x)
        seconds = perf_counter() - begun
        multipliers = self._split_multipliers(form.sides, found.rows)
        plan = self._make_plan(terms, found.X, found.U, multipliers, found.iterations, seconds)
        if found.solved and (plan.violation == 0.0 or not hard):
            return plan
        return _failed_plan(plan, "The interior-point method found no solution.")

    def _plan_softened(self, x: np.ndarray, N: int, hard: LinearPlan) -> LinearPlan:
        """The softened problem's plan."""
        plan = self._plan_sparse(x, N, hard=False)
        seconds = {"QP": plan.seconds["QP"] + hard.seconds["QP"]}
        message = f"Softened: limits are exceeded by {plan.violation:.2g} in all."
        return replace(plan, message=message if plan.found else plan.message, seconds=seconds)

    def _is_exact(self, plan: LinearPlan) -> bool:
        """Whether the hard plan solves the softened problem as well."""
        pushes = (plan.multipliers[kind].max(initial=0.0) for kind in ("state", "terminal"))
        return self.penalty is not None and max(pushes) <= self.penalty

    def _make_plan(
        self,
        terms: ProblemTerms,
        X: np.ndarray,
        U: np.ndarray,
        multipliers: dict[str, np.ndarray],
        iterations: int,
        seconds: float,
    ) -> LinearPlan:
        """A plan as a solver left it, with by how much it exceeds what it should not."""
        excess = terms.excess(self.problem, X, U)
        slack = {kind: LIMIT_TOLERANCE * (1.0 + np.abs(terms.h[kind])) for kind in LIMIT_KINDS}
        active = {k: (multipliers[k] > 0.0) & (multipliers[k] > -excess[k]) for k in LIMIT_KINDS}
        over = sum(float(excess[k][excess[k] > slack[k]].sum()) for k in LIMIT_KINDS)
        finite = bool(np.isfinite(X).all() and np.isfinite(U).all())
        return LinearPlan(
            X=X,
            U=U,
            cost=terms.cost(self.problem, X, U) if finite else np.nan,
            found=True,
            message="Solved.",
            active=active,
            violation=over if finite else np.inf,
            iterations=iterations,
            seconds={"QP": seconds},
            multipliers=multipliers,
        )

    def _rollout(self, terms: ProblemTerms, x: np.ndarray, U: np.ndarray) -> np.ndarray:
        """X (N + 1, n) by the dynamics."""
        A, X = self.problem.A, np.empty((terms.N + 1, len(x)))
        driven = U @ self.problem.B.T + terms.c
        X[0] = x
        for k in range(terms.N):
            X[k + 1] = A @ X[k] + driven[k]
        return X

    def _condense(
        self, N: int
    ) -> Resumable[tuple[CondensedQp, ProblemTerms, condensed.CondensedData]]:
        """The condensed form over N steps, made once, with what this problem puts into it."""
        if N not in self._condensed:
            self._condensed[N] = CondensedQp(self.problem, N, self.holds)
            yield
        if N not in self._condensed_data:
            terms = ProblemTerms.of(self.problem, N)
            self._condensed_data[N] = terms, self._condensed[N].data(terms)
        return self._condensed[N], *self._condensed_data[N]

    def _split_multipliers(
        self, sides: Mapping[str, TwoSidedLimits], rows: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Multipliers of the joined rows as those of the sets' own."""
        limits = limit_sets(self.problem)
        return {kind: sides[kind].split(rows[kind], len(limits[kind].h)) for kind in LIMIT_KINDS}

    def _active_rows(
        self, form: CondensedQp, active: Mapping[str, np.ndarray]
    ) -> np.ndarray | None:
        """The joined rows' sides (rows,), where the guess has the limits and the horizon of this
        problem."""
        parts, limits = [], limit_sets(self.problem)
        for kind in LIMIT_KINDS:
            steps, size = form.shapes[kind]
            given = active.get(kind)
            if given is None or given.shape != (steps, len(limits[kind].h)):
                return None
            parts.append(form.sides[kind].join(given).reshape(steps * size))
        return np.concatenate(parts)


def _failed_plan(plan: LinearPlan, message: str) -> LinearPlan:
    nothing: dict[str, np.ndarray] = {}
    return replace(
        plan, found=False, cost=np.nan, message=message, active=nothing, multipliers=nothing
    )
