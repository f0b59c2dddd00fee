"""What is kept of a run: the last seconds of motion, earlier predictions, and the first one."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from labs.problems.receding_horizon import Plan

PAST_STEPS = 200
"""World steps of the motion that are kept."""
KEPT_PREDICTIONS, PREDICTION_SPACING = 8, 0.08
"""Earlier predictions that are kept; the time [s] between two of them."""


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """What a plan says: X (N + 1, nx) from the time t [s] on, in steps of h [s]."""

    t: float
    h: float
    X: np.ndarray

    @property
    def times(self) -> np.ndarray:
        """(N + 1,) [s]"""
        return self.t + self.h * np.arange(len(self.X))

    def at(self, t: float) -> np.ndarray | None:
        """(nx,) at one of its times; None beyond them."""
        k = round((t - self.t) / self.h)
        return self.X[k] if 0 <= k < len(self.X) else None


@dataclass(frozen=True, eq=False)
class PlanningHistory:
    """Arrays are never written into again."""

    past: np.ndarray
    """(up to PAST_STEPS, nx) the states of the last world steps, the present one last."""
    predictions: tuple[PlannedMotion, ...] = ()
    """Earlier predictions, the oldest first."""
    latest: PlannedMotion | None = None
    first: PlannedMotion | None = None
    predicted_cost: float | None = None
    """What the first plan was to cost."""
    cost: float = 0.0
    """What was paid since then, up to the present period,"""
    horizon_cost: float | None = None
    """and over the horizon of the first plan, with l_f at its end; None before that."""
    deviation_from_first: float = 0.0
    """Largest deviation of a position from the first plan, while it lasts."""

    def append_state(self, x: np.ndarray) -> Self:
        """A world step later, at x."""
        return replace(self, past=np.concatenate([self.past[1 - PAST_STEPS :], x[None]]))

    def append_plan(self, plan: Plan, t: float, h: float) -> Self:
        """With a new plan, which begins at t."""
        now, fan = PlannedMotion(t, h, plan.X), self.predictions
        if self.latest and (not fan or self.latest.t - fan[-1].t > PREDICTION_SPACING - 0.5 * h):
            fan = (*fan, self.latest)[-KEPT_PREDICTIONS:]
        if self.first is None:
            return replace(self, latest=now, first=now, predicted_cost=plan.cost)
        return replace(self, latest=now, predictions=fan)

    def start_period(self, x: np.ndarray, t: float, running: float, final: float) -> Self:
        """At the start of a period, at x, the last one having cost `running`; `final` is l_f."""
        paid, first = self.cost + running, self.first
        if first is None:
            return self
        planned, n = first.at(t), len(x) // 2
        if planned is None:
            return replace(self, cost=paid)
        off = max(self.deviation_from_first, float(np.abs(x[:n] - planned[:n]).max()))
        ended = t > first.times[-1] - 0.5 * first.h
        over = paid + final if ended else self.horizon_cost
        return replace(self, cost=paid, deviation_from_first=off, horizon_cost=over)
