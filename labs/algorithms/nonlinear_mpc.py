"""Nonlinear model predictive control by sequential quadratic programming (notes, 2.5, 2.5.4), the
problem of `labs.algorithms.nonlinear_mpc_problem`.

One iteration linearises the dynamics and g about the present trajectory X, U, x_0 = x measured, and
takes the whole step to the solution of the quadratic programme of `stage_qp` (Gauss-Newton: the
cost is quadratic, the curvature of f and g is left out). The states are variables of their own, as
in multiple shooting: between iterations they need not follow from the controls, and the gap

    |x_(k+1) - f(x_k, u_k)|

closes quadratically with the steps. The *real-time iteration* (Diehl et al., 2005) is a single one
a period, from the plan of the period before, shifted: the optimiser converges while the robot
moves. Iterated until the step vanishes, it has solved the nonlinear problem.
"""

from copy import copy
from dataclasses import replace
from functools import lru_cache
from time import perf_counter
from typing import Self, final

import numpy as np

from labs.algorithms.nonlinear_mpc_problem import NonlinearMpcProblem
from labs.algorithms.stage_qp import Linearization, StageQp, StageStep
from labs.errors import LabError
from labs.problems.receding_horizon import Plan
from labs.resumable import Resumable, timed

TOLERANCE = 1e-4
"""A step that changes no state or control by more, in parts of one plus its size, has converged."""
MAX_ITERATIONS = 30
"""Before a solve to convergence stops short."""
AT_LIMIT = 1e-5
"""What is so near a limit, in parts of one plus its size, is at it."""
DIVERGENCE_LIMIT = 1e6
"""No state is as large as this."""
REAL_TIME_TOLERANCE, CONVERGENCE_TOLERANCE = 1e-8, 1e-10
"""What the quadratic programmes are solved to. Where a limit is only just active, states are known
to the root of it."""
MAX_CACHED_HORIZONS = 4
"""Lengths of horizon whose programmes are kept."""
ELASTIC_PENALTY = 1e4
"""gamma of the programme that says by how much an infeasible one is missed."""


@final
class NonlinearMpc:
    """Plans by so many iterations a period (1: the real-time iteration), or to convergence where
    it is None. Implements `labs.problems.receding_horizon.Planner`."""

    def __init__(self, problem: NonlinearMpcProblem, iterations: int | None = 1) -> None:
        if iterations is not None and iterations < 1:
            raise LabError(f"{iterations} iterations a period: it takes at least one")
        self.problem, self.iterations = problem, iterations
        tolerance = CONVERGENCE_TOLERANCE if iterations is None else REAL_TIME_TOLERANCE
        self._qp = lru_cache(MAX_CACHED_HORIZONS)(lambda N: StageQp(problem, N, tolerance))
        self._elastic = lru_cache(1)(
            lambda N: StageQp(replace(problem, penalty=ELASTIC_PENALTY), N)
        )

    def with_reference(self, x_ref: np.ndarray, u_ref: np.ndarray) -> Self:
        """The same with another x_ref (nx,) and u_ref (nu,): what is set up is shared."""
        other = copy(self)
        other.problem = replace(self.problem, x_ref=x_ref, u_ref=u_ref)
        return other

    def plan(self, x: np.ndarray, guess: Plan | None, N: int | None = None) -> Resumable[Plan]:
        """The plan from x (nx,); without a guess from x held still and u_ref."""
        seconds = dict.fromkeys(("derivatives", "QP", "rest"), 0.0)
        plan = yield from timed(self._plan(x, guess, N or self.problem.N, seconds), seconds, "rest")
        seconds["rest"] -= seconds["derivatives"] + seconds["QP"]
        return replace(plan, seconds=seconds)

    def _plan(
        self, x: np.ndarray, guess: Plan | None, N: int, seconds: dict[str, float]
    ) -> Resumable[Plan]:
        qp, step = self._qp(N), StageStep(*self._initial_trajectory(x, guess, N), np.zeros(N))
        qp.set_reference(self.problem)
        most, iteration, change, gap = self.iterations or MAX_ITERATIONS, 0, np.inf, np.inf
        while iteration < most and change > TOLERANCE:
            if iteration:
                yield
            iteration += 1
            begun = perf_counter()
            at = self.linearize(step.X, step.U)
            linearized = perf_counter()
            found = qp.solve(at)
            seconds["derivatives"] += linearized - begun
            seconds["QP"] += perf_counter() - linearized
            if found is None or not np.abs(found.X).max() < DIVERGENCE_LIMIT:
                return self._failed_plan(at, iteration, diverged=found is not None)
            gap = float(np.abs(at.Y - at.X[1:]).max())
            change = max(_relative_change(found.X, step.X), _relative_change(found.U, step.U))
            step = found
        penalty = (self.problem.penalty or 0.0) * step.s.sum()
        return Plan(
            step.X,
            step.U,
            self.problem.cost(step.X, step.U) + float(penalty),
            found=True,
            message=self._message(iteration, change),
            active=self.active_limits(step.X, step.U),
            violation=float(step.s.max()),
            iterations=iteration,
            gap=gap,
        )

    def linearize(self, X: np.ndarray, U: np.ndarray) -> Linearization:
        """Of dynamics and g about a trajectory X (N + 1, nx), U (N, nu)."""
        Y, A, B = self.problem.dynamics.linearize(X, U)
        path, N = self.problem.path, len(U)
        if path is None:
            none = np.zeros((N, 0, self.problem.nx))
            return Linearization(X, U, Y, A, B, none[:, :, 0], none)
        return Linearization(X, U, Y, A, B, path.values(X[1:]), path.jacobians(X[1:]))

    def active_limits(self, X: np.ndarray, U: np.ndarray) -> dict[str, np.ndarray]:
        """By kind, which limits a plan is at or beyond: "position" and "velocity" (N + 1, nq),
        "control" (N, nu), and where there is g, "path" (N + 1, size)."""
        p, n = self.problem, self.problem.nx // 2
        at = _at_limit(X, p.x_lower, p.x_upper)
        found = {
            "position": at[:, :n],
            "velocity": at[:, n:],
            "control": _at_limit(U, p.u_lower, p.u_upper),
        }
        if p.path:
            found["path"] = p.path.values(X) >= -AT_LIMIT
        return found

    def _initial_trajectory(
        self, x: np.ndarray, guess: Plan | None, N: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """The trajectory to begin with, from x. A longer guess is cut, a shorter one held."""
        if guess is None:
            X, U = np.tile(x, (N + 1, 1)), np.tile(self.problem.u_ref, (N, 1))
        else:
            have = len(guess.U)
            X = guess.X[np.minimum(np.arange(N + 1), have)]
            U = guess.U[np.minimum(np.arange(N), have - 1)]
            X[0] = x
        return X, np.clip(U, self.problem.u_lower, self.problem.u_upper)

    def _message(self, iterations: int, change: float) -> str:
        if change <= TOLERANCE:
            return f"Converged after {iterations} iteration{'s'[: iterations != 1]}."
        if self.iterations is None:
            return (
                f"Stopped short after {iterations} iterations: the last one still changed the "
                f"trajectory by {change:.1e}. Start from a nearer guess."
            )
        return f"The last iteration changed the trajectory by {change:.1e}."

    def _failed_plan(self, at: Linearization, iteration: int, *, diverged: bool) -> Plan:
        """No plan, and why: the limit that is exceeded most if it has to be."""
        message = "The iterations diverge. Start from a nearer guess."
        if not diverged:
            message = "The solver of the quadratic programme failed."
            elastic = None if self.problem.soft else self._elastic(len(at.U))
            if elastic:
                elastic.set_reference(replace(self.problem, penalty=ELASTIC_PENALTY))
            least = elastic.solve(at) if elastic else None
            if least and least.s.max() > AT_LIMIT:
                message = self._infeasible_message(least)
        return Plan(at.X, at.U, np.nan, False, message, iterations=iteration)

    def _infeasible_message(self, least: StageStep) -> str:
        """What is exceeded, and when, by the trajectory that exceeds limits least."""
        p, n = self.problem, self.problem.nx // 2
        X = least.X[1:]
        excess = np.maximum(X - p.x_upper, p.x_lower - X)
        worst = {"position": excess[:, :n], "velocity": excess[:, n:]}
        if p.path:
            worst["distance of the tip"] = p.path.values(X)
        kind = max(worst, key=lambda name: worst[name].max())
        k, i = np.unravel_index(np.argmax(worst[kind]), worst[kind].shape)
        return (
            f"Infeasible: whatever it does within the control limits, limit {i + 1} of the {kind} "
            f"is exceeded at step {k + 1} of {len(X)}, by {worst[kind][k, i]:.2g} at least."
        )


def _at_limit(x: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Whether x is at or beyond a limit; never one that is infinite."""
    with np.errstate(invalid="ignore"):
        below = x <= lower + AT_LIMIT * (1.0 + np.abs(lower))
        above = x >= upper - AT_LIMIT * (1.0 + np.abs(upper))
    return np.asarray(below | above)


def _relative_change(new: np.ndarray, old: np.ndarray) -> float:
    return float((np.abs(new - old) / (1.0 + np.abs(old))).max())
