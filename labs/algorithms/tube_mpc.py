"""Robust MPC of a linear system by a tube (notes, 2.5.5): limits hold for every disturbance in W.

    x+ = A x + B u + w, w in W;   u = v + K (x - z);   nominal z+ = A z + B v

The error e = x - z follows e+ = (A + B K) e + w whatever v is: once in S, a robust invariant set
of A + B K and W, it stays there. So x stays in X and u in U if the nominal state and control keep

    z in X - S = {z : z + e in X for all e in S},    v in U - K S.

At every period, over z_0 and v_0 ... v_(N-1):

    minimise V_N(z_0, v)   subject to   x - z_0 in S,  the tightened limits,  z_N in X_f

where X_f is the nominal state's: inside the tightened limits, and such that it need not be left.
Then a problem that is feasible once is feasible for ever, and x goes to S if the nominal state
goes to the origin. That z_0 may be chosen makes more states feasible (X_N + S) than z_0 = x would.

D. Q. Mayne, M. M. Seron, S. V. Rakovic, "Robust model predictive control of constrained linear
systems with bounded disturbances", Automatica 41, 2005.
"""

from dataclasses import replace
from time import perf_counter
from typing import NamedTuple

import daqp
import numpy as np

from labs.algorithms.linear_mpc_condensed import DAQP_SETTINGS, EQUALITY, SOLVED, CondensedQp
from labs.algorithms.linear_mpc_limits import ProblemTerms
from labs.algorithms.polytopes import is_empty
from labs.algorithms.robust_invariant_set import RobustInvariantSet
from labs.problems.linear_mpc import LinearMpcProblem
from labs.problems.polyhedron import Polyhedron
from labs.problems.receding_horizon import Plan
from labs.resumable import Resumable

SECONDS_BETWEEN_PAUSES = 0.004
"""[s] of work between two pauses."""
TUBE_TOLERANCE = 1e-9
"""By how much the measured state may leave its tube: what rounding adds in a period."""


class TubeValues(NamedTuple):
    """What is planned from many states; NaN where no plan is found."""

    z: np.ndarray
    """(k, n) the nominal states that plans start from."""
    u: np.ndarray
    """(k, m) what acts: v_0 + K (x - z_0)."""
    V: np.ndarray
    """(k,)"""


def tighten_problem(
    problem: LinearMpcProblem, S: RobustInvariantSet, K: np.ndarray
) -> LinearMpcProblem:
    """The nominal problem: X less S, U less K S. Its terminal set is the nominal state's, and
    stays."""
    X, U = problem.state_set, problem.control_set
    return replace(
        problem,
        state_set=Polyhedron(X.H, X.h - S.support(X.H)),
        control_set=Polyhedron(U.H, U.h - S.support(U.H @ K)),
    )


class TubePlanner:
    """A `labs.problems.receding_horizon.Planner` whose plans start at a z_0 of their own and act
    by u_k = v_k + K (x_k - z_k). A plan depends on nothing that was planned before."""

    def __init__(self, nominal: LinearMpcProblem, S: Polyhedron, K: np.ndarray) -> None:
        """Of the tightened problem."""
        self.nominal, self.S, self.K = nominal, S, K
        self._programmes: dict[int, _TubeQp] = {}

    def plan(self, x: np.ndarray, guess: Plan | None, N: int | None = None) -> Resumable[Plan]:
        """From the measured x (n,); the guess is not looked at."""
        begun = perf_counter()
        programme = self._qp_of_horizon(self.nominal.N if N is None else N)
        yield
        found, z, V, value, iterations = programme.solve(x)
        A, B, X = self.nominal.A, self.nominal.B, [z]
        for v in V:
            X.append(A @ X[-1] + B @ v + programme.terms.c)
        return Plan(
            X=np.array(X),
            U=V,
            cost=value,
            found=found,
            message="Solved." if found else self._infeasible_message(),
            iterations=iterations,
            K=self.K,
            seconds={"QP": perf_counter() - begun},
        )

    def values(self, states: np.ndarray) -> Resumable[TubeValues]:
        """Of the states (k, n), one by one."""
        k, n, m = len(states), self.nominal.n, self.nominal.m
        tubes = TubeValues(np.full((k, n), np.nan), np.full((k, m), np.nan), np.full(k, np.nan))
        programme, begun = self._qp_of_horizon(self.nominal.N), perf_counter()
        for i, x in enumerate(states):
            found, z, V, value, _ = programme.solve(x)
            if found:
                tubes.z[i], tubes.u[i], tubes.V[i] = z, V[0] + self.K @ (x - z), value
            if perf_counter() - begun > SECONDS_BETWEEN_PAUSES:
                yield
                begun = perf_counter()
        return tubes

    def _qp_of_horizon(self, N: int) -> "_TubeQp":
        if N not in self._programmes:
            self._programmes[N] = _TubeQp(self.nominal, self.S, N)
        return self._programmes[N]

    def _infeasible_message(self) -> str:
        for name, limits in (("X", self.nominal.state_set), ("U", self.nominal.control_set)):
            if is_empty(limits):
                return (
                    f"The disturbances are too large: nothing is left of {name} once the tube is "
                    "taken off. Make them smaller, or the limits wider."
                )
        return (
            "Infeasible: from no nominal state, with the measured one in its tube, do the "
            "tightened limits allow a way to the terminal set."
        )


class _TubeQp:
    """The quadratic programme in (z_0, v_0, ..., v_(N-1)) over N steps."""

    def __init__(self, nominal: LinearMpcProblem, S: Polyhedron, N: int) -> None:
        self.terms, self.S, self.shape = ProblemTerms.of(nominal, N), S, (N, nominal.m)
        form = CondensedQp(nominal, N)
        data = form.data(self.terms)
        slope, self.constant = data.uncontrolled_cost
        H = np.block([[form.M, form.F.T], [form.F, form.H]])
        rows = [np.hstack([form.E, form.G]), np.hstack([S.H, np.zeros((len(S.h), N * nominal.m))])]
        self.lower = np.concatenate([data.lower, np.zeros(len(S.h))])
        upper = np.concatenate([data.upper, np.full(len(S.h), np.inf)])
        self.sense = np.zeros(len(upper), dtype=np.int32)
        self.sense[: len(data.upper)][data.upper <= data.lower] = EQUALITY
        # Where a limit contradicts itself, or H has lost its digits, there is nothing to solve.
        self.solvable = not (data.upper < data.lower - TUBE_TOLERANCE).any()
        self.model = daqp.Model()
        if self.solvable:
            f = np.concatenate([slope, data.f])
            flag, _ = self.model.setup(H, f, np.vstack(rows), upper, self.lower, self.sense)
            self.solvable = flag >= 0
            self.model.settings = DAQP_SETTINGS

    def solve(self, x: np.ndarray) -> tuple[bool, np.ndarray, np.ndarray, float, int]:
        """Whether there is a solution, z_0 (n,), V (N, m), V_N and the iterations."""
        n, (N, m) = len(x), self.shape
        if not self.solvable:
            return False, np.zeros(n), np.zeros((N, m)), np.nan, 0
        lower = self.lower.copy()
        lower[len(lower) - len(self.S.h) :] = self.S.H @ x - self.S.h - TUBE_TOLERANCE
        # What it starts from is said anew, so that its answer depends on nothing that was before.
        self.model.update(blower=lower, sense=self.sense)
        y, value, flag, info = self.model.solve()
        found = flag == SOLVED
        value = value + self.constant if found else np.nan
        return found, y[:n], y[n:].reshape(N, m), float(value), int(info["iterations"])
