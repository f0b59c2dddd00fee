"""What is measured besides, over N: the error of the three rules, and what a Newton step takes with
full matrices and with sparse ones."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from scipy.sparse import block_array, csc_array, eye_array
from scipy.sparse.linalg import splu

from labs.algorithms import sqp
from labs.algorithms.collocation import Collocation
from labs.algorithms.collocation_schemes import SCHEMES
from labs.algorithms.sqp import SqpIterate, SqpOptions
from labs.optimal_control.collocation.params import CollocationParams
from labs.resumable import Resumable
from labs.tasks.direct.guesses import resample_motion
from labs.tasks.direct.motions import collocation_motion
from labs.tasks.direct.trajectory import PiecewiseTrajectory

ORDER_STEPS = (10, 20, 40, 80)
"""N at which errors are measured."""
REFERENCE_STEPS, REFERENCE_SCHEME = 160, "hermite-simpson"
"""Of the solution they are errors from."""
GRID_SIZES = (5, 10, 20, 40, 80, 160)
"""N at which Newton steps are timed."""
MAX_UNKNOWNS = 1000
"""Of a system that is solved with a full matrix."""
REPEATS = 3
"""Of which the shortest counts."""
DAMPING = 1e-6
"""Added to the Hessian's diagonal, so that the system has a solution."""


@dataclass(frozen=True, eq=False)
class ConvergenceStudy:
    """Plain data; what was not asked for has no rows."""

    steps: np.ndarray
    """(k,) N"""
    errors: np.ndarray
    """(k, 3): |J_N - J| / |J| of the three rules; 0 where there is no solution."""
    sizes: np.ndarray
    """(k,) N"""
    entries: np.ndarray
    """(k, 2): of the Newton step's system, all and those that are not zero."""

    @property
    def orders(self) -> np.ndarray:
        """(3,) the slope of each rule's error from its two finest grids; NaN without one."""
        if len(self.steps) < 2 or not (self.errors[-2:] > 0.0).all():
            return np.full(len(SCHEMES), np.nan)
        ratio = np.log(self.errors[-2] / self.errors[-1])
        return np.asarray(ratio / np.log(self.steps[-1] / self.steps[-2]))

    def order_of(self, scheme: str) -> float:
        """That of the rule of this name."""
        return float(self.orders[list(SCHEMES).index(scheme)])


NO_STUDY = ConvergenceStudy(np.zeros(0), np.zeros((0, len(SCHEMES))), np.zeros(0), np.zeros((0, 2)))


def study_order(
    params: CollocationParams, motion: PiecewiseTrajectory
) -> Resumable[ConvergenceStudy]:
    """From the present solution, all solved anew."""
    fine = yield from _solve_transcription(params, REFERENCE_STEPS, REFERENCE_SCHEME, motion)
    if not fine.converged:
        return NO_STUDY
    exact = collocation_motion(params.transcription(REFERENCE_STEPS, REFERENCE_SCHEME), fine)
    J, errors = fine.values.f, np.zeros((len(ORDER_STEPS), len(SCHEMES)))
    for i, N in enumerate(ORDER_STEPS):
        for j, scheme in enumerate(SCHEMES):
            at = yield from _solve_transcription(params, N, scheme, exact)
            if at.converged:
                errors[i, j] = abs(at.values.f - J) / abs(J or 1.0)
    return ConvergenceStudy(np.array(ORDER_STEPS, float), errors, NO_STUDY.sizes, NO_STUDY.entries)


def study_linear_solves(
    params: CollocationParams, motion: PiecewiseTrajectory, seconds: dict[str, float | np.ndarray]
) -> Resumable[ConvergenceStudy]:
    """Near the present solution. Leaves in `seconds` the times of a Newton step's linear system,
    "dense" and "sparse", (k,) [s]."""
    sizes: list[float] = []
    entries, times = [], []
    for N in GRID_SIZES:
        program = params.transcription(N, params.scheme)
        system = yield from _newton_system(program, _initial_variables(params, program, motion))
        if sizes and system.shape[0] > MAX_UNKNOWNS:
            break
        full, right = system.toarray(), np.ones(system.shape[0])
        spent = []
        for _ in range(REPEATS):
            yield
            begun = perf_counter()
            np.linalg.solve(full, right)
            middle = perf_counter()
            splu(system).solve(right)
            spent.append((middle - begun, perf_counter() - middle))
        sizes.append(float(N))
        entries.append((full.size, system.nnz))
        times.append(np.min(spent, axis=0))
    dense, sparse = np.transpose(times)
    seconds |= {"dense": dense, "sparse": sparse}
    return ConvergenceStudy(
        NO_STUDY.steps, NO_STUDY.errors, np.array(sizes), np.array(entries, float)
    )


def slopes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(m,) of y (k, m) over x (k,) on logarithmic axes, from the last two; NaN without them."""
    if len(x) < 2:
        return np.full(y.shape[1], np.nan)
    return np.asarray(np.log(y[-1] / y[-2]) / np.log(x[-1] / x[-2]))


def _solve_transcription(
    params: CollocationParams, N: int, scheme: str, motion: PiecewiseTrajectory
) -> Resumable[SqpIterate]:
    program, options = params.transcription(N, scheme), SqpOptions(tolerance=1e-10, iterations=60)
    at = sqp.init(program, _initial_variables(params, program, motion), options)
    while not at.stopped:
        at = yield from sqp.resumable_step(program, options, at)
        yield
    return at


def _initial_variables(
    params: CollocationParams, program: Collocation, motion: PiecewiseTrajectory
) -> np.ndarray:
    return program.variables(*resample_motion(params, motion, program.N))


def _newton_system(program: Collocation, y: np.ndarray) -> Resumable[csc_array]:
    """[H c_y'; c_y 0], by Gauss-Newton."""
    c_y = program.derivatives(y).c_y
    none = np.zeros(len(program.values(y).g))
    H = yield from program.hessian(y, np.zeros(c_y.shape[0]), none, exact=False)
    damped = H + DAMPING * eye_array(len(y))
    return csc_array(block_array([[damped, c_y.T], [c_y, None]], format="csc"))
