"""Differential dynamic programming (notes, 2.4.6).

    minimise J(U) = sum_(t<N) l(x_t, u_t) + l_f(x_N)   subject to  x_(t+1) = f(x_t, u_t),  x_0 given

One iteration expands l and f about the present trajectory (X, U), solves the resulting
linear-quadratic problem backward in time for the changes w_t and gains K_t (`ddp_sweep`), and
rolls the plant out under

    u_t = U_t + alpha w_t + K_t (x_t - X_t),    alpha = 1, 1/2, 1/4, ...

until J falls by more than c_1 times what the quadratic model expects,
(J_new - J) / (alpha d_1 + alpha^2 d_2 / 2) > c_1. The regularisation mu grows by its factor when
Q_uu + mu I is not positive definite, no alpha is accepted, or the ratio is below c_2, and shrinks
otherwise. Without the second derivatives of f it is the Gauss-Newton variant, iLQR.

The result is a policy: controls, and gains that are the derivative of the optimal control with
respect to the state. It is locally optimal: another first guess may end elsewhere.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from labs.algorithms.adjoint import AT_BOUND, gradient_norm
from labs.algorithms.ddp_sweep import backward_pass
from labs.algorithms.regularisation import Regularisation, regularisation
from labs.errors import LabError
from labs.problems.optimal_control import (
    Expansion,
    OptimalControlProblem,
    diverges_at,
    expand,
    rollout,
)
from labs.resumable import Resumable, run_to_completion, timed

MAX_HALVINGS = 12
"""Of alpha, at most."""
ROUNDING = 1e-14
"""Changes below this part of J cannot be told from rounding: Newton's step is then trusted."""


@dataclass(frozen=True)
class DdpOptions:
    """How the iterations go; the names are those of the notes. Raises LabError."""

    second_order: bool = False
    """Whether f'' enters: DDP proper, rather than iLQR."""
    c1: float = 1e-3
    """Least part of the expected improvement that is accepted."""
    c2: float = 0.25
    """Least part of it for which mu may shrink."""
    mu: float = 0.0
    """To start with."""
    mu_factor: float = 4.0
    mu_limit: float = 1e10
    """Most, in parts of the size of Q_uu."""
    tolerance: float = 1e-10
    """Converged once a full step with mu = 0 is expected to lower J by at most this part of it:
    it is zero where dJ/dU is, but for what pushes against the bound, and nowhere else."""
    iterations: int = 200

    def __post_init__(self) -> None:
        if not 0.0 < self.c1 <= self.c2 < 1.0:
            raise LabError(f"c1 = {self.c1:g}, c2 = {self.c2:g}: takes 0 < c1 <= c2 < 1")
        if not (self.mu >= 0.0 and self.mu_factor > 1.0):
            raise LabError(
                f"mu = {self.mu:g} with factor {self.mu_factor:g}: mu takes a number from 0, its "
                "factor one above 1"
            )


@dataclass(frozen=True, eq=False)
class DdpIterate:
    """Where the solver is. Arrays are never written into again."""

    X: np.ndarray
    """(N + 1, nx)"""
    U: np.ndarray
    """(N, nu)"""
    cost: float
    w: np.ndarray
    """(N, nu) the last backward pass's changes of U, for alpha = 1."""
    K: np.ndarray
    """(N, nu, nx) its gains."""
    mu: float
    """To be used next."""
    iteration: int = 0
    alpha: float = 0.0
    """Accepted by the last iteration; 0 if it accepted none."""
    expected: float = 0.0
    """Change of J that its quadratic model forecast for this alpha: negative."""
    actual: float = 0.0
    """Change of J that came."""
    gradient: float = 0.0
    """max |dJ/dU| where the last expansion was made, without what pushes against a bound."""
    refused: bool = False
    """Whether no step from here was accepted with mu = 0."""
    stopped: str = ""
    """Why no further iteration makes sense, in a sentence."""
    converged: bool = False
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Of the wall clock, spent by the last iteration in derivatives, backward and forward."""
    model: Expansion | None = None
    """About (X, U), where it is known already."""


def init(problem: OptimalControlProblem, U: np.ndarray, options: DdpOptions) -> DdpIterate:
    """The first guess U (N, nu), rolled out. Raises LabError if its shape does not fit."""
    N, nu, nx = problem.N, problem.dynamics.nu, problem.dynamics.nx
    if U.shape != (N, nu):
        raise LabError(f"the first guess has shape {U.shape}; N controls here are ({N}, {nu})")
    guess, gains = np.array(U, dtype=float), np.zeros((N, nu, nx))
    X, U, cost = rollout(problem, np.zeros((N + 1, nx)), guess, gains)
    diverged = f"The first guess diverges at step {diverges_at(X)} of {N}; start from another."
    stopped = "" if np.isfinite(cost) else diverged
    return DdpIterate(X, U, cost, np.zeros((N, nu)), gains, options.mu, stopped=stopped)


def step(problem: OptimalControlProblem, options: DdpOptions, at: DdpIterate) -> DdpIterate:
    """One iteration: expansion, backward pass, line search. What has stopped stays as it is."""
    return run_to_completion(resumable_step(problem, options, at))


def resumable_step(
    problem: OptimalControlProblem, options: DdpOptions, at: DdpIterate
) -> Resumable[DdpIterate]:
    """The same, pausing between pieces of some milliseconds."""
    if at.stopped:
        return at
    seconds = {"derivatives": 0.0, "backward": 0.0, "forward": 0.0}
    model = at.model
    if model is None:
        expansion = expand(problem, at.X, at.U, options.second_order)
        model = yield from timed(expansion, seconds, "derivatives")
    begun = perf_counter()
    allowed = regularisation(model, options.mu_factor, options.mu_limit)
    found = _direction(problem, options, allowed, model, at)
    at = replace(
        at,
        w=found.w,
        K=found.K,
        mu=found.mu,
        iteration=at.iteration + 1,
        gradient=gradient_norm(problem, model, at.U),
        expected=found.d_1 + 0.5 * found.d_2,
        actual=0.0,
        alpha=0.0,
        model=model,
    )
    seconds["backward"] = perf_counter() - begun
    if found.failed:
        at = replace(at, stopped=found.failed)
    elif at.mu == 0.0 and -at.expected <= options.tolerance * abs(at.cost):
        at = replace(at, converged=True, stopped=_convergence_message(at))
    else:
        search = _line_search(problem, options, allowed, at, found.d_1, found.d_2)
        at = yield from timed(search, seconds, "forward")
        if not at.stopped and at.iteration >= options.iterations:
            at = replace(at, stopped=_iteration_limit_message(at))
    return replace(at, seconds=seconds)


def solve(
    problem: OptimalControlProblem, U: np.ndarray, options: DdpOptions | None = None
) -> DdpIterate:
    """Iterates from the first guess U (N, nu) until it stops."""
    options = options or DdpOptions()
    at = init(problem, U, options)
    while not at.stopped:
        at = step(problem, options, at)
    return at


class Direction(NamedTuple):
    """What a backward pass found, the mu it needed, and why there is none."""

    w: np.ndarray
    K: np.ndarray
    mu: float
    d_1: float = 0.0
    d_2: float = 0.0
    failed: str = ""


def _direction(
    problem: OptimalControlProblem,
    options: DdpOptions,
    allowed: Regularisation,
    model: Expansion,
    at: DdpIterate,
) -> Direction:
    w, K = np.empty_like(at.w), np.empty_like(at.K)
    low = high = np.empty((0, 0))
    if problem.bound is not None:
        low, high = -problem.bound - at.U, problem.bound - at.U
        low[-low <= AT_BOUND * problem.bound] = 0.0
        high[high <= AT_BOUND * problem.bound] = 0.0

    def sweep(mu: float) -> tuple[int, float, float]:
        return backward_pass(model.A, model.B, model.second, *model.cost, mu, low, high, w, K)

    mu = at.mu
    while True:
        where, d_1, d_2 = sweep(mu)
        if where < 0:
            break
        mu = allowed.increase(mu)
        if mu > allowed.limit:
            why = (
                f"Failed: Q_uu is not positive definite at step {where}, even with mu at its "
                f"limit of {allowed.limit:.0e}. Raise R, or leave out the second derivatives."
            )
            return Direction(at.w, at.K, mu, failed=why)
    if mu > 0.0 and -d_1 - 0.5 * d_2 <= options.tolerance * abs(at.cost):
        if at.refused:
            why = (
                "Failed: the line search is exhausted: with small mu no step lowers the cost "
                f"enough (c_1 = {options.c1:g}), and with mu = {mu:.0e} none is worth taking. "
                "Lower c_1, or start from another first guess."
            )
            return Direction(at.w, at.K, at.mu, failed=why)
        # Is little expected because the end is near, or because mu holds w down?
        where, d_1_free, d_2_free = sweep(0.0)
        if where < 0:
            return Direction(w, K, 0.0, d_1_free, d_2_free)
        slope = gradient_norm(problem, model, at.U) * float(np.abs(at.U).max())
        if slope <= np.sqrt(options.tolerance) * abs(at.cost):
            why = (
                f"Failed: the gradient vanishes, but the cost curves downward at step {where}: "
                "this is not a minimum. Start from another first guess."
            )
            return Direction(at.w, at.K, at.mu, failed=why)
        sweep(mu)
    return Direction(w, K, mu, d_1, d_2)


def _line_search(
    problem: OptimalControlProblem,
    options: DdpOptions,
    allowed: Regularisation,
    at: DdpIterate,
    d_1: float,
    d_2: float,
) -> Resumable[DdpIterate]:
    """The line search, and mu for the next iteration."""
    more = allowed.increase(at.mu)
    diverged = 0
    for k in range(MAX_HALVINGS + 1):
        alpha = 0.5**k
        expected = alpha * d_1 + 0.5 * alpha**2 * d_2
        X, U, cost = rollout(problem, at.X, at.U + alpha * at.w, at.K)
        diverged += not np.isfinite(cost)
        yield
        unseen = max(abs(expected), abs(cost - at.cost)) <= ROUNDING * abs(at.cost)
        ratio = 1.0 if unseen else (cost - at.cost) / expected
        if expected < 0.0 and ratio > options.c1:
            return replace(
                at,
                X=X,
                U=U,
                cost=cost,
                mu=allowed.decrease(at.mu) if ratio >= options.c2 else more,
                alpha=alpha,
                expected=expected,
                actual=cost - at.cost,
                refused=False,
                model=None,
            )
    if more <= allowed.limit:
        return replace(at, mu=more, refused=at.refused or at.mu == 0.0)
    why = (
        "every rollout along it diverges"
        if diverged > MAX_HALVINGS
        else f"none of {MAX_HALVINGS + 1} step lengths lowers the cost enough "
        f"(c_1 = {options.c1:g})"
    )
    return replace(
        at,
        stopped=f"Failed: the line search is exhausted: {why}, with mu at its limit of "
        f"{allowed.limit:.0e}. Lower c_1, or start from another first guess.",
    )


def _iteration_limit_message(at: DdpIterate) -> str:
    return (
        f"Stopped short after {at.iteration} iterations: the last one changed the cost by "
        f"{at.actual:.1e}. Solve again from here to go on."
    )


def _convergence_message(at: DdpIterate) -> str:
    return (
        f"Converged after {at.iteration} iteration{'s'[: at.iteration != 1]}: a further step "
        f"would lower the cost by {abs(at.expected):.1e} of {at.cost:.4g}."
    )
