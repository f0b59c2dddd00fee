"""What is measured besides: the gradient in three ways, and the errors of the integration."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from labs.algorithms.shooting_steps import COST_FORMS, SHOOTING_METHODS, CostForm
from labs.algorithms.single_shooting import SingleShooting
from labs.optimal_control.single_shooting.params import SingleShootingParams
from labs.optimal_control.single_shooting.plan import ShootingPlan
from labs.resumable import Resumable, timed

GRADIENT_METHODS = ("sensitivities", "adjoint", "differences")
"""To a gradient, as they are timed."""
TIMED_PIECES = (5, 10, 20, 40)
"""N they are timed at."""
REPEATS = 3
"""Of which the shortest counts; of the differences one is enough."""
COMPARED_PIECES = 8
"""N at which their errors are measured."""
DIFFERENCE_STEPS = 10.0 ** np.arange(-11.0, 0.0)
"""eps of the finite differences."""
INTEGRATION_STEPS = (1, 2, 4, 8, 16, 32)
"""M at which errors are measured."""
REFERENCE_STEPS = 100
"""M of the motion they are errors from, by RK4."""


@dataclass(frozen=True)
class AccuracyStudy:
    """Plain data; what was not asked for has no rows. All errors are relative to the truth."""

    gradient_errors: np.ndarray
    """(len(DIFFERENCE_STEPS), 2) of forward and central differences from the adjoint gradient."""
    sensitivities_error: float
    """Of the gradient by sensitivities from the adjoint one."""
    state_errors: np.ndarray
    """(len(INTEGRATION_STEPS), len(SHOOTING_METHODS)): |x(T) - exact|, each method's."""
    cost_errors: np.ndarray
    """(len(INTEGRATION_STEPS), 2): of J by the augmented state, and by the notes' sum."""


NO_STUDY = AccuracyStudy(
    np.zeros((0, 2)), 0.0, np.zeros((0, len(SHOOTING_METHODS))), np.zeros((0, 2))
)


def study_gradients(
    params: SingleShootingParams, seconds: dict[str, float | np.ndarray]
) -> Resumable[AccuracyStudy]:
    """At the first guess, which must not diverge: errors over eps, and in `seconds` the times
    over N by the names of GRADIENT_METHODS."""
    shooting = params.transcription(COMPARED_PIECES, params.M, params.integrator)
    y = shooting.pack(params.first_guess(shooting.N))
    at = shooting.linearize(y)
    exact = shooting.gradient_by_adjoint(y, at)
    size = np.linalg.norm(exact) or 1.0
    same = shooting.gradient_by_sensitivities(y, at, shooting.sensitivities(at))
    errors = np.empty((len(DIFFERENCE_STEPS), 2))
    for i, eps in enumerate(DIFFERENCE_STEPS):
        forward = yield from shooting.gradient_by_differences(y, eps, "forward")
        central = yield from shooting.gradient_by_differences(y, eps, "central")
        errors[i] = np.linalg.norm([forward - exact, central - exact], axis=1) / size
    times = np.empty((len(TIMED_PIECES), len(GRADIENT_METHODS)))
    for i, N in enumerate(TIMED_PIECES):
        times[i] = yield from _time_gradients(params, N)
    seconds |= dict(zip(GRADIENT_METHODS, times.T, strict=True))
    off = float(np.linalg.norm(same - exact) / size)
    finite = np.where(np.isfinite(errors), errors, 0.0)
    return AccuracyStudy(finite, off, NO_STUDY.state_errors, NO_STUDY.cost_errors)


def study_integration(params: SingleShootingParams, plan: ShootingPlan) -> Resumable[AccuracyStudy]:
    """Of the plan's controls: errors over M, zero where a rollout diverges."""

    def run(M: int, integrator: str, form: CostForm) -> tuple[np.ndarray, float]:
        shooting = params.transcription(plan.N, M, integrator, form)
        y = shooting.pack(plan.U, plan.T)
        return shooting.rollout(y).X[-1], shooting.cost(y)

    exact, J = run(REFERENCE_STEPS, "rk4", "augmented")
    state_errors, cost_errors = [], []
    for M in INTEGRATION_STEPS:
        yield
        state_errors.append(
            [np.linalg.norm(run(M, method, "sum")[0] - exact) for method in SHOOTING_METHODS]
        )
        yield
        costs = [run(M, params.integrator, form)[1] for form in COST_FORMS]
        cost_errors.append(np.abs(np.array(costs) - J) / abs(J or 1.0))
    errors = [np.where(np.isfinite(e), e, 0.0) for e in (state_errors, cost_errors)]
    return AccuracyStudy(NO_STUDY.gradient_errors, 0.0, errors[0], errors[1])


def _time_gradients(params: SingleShootingParams, N: int) -> Resumable[np.ndarray]:
    """(len(GRADIENT_METHODS),) [s] of one gradient at the first guess, its rollout with it."""
    y = params.transcription(N, params.M, params.integrator).pack(params.first_guess(N))

    def by_sensitivities(shooting: SingleShooting) -> None:
        at = shooting.linearize(y)
        shooting.gradient_by_sensitivities(y, at, shooting.sensitivities(at))

    def by_adjoint(shooting: SingleShooting) -> None:
        shooting.gradient_by_adjoint(y, shooting.linearize(y))

    times = []
    for way in (by_sensitivities, by_adjoint):
        repeated = []
        for _ in range(REPEATS):
            yield
            shooting = params.transcription(N, params.M, params.integrator)
            begun = perf_counter()
            way(shooting)
            repeated.append(perf_counter() - begun)
        times.append(min(repeated))
    shooting, seconds = params.transcription(N, params.M, params.integrator), {"all": 0.0}
    yield from timed(shooting.gradient_by_differences(y, 1e-6, "forward"), seconds, "all")
    return np.array([*times, seconds["all"]])
