"""The assumptions of the theorem of stability (notes, 2.5.3), each with a number that decides it.

1. f(0, 0) = 0, l(0, 0) = 0, l_f(0) = 0.
2. X x U is closed, X_f closed and bounded.
3. (a) From each x in X_f some u in U leads to x+ in X_f with l_f(x+) - l_f(x) <= -l(x, u);
   (b) l(x, u) >= a_1 |x|^2 and l_f(x) <= a_f |x|^2 with a_1, a_f > 0.

The worst x of 3 (a) is sought among the vertices of X_f and points in between: with one control,
what of U leads into X_f is an interval, and the best u of it is where a parabola is least.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from labs.algorithms.polygons import UnboundedError, area, vertices
from labs.optimal_control.mpc_stability.formulation import Formulation
from labs.problems.polyhedron import Polyhedron

RAYS, RINGS = 60, 12
"""Points of X_f that are tried: so many towards each of so many points of its edge."""
ROUNDING = 1e-7
"""What counts as zero."""


@dataclass(frozen=True, eq=False)
class Assumptions:
    """Whether each holds, with its number."""

    at_origin: float
    """1: the largest of |f(0, 0)|, |l(0, 0)|, |l_f(0)|."""
    terminal_area: float
    """2: of X_f in its plane; inf: unbounded."""
    invariance: float
    """3 (a): the share of X_f from which no u in U leads into X_f."""
    decrease: float
    """3 (a): the largest l_f(x+) - l_f(x) + l(x, u), u the best that leads into X_f."""
    stage_bound: float
    """3 (b): the largest a_1; negative where l is."""
    terminal_bound: float
    """3 (b): the least a_f."""

    @property
    def hold(self) -> tuple[bool, bool, bool, bool]:
        """1, 2, 3 (a) and 3 (b)."""
        return (
            self.at_origin <= ROUNDING,
            bool(np.isfinite(self.terminal_area)),
            self.invariance == 0.0 and self.decrease <= ROUNDING,
            self.stage_bound > 0.0,
        )


@lru_cache(maxsize=64)
def check_assumptions(formulation: Formulation) -> Assumptions:
    """By matrices and by trial."""
    p, settings = formulation.problem, formulation.settings
    x = _test_points(formulation)
    share, decrease = _terminal_decrease(formulation, x)
    least = float(np.linalg.eigvalsh(p.Q)[0]) / 2.0
    economic = settings.task == "economic" and settings.price > 0.0
    return Assumptions(
        at_origin=0.0 if p.c is None else float(np.abs(p.c).max()),
        terminal_area=_area(formulation.problem.terminal_set),
        invariance=share,
        decrease=decrease,
        # l(0, u) = r u^2 / 2 + c u is least, -c^2 / (2 r), at u = -c / r.
        stage_bound=-(settings.price**2) / (2.0 * settings.r) if economic else least,
        terminal_bound=float(np.linalg.eigvalsh(p.Q_f)[-1]) / 2.0,
    )


def _area(end: Polyhedron | None) -> float:
    try:
        return np.inf if end is None else area(vertices(end))
    except UnboundedError:
        return np.inf


def _test_points(formulation: Formulation) -> np.ndarray:
    """(k, 2) points of X_f, or of what is looked at where there is no X_f: around the origin."""
    end = formulation.problem.terminal_set
    if end is not None and not end.h.any():
        return np.zeros((1, 2))
    around = formulation.window if end is None else end
    angles = np.linspace(0.0, 2.0 * np.pi, RAYS, endpoint=False)
    edge = boundary_points(around, angles, np.array(formulation.system.x_max))
    if end is not None and len(formulation.terminal_polygon):
        edge = np.vstack([edge, formulation.terminal_polygon])
    rings = np.linspace(0.0, 1.0, RINGS + 1)
    return np.asarray((rings[:, None, None] * edge).reshape(-1, 2))


def boundary_points(around: Polyhedron, angles: np.ndarray, units: np.ndarray) -> np.ndarray:
    """(k, 2): how far the set reaches from the origin, which lies in it, at angles (k,) in the
    given units (2,)."""
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1) * units
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = around.h / (ways @ around.H.T)
    reach = np.where(ways @ around.H.T > 0.0, reach, np.inf).min(axis=1)
    return np.asarray(ways * reach[:, None])


def _terminal_decrease(formulation: Formulation, x: np.ndarray) -> tuple[float, float]:
    """Of points x (k, 2): the share from which no u leads into X_f, and the largest
    l_f(x+) - l_f(x) + l(x, u) of the others, with the best u."""
    p = formulation.problem
    A, B, end = p.A, p.B, p.terminal_set
    limit = formulation.settings.u_max - abs(formulation.reference.u)
    low, high = np.full(len(x), -limit), np.full(len(x), limit)
    if end is not None:
        grip = (end.H @ B)[:, 0]
        room = end.h + ROUNDING * (1.0 + np.abs(end.h)) - x @ A.T @ end.H.T
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = room / grip
        high = np.minimum(high, np.where(grip > 0.0, ends, np.inf).min(axis=1))
        low = np.maximum(low, np.where(grip < 0.0, ends, -np.inf).max(axis=1))
    possible = low <= high
    if not possible.any():
        return 1.0, np.inf
    x, low, high = x[possible], low[possible], high[possible]
    price = 0.0 if p.r is None else float(p.r[0])
    curvature = float((p.R + B.T @ p.Q_f @ B)[0, 0])
    best = -((x @ A.T) @ p.Q_f @ B)[:, 0] - price
    u = np.clip(best / curvature, low, high)[:, None]
    after = x @ A.T + u @ B.T
    change = 0.5 * (((after @ p.Q_f) * after) - ((x @ p.Q_f) * x)).sum(axis=1)
    return float(1.0 - possible.mean()), float((change + formulation.stage_cost(x, u)).max())


def assumptions_note(formulation: Formulation) -> str:
    """What follows, and the checklist: a line each."""
    if formulation.trouble:
        return formulation.trouble
    found = check_assumptions(formulation)
    marks = ["✓" if holds else "✗" for holds in found.hold]
    size = f"of area {found.terminal_area:.3g}" if found.hold[1] else "unbounded"
    three = (
        f"Change of the terminal cost in a step, plus l: at most {_format_number(found.decrease)}"
    )
    if found.invariance > 0.0:
        three = f"From {found.invariance:.0%} of the terminal set no u leads into it"
    bound = f"l ≥ {_format_number(found.stage_bound)} |x|²"
    if found.stage_bound < 0.0:
        bound = f"l(0, u) ≥ {found.stage_bound:.3g}"
    lines = [
        "All hold: V* is a Lyapunov function on X₀."
        if all(found.hold)
        else "Not all hold: nothing is promised.",
        f"{marks[0]} 1. At the origin f, l and the terminal cost are "
        f"{_format_number(found.at_origin)}.",
        f"{marks[1]} 2. X × U is closed; the terminal set is {size}.",
        f"{marks[2]} 3a. {three}.",
        f"{marks[3]} 3b. {bound}; terminal cost ≤ {_format_number(found.terminal_bound)} |x|².",
    ]
    return "\n".join(lines)


def _format_number(value: float) -> str:
    return "0" if abs(value) <= ROUNDING else f"{value:.3g}"
