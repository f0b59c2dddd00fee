"""Model predictive control (notes, 2.5): a plan from every state that is measured, of which only
the first control acts, over any planner. At period t

    u_t = u*_0,   U* = the planner's from x_t, started at the plan before: u_k <- u*_(k+1) (2.5.4).

The horizon recedes, or shrinks by a step a period, as in the notes' remark on Bellman's principle.

A planner that takes its time is a delay of d periods in simulated time (beyond the notes): the
plan from x_t acts from t + d on. Without compensation it acts as if the state had not changed;
with it the plan starts where the model says that the controls already given lead to until then,
x_(t+d). Where no plan is found, the last one goes on, or the caller's brake acts.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from labs.errors import LabError
from labs.problems.receding_horizon import Plan, Planner
from labs.resumable import Resumable

PredictionModel = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""x+ (nx,) of x (nx,) and u (nu,)."""


@dataclass(frozen=True)
class MpcOptions:
    """How plans follow each other. Raises LabError for a negative delay or an empty horizon."""

    warm: bool = True
    """Whether a plan starts at the one before, shifted."""
    last: Literal["zero", "repeated"] = "zero"
    """The last control of the shifted plan."""
    shrink_from: int | None = None
    """N at t = 0, of a horizon that shrinks to 1 and begins anew; None: it recedes."""
    fallback: Literal["tail", "brake"] = "tail"
    """What acts where no plan is found: the rest of the last plan, and after its end the brake; or
    the brake at once."""
    delay: int = 0
    """d, in periods."""
    compensate: bool = True
    """Whether a plan starts at x_(t+d) as the model predicts it, instead of at x_t."""

    def __post_init__(self) -> None:
        if self.delay < 0:
            raise LabError(f"a delay of {self.delay} periods: it takes 0 or more")
        if self.shrink_from is not None and self.shrink_from < 1:
            raise LabError(f"a horizon that shrinks from {self.shrink_from}: it takes 1 or more")


@dataclass(frozen=True, eq=False)
class RecedingHorizonState:
    """The controller between two periods: plain finite data, without durations, never written into
    again."""

    period: int
    """t, of the next one."""
    u: np.ndarray
    """(nu,) what acts now."""
    committed: np.ndarray
    """(d, nu) what will act in the next d periods."""
    plan: Plan | None = None
    """The last that was found."""
    age: int = 0
    """Periods since then: what was last chosen is its control of this number."""
    guess: Plan | None = None
    """What the next plan starts from."""
    failures: int = 0
    """Periods in which no plan was found."""
    why: str = ""
    """Empty while plans are found, else why none was, in a sentence,"""
    status: str = ""
    """and the same with when that was and what acts instead."""


def init(options: MpcOptions, rest: np.ndarray) -> RecedingHorizonState:
    """Before the first period; `rest` (nu,) acts until the first plan does."""
    return RecedingHorizonState(0, rest, np.tile(rest, (options.delay, 1)))


def step(
    planner: Planner,
    model: PredictionModel,
    options: MpcOptions,
    at: RecedingHorizonState,
    x: np.ndarray,
    brake: np.ndarray,
    replan: bool = True,
) -> Resumable[RecedingHorizonState]:
    """One period: the measured state x (nx,) in, u (nu,) out. `brake` (nu,) acts where there is no
    plan. Without `replan` the last plan goes on and nothing is solved."""
    start = x
    if options.compensate:
        for u in at.committed:
            start = model(start, u)
    plan, failed = at.plan, ""
    if replan:
        found = yield from planner.plan(
            start, at.guess if options.warm else None, horizon(options, at.period)
        )
        # What it took by the clock on the wall is no part of a run.
        if found.found:
            plan = replace(found, seconds={})
        else:
            failed = found.message.rstrip(".") + "."
    age = 0 if replan and not failed else at.age + 1
    goes_on = plan is not None and age < len(plan.U) and (options.fallback == "tail" or not failed)
    chosen = plan_control(plan, age, start) if plan is not None and goes_on else brake
    queue = np.concatenate([at.committed, chosen[None]])
    return RecedingHorizonState(
        period=at.period + 1,
        u=queue[0],
        committed=queue[1:],
        plan=plan,
        age=age,
        guess=None if plan is None else shift_plan(plan, age + 1, model, options),
        failures=at.failures + bool(failed),
        why=failed,
        status=failed and _status_message(at.period, failed, age if goes_on else None),
    )


def plan_control(plan: Plan, age: int, x: np.ndarray) -> np.ndarray:
    """What a plan says to do at the state x (nx,), `age` periods after it began: u (nu,)."""
    if plan.K is None:
        return np.asarray(plan.U[age])
    return np.asarray(plan.U[age] + plan.K @ (x - plan.X[age]))


def horizon(options: MpcOptions, period: int) -> int | None:
    """N of the plan at this period; None is the planner's own."""
    first = options.shrink_from
    return None if first is None else first - period % first


def shift_plan(plan: Plan, steps: int, model: PredictionModel, options: MpcOptions) -> Plan | None:
    """The plan `steps` periods later: a guess, found by nobody and without a cost; None after the
    plan's end. Its last controls are zero or repeated, and its last states follow from the model;
    a horizon that shrinks loses them instead."""
    if steps >= len(plan.U):
        return None
    X, U, added = plan.X[steps:], plan.U[steps:], 0 if options.shrink_from else steps
    last = plan.U[-1] if options.last == "repeated" else np.zeros_like(plan.U[-1])
    for _ in range(added):
        X = np.vstack([X, model(X[-1], last)])
        U = np.vstack([U, last])
    active = {}
    for kind, rows in plan.active.items():
        kept = np.arange(max(len(rows) - steps + added, 1)) + steps
        active[kind] = rows[np.minimum(kept, len(rows) - 1)]
    return Plan(X, U, 0.0, False, "the plan before, shifted", active)


def _status_message(period: int, why: str, age: int | None) -> str:
    """A sentence of when, why and what acts instead."""
    acts = "the brake acts" if age is None else f"the plan of {_periods_text(age)} before goes on"
    return f"No plan in period {period}: {why} Instead {acts}."


def _periods_text(count: int) -> str:
    return "one period" if count == 1 else f"{count} periods"
