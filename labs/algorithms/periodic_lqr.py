"""The regulator of a problem that repeats, and what it does with a limited preview (notes, 2.4.3
to 2.4.5).

Where every term of the problem of `linear_quadratic.py` returns after M steps, a lap, K_t and k_t
do too once the end is far away. With P_0 and p_0 from one lap put in place of those at its end,
lap after lap, they settle: the cost-to-go is x' P_t x + 2 p_t' x plus a constant that grows by
v_0 - v_M, the cost of a lap.

P_t and K_t do not depend on the linear terms c, q and s. They enter through

    p_t = q + K_t' s + (A + B K_t)' (p_(t+1) + P_(t+1) c_t)
    k_t = -(R + B' P_(t+1) B)^-1 (B' (p_(t+1) + P_(t+1) c_t) + s),

so what happens j steps from now reaches k_t through the product of j matrices (A + B K)', which
decays. Somebody who knows the next N steps only takes p_(t+N) = 0.
"""

from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms.riccati import solve
from labs.algorithms.riccati_recursion import relative_change
from labs.errors import LabError
from labs.problems.linear_quadratic import LqrPolicy, LqrProblem

TOLERANCE, MAX_LAPS = 1e-9, 400
"""Laps end when P_0 and p_0 change by less than this share; how many."""


@dataclass(frozen=True, eq=False)
class PeriodicRegulator:
    """The policy for ever, over one lap."""

    problem: LqrProblem
    """One lap."""
    policy: LqrPolicy
    """K_t and k_t for t < M; P_t and p_t with those at M equal to those at 0."""
    laps: int
    """It took to settle."""
    residual: float
    """Change in the last lap: the larger of |dP_ij| / sqrt(P_ii P_jj), and of |dp_i| / sqrt(P_ii)
    as a share of the largest |p_i| / sqrt(P_ii). Neither depends on the units of x."""
    radius: float
    """Spectral radius of a lap, of the product of all A + B K."""

    @property
    def lap_cost(self) -> float:
        """v_0 - v_M: the cost of a lap, once settled, under this policy."""
        return float(self.policy.constants[0] - self.policy.constants[-1])


def solve_periodic(lap: LqrProblem) -> PeriodicRegulator:
    """The policy for a lap that repeats for ever; its terminal terms do not matter. Raises
    LabError where it does not settle, or settles on one that does not stabilise."""
    p, linear, radius = lap.terms["q"][0], np.zeros(lap.n), np.inf
    for laps in range(1, MAX_LAPS + 1):
        policy = solve(replace(lap, q_final=p, q_final_linear=linear, constant_final=0.0))
        residual = max(
            relative_change(policy.values[0], p),
            _linear_change(policy.linear[0], linear, policy.values[0]),
        )
        if residual < TOLERANCE:
            radius = _lap_spectral_radius(lap, policy)
            if radius < 1.0:
                return PeriodicRegulator(lap, policy, laps, residual, radius)
        p, linear = policy.values[0], policy.linear[0]
    if residual < TOLERANCE:
        raise LabError(
            f"after {MAX_LAPS} laps the regulator rests, but what it regulates grows by a factor "
            f"of {radius:.6g} a lap: put a weight on what does not decay"
        )
    raise LabError(
        f"after {MAX_LAPS} laps the regulator still changes by {residual:.1e} of its size a lap: "
        "raise the weight of what moves slowly, or give B a grip on it"
    )


def preview_problem(
    known: PeriodicRegulator, start: int, steps: int
) -> tuple[LqrProblem, LqrPolicy]:
    """The problem of the next `steps` from step `start` of the lap, which costs x' P x at its
    end, and its policy. With `steps` = 0 nothing is known of c, q and s: a problem of one step
    without them, k = 0."""
    lap, horizon = known.problem, max(steps, 1)
    m = lap.horizon
    index = (start + np.arange(horizon)) % m
    shown = 1.0 if steps > 0 else 0.0
    c, q_linear, s_linear = (shown * term[index % len(term)] for term in _inhomogeneous_terms(lap))
    window = LqrProblem(
        horizon=horizon,
        a=_index_term(lap.a, index),
        b=_index_term(lap.b, index),
        q=_index_term(lap.q, index),
        r=_index_term(lap.r, index),
        q_final=known.policy.values[(start + horizon) % m],
        c=c,
        q_linear=q_linear,
        s_linear=s_linear,
    )
    return window, solve(window)


def _inhomogeneous_terms(problem: LqrProblem) -> tuple[np.ndarray, ...]:
    """The terms that make a problem inhomogeneous."""
    return tuple(problem.terms[name] for name in ("c", "q_linear", "s_linear"))


def _index_term(term: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Of a term that may be one for all steps."""
    return term[index] if term.ndim == 3 else term


def _linear_change(new: np.ndarray, old: np.ndarray, p: np.ndarray) -> float:
    """Largest change of the linear term, its entries in units of sqrt(P_ii), as a share of the
    largest."""
    size = np.sqrt(np.maximum(p.diagonal(), 0.0))
    units = np.where(size > 0.0, size, 1.0)
    largest = float(np.abs(new / units).max())
    change = float(np.abs((new - old) / units).max())
    return change / largest if largest > 0.0 else change


def _lap_spectral_radius(lap: LqrProblem, policy: LqrPolicy) -> float:
    """The spectral radius of a lap under the policy."""
    a, b, turn = lap.terms["a"], lap.terms["b"], np.eye(lap.n)
    for t, gain in enumerate(policy.gains):
        turn = (a[t % len(a)] + b[t % len(b)] @ gain) @ turn
    return float(np.abs(np.linalg.eigvals(turn)).max())
