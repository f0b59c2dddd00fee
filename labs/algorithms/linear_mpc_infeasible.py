"""Where linear MPC finds no plan (notes, 2.5.2): the first step at which its limits cannot be met,
and by how much they are exceeded there at least."""

from dataclasses import dataclass

import daqp
import numpy as np

from labs.algorithms.linear_mpc_condensed import SOLVED, CondensedData, CondensedQp
from labs.algorithms.linear_mpc_limits import LIMIT_KINDS, limit_sets, limit_tolerance
from labs.problems.linear_mpc import LinearMpcProblem

DAQP_SETTINGS = {"primal_tol": 1e-9, "dual_tol": 1e-9}
CONTROL_WEIGHT = 1e-6
"""Weight of the controls beside that of the excess."""
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SYMBOLS = {"state": "x", "control": "u", "terminal": "x"}
SET_NAMES = {"state": "X", "control": "U", "terminal": "the terminal set"}


@dataclass(frozen=True)
class Infeasibility:
    """The limits up to step - 1 can be met, those up to `step` cannot."""

    step: int
    """k of x_k."""
    kind: str
    """"state", "control" or "terminal"."""
    row: int
    """Of that set: the one exceeded the most where the sum of squares is least."""
    excess: float
    """By how much, in its unit."""
    limit: str
    """That row as text."""

    def message(self, N: int) -> str:
        """A sentence of what cannot be met and when."""
        much = f"by {self.excess:.2g} at least"
        if self.kind == "control":
            return f"Infeasible: no control meets the limits of U at step {self.step - 1}."
        if self.step == 0:
            return f"Infeasible at once: x₀ is outside X, where {self.limit} is exceeded {much}."
        if self.kind == "terminal":
            return (
                f"Infeasible: the terminal set is out of reach in N = {N} steps; its limit "
                f"{self.limit} is exceeded {much}."
            )
        return (
            f"Infeasible: whatever U allows, {self.limit} is exceeded at step {self.step} of "
            f"N = {N}, {much}."
        )


def first_infeasibility(
    problem: LinearMpcProblem, form: CondensedQp, data: CondensedData, x: np.ndarray
) -> Infeasibility | None:
    """By bisection over the step, each time with the limits up to it alone; None where all can
    be met."""
    shift = form.E @ x
    lower, upper = data.lower - shift, data.upper - shift
    if _feasible(form, lower, upper, form.N):
        return None
    met, broken = -1, form.N
    while broken - met > 1:
        middle = (met + broken) // 2
        if _feasible(form, lower, upper, middle):
            met = middle
        else:
            broken = middle
    joined, excess = _largest_excess(form, lower, upper, broken)
    return _exceeded_limit(problem, form, broken, joined, excess)


def _feasible(form: CondensedQp, lower: np.ndarray, upper: np.ndarray, step: int) -> bool:
    """Whether controls of least norm meet the limits up to this step."""
    rows = form.steps <= step
    if (lower > upper + _slack(upper))[rows].any():
        return False
    fixed, rows = rows & ~form.grip, rows & form.grip
    slack = _slack(upper)[fixed]
    if (upper[fixed] < -slack).any() or (lower[fixed] > slack).any():
        return False
    if not rows.any():
        return True
    size = form.H.shape[0]
    flag = _minimise_norm(np.eye(size), form.G[rows], lower[rows], upper[rows])[1]
    return flag == SOLVED


def _largest_excess(
    form: CondensedQp, lower: np.ndarray, upper: np.ndarray, step: int
) -> tuple[int, float]:
    """The joined row at this step exceeded the most, and by how much (negative: its lower side),
    where those before are met and the sum of squares of the excesses is least."""
    before, here = (form.steps < step) & form.grip, form.steps == step
    controls, slacks = form.H.shape[0], int(here.sum())
    G = np.zeros((int(before.sum()) + slacks, controls + slacks))
    G[: -slacks or None, :controls] = form.G[before]
    G[-slacks:, :controls], G[-slacks:, controls:] = form.G[here], -np.eye(slacks)
    low, high = (np.concatenate([side[before], side[here]]) for side in (lower, upper))
    # An empty pair of limits is exceeded by half its gap on either side.
    low[-slacks:] = np.minimum(low[-slacks:], high[-slacks:])
    weights = np.concatenate([np.full(controls, CONTROL_WEIGHT), np.ones(slacks)])
    z, flag = _minimise_norm(np.diag(weights), G, low, high)
    excess = z[controls:] if flag == SOLVED else np.zeros(slacks)
    worst = int(np.abs(excess).argmax())
    return int(np.flatnonzero(here)[worst]), float(excess[worst])


def _exceeded_limit(
    problem: LinearMpcProblem, form: CondensedQp, step: int, joined: int, excess: float
) -> Infeasibility:
    """Of the joined row, the side that is exceeded."""
    for kind in LIMIT_KINDS:
        steps, size = form.shapes[kind]
        if joined < steps * size:
            break
        joined -= steps * size
    side, limits = form.sides[kind], limit_sets(problem)[kind]
    column = joined % size
    row = int(side.above[column] if excess >= 0.0 else side.below[column])
    text = limit_text(limits.H[row], float(limits.h[row]), SYMBOLS[kind])
    text = text or f"row {row + 1} of {SET_NAMES[kind]}"
    return Infeasibility(step, kind, row, abs(excess), text)


def limit_text(row: np.ndarray, h: float, symbol: str) -> str:
    """row y <= h in words, such as "x₂ ≤ 0.5"; empty where it takes more than two numbers."""
    used = np.flatnonzero(row)
    if len(used) == 1:
        i = int(used[0])
        sign = "≤" if row[i] > 0.0 else "≥"
        return f"{symbol}{_subscript(i)} {sign} {h / row[i] + 0.0:.3g}"
    if len(used) != 2:
        return ""
    i, j = (int(k) for k in used)
    sign = "-" if row[j] < 0.0 else "+"
    first = f"{row[i]:.3g} {symbol}{_subscript(i)}"
    second = f"{abs(row[j]):.3g} {symbol}{_subscript(j)}"
    return f"{first} {sign} {second} ≤ {h:.3g}"


def _subscript(i: int) -> str:
    return str(i + 1).translate(SUBSCRIPTS)


def _minimise_norm(
    H: np.ndarray, G: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[np.ndarray, int]:
    """The least z' H z / 2 within lower <= G z <= upper, with DAQP's exit flag."""
    sense = np.where(upper - lower <= 0.0, 5, 0).astype(np.int32)
    zero = np.zeros(len(H))
    z, _, flag, _ = daqp.solve(
        H, zero, np.ascontiguousarray(G), upper, lower, sense, **DAQP_SETTINGS
    )
    return np.asarray(z), int(flag)


def _slack(upper: np.ndarray) -> np.ndarray:
    return limit_tolerance(np.where(np.isfinite(upper), upper, 0.0))
