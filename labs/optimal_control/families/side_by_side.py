"""The four methods side by side: each does a share in a round, and after the last of them what ties
them together is computed: V's gradients along the optimal motion, and that motion's tail once more.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from labs.algorithms import hjb
from labs.optimal_control.families.closed_form import closed_form
from labs.optimal_control.families.comparison import relative_difference, tail_gaps
from labs.optimal_control.families.global_methods import (
    CostToGoTable,
    PartialTable,
    compute_table,
    final_values,
    follow_gradient,
    follow_table,
)
from labs.optimal_control.families.local_methods import solve_direct, solve_pontryagin
from labs.optimal_control.families.motion import (
    MethodMotion,
    first_guess,
    no_motion,
    stretch_motion,
)
from labs.optimal_control.families.params import FamiliesParams
from labs.optimal_control.families.study import MethodComparison, no_study, run_study
from labs.resumable import Resumable, timed

FAMILY_NAMES = {"hjb": "HJB", "dp": "DP", "pontryagin": "Pontryagin", "direct": "Direct"}
"""Their names: Hamilton-Jacobi-Bellman, dynamic programming, Pontryagin's minimum principle, and
collocation as the direct method."""
GLOBAL_METHODS = ("hjb", "dp")
GAP_NAMES = ("gradient_gap", "multiplier_gap", "tail_gap", "tail_cost_gap")
UNKNOWN_GAP = -1.0
TAIL_SWINGS = (0.0, 1.0)
"""Of first guesses of a tail, besides the one that is set."""


@dataclass(frozen=True, eq=False)
class Results:
    """How far the four have come. Plain data; its arrays are never written into."""

    motions: Mapping[str, MethodMotion]
    """By method."""
    progress: Mapping[str, float]
    """By method, in [0, 1]."""
    values: Mapping[str, np.ndarray]
    """V (n, n) of the two tables: on the way the latest, then that of the moment M."""
    gradients: Mapping[str, np.ndarray]
    """(SAMPLES + 1, 2) of V of the two tables along the optimal motion; else zeros."""
    tail: MethodMotion
    """The motion from the optimal one's state at M on, solved for once more."""
    study: MethodComparison
    gaps: Mapping[str, float]
    """How close the answers are [%]: of V's gradient and of the multipliers to the costate, of the
    tail to the motion and of its cost to the rest of J; UNKNOWN_GAP, where they are."""
    over: bool = False


def no_results(params: FamiliesParams) -> Results:
    """Before anything is done."""
    problem = params.problem(params.x0, params.horizon)
    still, grid = no_motion(problem), params.grid(round(params.nodes))
    values = final_values(params.cost, grid)
    return Results(
        motions=dict.fromkeys(FAMILY_NAMES, still),
        progress=dict.fromkeys(FAMILY_NAMES, 0.0),
        values=dict.fromkeys(GLOBAL_METHODS, values),
        gradients={name: np.zeros_like(still.P) for name in GLOBAL_METHODS},
        tail=still,
        study=no_study(),
        gaps=dict.fromkeys(GAP_NAMES, UNKNOWN_GAP),
    )


def optimal_motion(
    params: FamiliesParams, motions: Mapping[str, MethodMotion]
) -> MethodMotion | None:
    """The optimal motion to measure by: in closed form, or the cheaper of what the local methods
    have converged to, Pontryagin's where they agree."""
    exact = closed_form(params, params.x0, params.horizon)
    if exact:
        return exact
    found = [motions[name] for name in ("pontryagin", "direct") if motions[name].converged]
    if not found:
        return None
    cheapest = min(motion.cost for motion in found)
    return next(m for m in found if m.cost <= cheapest + 0.01 * abs(cheapest))


def solve_side_by_side(
    params: FamiliesParams, before: Mapping[str, MethodMotion], seconds: dict[str, float]
) -> Iterator[Results | None]:
    """Round by round, from the motions `before` where the start is warm; None within a round. Adds
    up in `seconds` what each method takes, that of a table being what it took to make it."""
    at = no_results(params)
    problem = params.problem(params.x0, params.horizon)
    guess = first_guess(problem, params.guess)
    tables: dict[str, CostToGoTable] = {}

    def start(name: str) -> MethodMotion:
        warm = params.start == "warm" and before[name].converged
        return stretch_motion(before[name], params.horizon) if warm else guess

    nodes = round(params.nodes)
    work: dict[str, Iterator[PartialTable | MethodMotion | None]] = {
        "hjb": compute_table(params, "hjb", nodes),
        "dp": compute_table(params, "dp", nodes),
        "pontryagin": _pontryagin(params, start("pontryagin")),
        "direct": solve_direct(problem, start("direct"), round(params.intervals)),
    }
    while work:
        for name in list(work):
            begun = perf_counter()
            share = next(work[name], "end")
            while share is None:
                seconds[name] += perf_counter() - begun
                yield None
                begun = perf_counter()
                share = next(work[name], "end")
            seconds[name] += perf_counter() - begun
            if share == "end":
                del work[name]
                at = _with_entry(at, "progress", name, 1.0)
            elif isinstance(share, MethodMotion):
                at = _with_entry(at, "motions", name, share)
            elif isinstance(share, PartialTable):
                at = _with_entry(
                    _with_entry(at, "values", name, share.V), "progress", name, share.progress
                )
                if share.table:
                    tables[name] = share.table
                    seconds[name] = share.table.seconds
                    yield None
                    motion = yield from timed(
                        _follow_policy(params, name, share.table), seconds, name
                    )
                    at = _with_entry(at, "motions", name, motion)
        yield at
    moment = params.moment * params.horizon
    slices = {name: table.slice_at(moment) for name, table in tables.items()}
    at = replace(at, values=slices)
    optimal = optimal_motion(params, at.motions)
    if optimal:
        along = {}
        for name, table in tables.items():
            along[name] = table.gradients(optimal.X, optimal.t)
            yield None
        tail = yield from _solve_tail(params, optimal)
        at = replace(at, gradients=along, tail=tail)
        at = replace(at, gaps={**at.gaps, **_gaps(params, at, optimal)})
        yield at
        for study in run_study(params, optimal):
            if study:
                at = replace(at, study=study)
            yield at if study else None
    yield replace(at, over=True)


def _with_entry(at: Results, field: str, name: str, value: object) -> Results:
    changed: dict[str, Any] = {field: {**getattr(at, field), name: value}}
    return replace(at, **changed)


def _gaps(params: FamiliesParams, at: Results, optimal: MethodMotion) -> dict[str, float]:
    found = {"gradient_gap": relative_difference(at.gradients["hjb"], optimal.P)}
    direct = at.motions["direct"]
    if direct.converged and direct is not optimal:
        found["multiplier_gap"] = relative_difference(direct.P, optimal.P)
    if at.tail.converged:
        found |= tail_gaps(params, optimal, at.tail)
    return found


def _pontryagin(params: FamiliesParams, guess: MethodMotion) -> Iterator[MethodMotion | None]:
    problem = params.problem(params.x0, params.horizon)
    yield (yield from solve_pontryagin(problem, guess, params.pontryagin))


def _follow_policy(
    params: FamiliesParams, name: str, table: CostToGoTable
) -> Resumable[MethodMotion]:
    problem = params.problem(params.x0, params.horizon)
    if name == "hjb":
        return follow_gradient(problem, table)
    return follow_table(problem, table, hjb.control_levels(problem, round(params.levels)))


def _solve_tail(params: FamiliesParams, optimal: MethodMotion) -> Resumable[MethodMotion]:
    """From the optimal motion's state at M, as a problem of its own: the cheapest motion that some
    first guesses of its own lead to. None for M = 0, which is the whole."""
    begin = params.moment * params.horizon
    problem = params.problem(optimal.at(begin), params.horizon - begin)
    best = no_motion(problem)
    for swing in dict.fromkeys((params.guess, *TAIL_SWINGS)) if begin else ():
        found = yield from solve_pontryagin(problem, first_guess(problem, swing), "collocation")
        if found.converged and not (best.converged and best.cost < found.cost):
            best = found
    return replace(best, t=best.t + begin)
