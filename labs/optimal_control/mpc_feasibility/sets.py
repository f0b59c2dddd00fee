"""The sets of a setting as polygons, and the growth of the admissible set step by step."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from labs.algorithms import admissible_set
from labs.algorithms.invariant_sets import (
    backward_reachable,
    feasible_sets,
    inclusion_violation,
    maximal_control_invariant_set,
)
from labs.algorithms.polygons import area, clip, vertices
from labs.optimal_control.mpc_feasibility.problem import FeasibilitySettings, feasibility
from labs.problems.polyhedron import Polyhedron

LIMIT_NAMES = ("x₁ ≤ p_max", "x₂ ≤ v_max", "-x₁ ≤ p_max", "-x₂ ≤ v_max", "u ≤ u_max", "-u ≤ u_max")
"""Of the regulated system, in the order of its rows."""


@dataclass(frozen=True, eq=False)
class Sets:
    """Polygons (k, 2) of z; none where U alone limits, which leaves the whole plane."""

    chain: tuple[np.ndarray, ...]
    """X_0 ... X_N; without a terminal set X_0 ... X_(N-1)."""
    terminal: np.ndarray | None
    invariant: np.ndarray
    """The maximal control invariant set within X, which is C_inf."""
    rows: tuple[Polyhedron, Polyhedron] | None
    """X_0 and C_inf by rows of length 1 in natural units."""
    excess: float
    """How far X_f reaches out of those states from which X_f is reached in a step: at most 0 if it
    is control invariant. In natural units; NaN without one."""
    feasible_share: float
    """Of C_inf's area, that lies in X_0."""
    dead_end_share: float
    """Of X_0's area, that lies outside C_inf; NaN where X_0 has none."""
    leak_share: float
    """Area of X_1 outside X_0, as a share of X_0's; 0 where every plan leads to where there is a
    next one. NaN likewise."""
    infeasible_regions: tuple[np.ndarray, ...]
    """What of X_0 or X_1 lies outside C_inf or X_0: where there is no plan, now or later."""


@lru_cache(maxsize=16)
def compute_sets(setup: FeasibilitySettings) -> Sets:
    """All that is drawn and measured of the sets."""
    at = feasibility(setup)
    problem = at.problem
    largest = maximal_control_invariant_set(problem.A, problem.B, at.box, problem.control_set).set
    invariant = vertices(largest)
    if not setup.state_limits:
        return Sets((), None, invariant, None, np.nan, 1.0, 0.0, 0.0, ())
    sets = feasible_sets(problem, setup.holds)
    chain = tuple(vertices(each) for each in (sets if problem.terminal_set else sets[:-1]))
    ahead = vertices(sets[1].intersection(at.box))
    outside = subtract_polyhedron(chain[0], largest), subtract_polyhedron(ahead, sets[0])
    inside, first, whole = area(clip(chain[0], largest)), area(chain[0]), area(invariant)
    dead, leak = (sum(area(piece) for piece in pieces) for pieces in outside)
    return Sets(
        chain=chain,
        terminal=None if problem.terminal_set is None else chain[-1],
        invariant=invariant,
        rows=(_in_natural_units(sets[0], setup), _in_natural_units(largest, setup)),
        excess=_excess(setup, problem.terminal_set),
        feasible_share=inside / whole if whole > 0.0 else 0.0,
        dead_end_share=dead / first if first > 0.0 else np.nan,
        leak_share=leak / first if first > 0.0 else np.nan,
        infeasible_regions=(*outside[0], *outside[1]),
    )


def _excess(setup: FeasibilitySettings, terminal: Polyhedron | None) -> float:
    if terminal is None:
        return np.nan
    problem = feasibility(setup).problem
    everywhere = Polyhedron(np.zeros((0, 2)), np.zeros(0))
    before = backward_reachable(problem.A, problem.B, everywhere, problem.control_set, terminal)
    return inclusion_violation(_in_natural_units(terminal, setup), _in_natural_units(before, setup))


def subtract_polyhedron(polygon: np.ndarray, polyhedron: Polyhedron) -> list[np.ndarray]:
    """The polygon without the polyhedron, in convex pieces: each beyond one row and within those
    before it."""
    pieces = []
    for H, h in zip(polyhedron.H, polyhedron.h, strict=True):
        if not (polygon @ H > h).any():
            continue
        piece = clip(polygon, Polyhedron(-H[None], np.array([-h])))
        polygon = clip(polygon, Polyhedron(H[None], np.array([h])))
        if len(piece) >= 3:
            pieces.append(piece)
    return pieces


def _in_natural_units(polyhedron: Polyhedron, setup: FeasibilitySettings) -> Polyhedron:
    """Of z in natural units, by rows of length 1."""
    H = polyhedron.H * np.array(feasibility(setup).system.x_max)
    length = np.linalg.norm(H, axis=1)
    length = np.where(length > 0.0, length, 1.0)
    return Polyhedron(H / length[:, None], polyhedron.h / length)


def signed_distance(polyhedron: Polyhedron, z: np.ndarray) -> float:
    """How far z (2,) is from the nearest row, in the rows' units; negative outside."""
    return float((polyhedron.h - polyhedron.H @ z).min(initial=np.inf))


@dataclass(frozen=True, eq=False)
class AdmissibleSetGrowth:
    """The admissible set as far as the linear programmes have come."""

    corners: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    """(k, 2) z: those of O_0, then of O_1, ... O_t."""
    counts: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    """(t + 1,) how many each has."""
    J: np.ndarray = field(default_factory=lambda: np.zeros((0, len(LIMIT_NAMES))))
    """(steps, limits) J_i*, as a share of the limit, over O_0, O_1, ..."""
    found: bool = False

    @property
    def polygons(self) -> tuple[np.ndarray, ...]:
        """O_0 ... O_t, each (k, 2) of z."""
        if not len(self.counts):
            return ()
        return tuple(np.split(self.corners, np.cumsum(self.counts)[:-1]))


def grow_admissible_set(
    setup: FeasibilitySettings,
) -> Iterator[tuple[AdmissibleSetGrowth, str] | None]:
    """One snapshot a step of the notes' algorithm, with why it stopped; None within one."""
    at = feasibility(setup)
    limits = at.regulated_limits
    if limits is None:
        yield (
            AdmissibleSetGrowth(),
            "There is no admissible set: the goal is no rest within U and X.",
        )
        return
    step = admissible_set.init(limits)
    polygons, J = [vertices(step.set) + at.goal], np.zeros((0, len(LIMIT_NAMES)))
    while not step.done:
        step = yield from admissible_set.resumable_step(at.closed_loop_matrix, limits, step)
        J = np.vstack([J, step.J])
        if not step.done:
            polygons.append(vertices(step.set) + at.goal)
        corners, counts = np.vstack(polygons), np.array([len(each) for each in polygons])
        yield AdmissibleSetGrowth(corners, counts, J, step.found), step.done and f"{step.done}."
