"""The linear quadratic regulator by dynamic programming (notes, 2.4.1 to 2.4.4).

For the problem of `linear_quadratic.py`, V_t(x) = min over u of the cost of step t + V_(t+1)(x+).
It stays quadratic, V_t(x) = x' P_t x: with P_N = Q_f, backward from t = N - 1,

    K_t = -(R + B' P_(t+1) B)^-1 (B' P_(t+1) A + S')
    P_t = Q + A' P_(t+1) A + (A' P_(t+1) B + S) K_t.

Linear and constant terms are carried by the augmented state (x, 1). One step takes some
4 n^2 (n + m) operations (`riccati_recursion`), so N steps take O(N).

As t decreases P_t usually converges to P_s (2.4.2), the fixed point of this map, the discrete
algebraic Riccati equation.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from labs.algorithms.riccati_recursion import backward_pass, iterate
from labs.algorithms.stabilizability import require_detectable, require_stabilizable
from labs.errors import LabError
from labs.problems.linear_quadratic import LqrPolicy, LqrProblem

RICCATI_TOLERANCE = 1e-6
"""What SciPy's P may change in one more step, as a share of it, to count as a solution."""


def solve(problem: LqrProblem) -> LqrPolicy:
    """The optimal policy with its value at every step. Raises LabError where P leaves the range
    of numbers, as it does over long horizons where (A, B) is not stabilizable."""
    n, m, steps = problem.n, problem.m, problem.horizon
    terms = problem.terms if problem.homogeneous else problem.augmented()
    size = n if problem.homogeneous else n + 1
    gains, values = np.zeros((steps, m, size)), np.zeros((steps + 1, size, size))
    values[steps] = terms["q_final"][0]
    # Compiled for one layout of memory: another one would be compiled while somebody waits.
    a, b, q, r, s = (np.ascontiguousarray(terms[name]) for name in "abqrs")
    failed = backward_pass(a, b, q, r, s, values, gains)
    if failed >= 0:
        raise LabError(
            f"P grows beyond all numbers {steps - failed} steps before the end of N = {steps}: "
            "shorten the horizon, or give B a grip on what grows"
        )
    if problem.homogeneous:
        nothing = np.zeros((steps, m)), np.zeros((steps + 1, n)), np.zeros(steps + 1)
        return LqrPolicy(gains, values, *nothing)
    return LqrPolicy(
        gains=gains[:, :, :n].copy(),
        values=values[:, :n, :n].copy(),
        offsets=gains[:, :, n].copy(),
        linear=values[:, :n, n].copy(),
        constants=values[:, n, n].copy(),
    )


@dataclass(frozen=True, eq=False)
class SteadyState:
    """The policy u = K x for ever, its value x' P x, and how it was found."""

    gain: np.ndarray
    """K (m, n)."""
    value: np.ndarray
    """P (n, n), symmetric."""
    iterations: int
    """Steps of the recursion; 0 where SciPy solved the equation itself."""
    residual: float
    """Change of P in one more step, as a share of P: the largest |dP_ij| / sqrt(P_ii P_jj), which
    is the same in all units of the coordinates."""
    radius: float
    """Spectral radius of A + B K."""
    trouble: str = ""
    """Empty where P solves its equation and K stabilises, else a sentence."""


def steady_state(
    a: np.ndarray,
    b: np.ndarray,
    q: np.ndarray,
    r: np.ndarray,
    tolerance: float = 1e-13,
    most: int = 100_000,
) -> SteadyState:
    """Iterates the recursion from P = Q, at most `most` times, until a step changes no P_ij by more
    than `tolerance` of sqrt(P_ii P_jj) and K stabilises: along a mode that grows slowly and costs
    next to nothing, P rests for long near zero. A (n, n), B (n, m), Q (n, n), R (m, m). Raises
    LabError where there is no steady state: (A, B) is not stabilizable, or Q does not see a mode
    that does not decay."""
    terms = _steady_state_terms(a, b, q, r)
    values, gain = np.stack([q, q]).astype(float), np.zeros(b.T.shape)
    iterations, more, residual, radius = 0, most, np.inf, np.inf
    while more > 0:
        count, residual = iterate(*terms, values, gain, tolerance, more)
        iterations += count
        radius = _spectral_radius(a + b @ gain)
        if radius < 1.0 or not np.isfinite(residual):
            break
        # It rests and does not stabilise: onwards, blindly, for as many steps again.
        blind = min(iterations, most - iterations)
        if blind > 0:
            iterate(*terms, values, gain, -1.0, blind)
        iterations += blind
        more = most - iterations
    trouble = ""
    if not np.isfinite(residual):
        trouble = (
            f"After {iterations} steps the recursion breaks off: R + B' P B is not positive "
            "definite to the last digit. Bring the weights closer together."
        )
    elif not residual <= tolerance:
        trouble = (
            f"After {iterations} steps of the recursion P still changes by {residual:.1e} of its "
            "size a step: allow more of them, or make the loop faster by raising Q or lowering R."
        )
    elif not radius < 1.0:
        trouble = _unstable_message(radius)
    return SteadyState(gain, values[0].copy(), iterations, residual, radius, trouble)


def steady_state_by_scipy(
    a: np.ndarray, b: np.ndarray, q: np.ndarray, r: np.ndarray
) -> SteadyState:
    """The same by SciPy, from the eigenvectors of the extended symplectic pencil. K is that of one
    more step of the recursion. Raises LabError as `steady_state` does, and where SciPy finds no
    solution."""
    terms = _steady_state_terms(a, b, q, r)
    try:
        p = solve_discrete_are(a, b, q, r)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise LabError(
            f"SciPy does not solve the Riccati equation ({error}): bring the weights closer "
            "together, or the step away from zero"
        ) from None
    values, gain = np.stack([p, p]), np.zeros(b.T.shape)
    residual = iterate(*terms, values, gain, 0.0, 1)[1]
    radius, trouble = _spectral_radius(a + b @ gain), ""
    if not residual <= RICCATI_TOLERANCE:
        trouble = (
            f"SciPy's P does not solve the Riccati equation: one more step of the recursion "
            f"changes it by {residual:.1e} of its size. Iterate the recursion, or bring the "
            "weights closer together."
        )
    elif not radius < 1.0:
        trouble = _unstable_message(radius)
    return SteadyState(gain, p, 0, residual, radius, trouble)


def prepare() -> None:
    """Compiles both recursions."""
    one = np.eye(1)
    solve(LqrProblem(1, one, one, one, one, one))
    steady_state(one, one, one, one)


def _spectral_radius(loop: np.ndarray) -> float:
    """The spectral radius."""
    return float(np.abs(np.linalg.eigvals(loop)).max()) if np.isfinite(loop).all() else np.inf


def _unstable_message(radius: float) -> str:
    return (
        "P solves the Riccati equation, but its gain does not stabilise: A + B K has an "
        f"eigenvalue of magnitude {radius:.9g}. Raise the weight of what does not decay."
    )


def _steady_state_terms(
    a: np.ndarray, b: np.ndarray, q: np.ndarray, r: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, B, Q, R and S = 0 as stacks of one, checked for a steady state."""
    problem = LqrProblem(1, a, b, q, r, q)
    require_stabilizable(a, b)
    require_detectable(a, q)
    terms = problem.terms
    return terms["a"], terms["b"], terms["q"], terms["r"], terms["s"]
