"""How a solver's plan is played over and over, open loop beside feedback: in DDP, and in the race
of direct methods and the labs of collocation and multiple shooting."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from labs.lab import State
from labs.tasks.motion.playback import (
    FEEDBACK,
    OPEN_LOOP,
    NominalTrajectory,
    Playback,
    start_playback,
)

WORLD_PERIOD = 0.01
"""[s] A step of the world."""
REST_STEPS = 80
"""World steps between the end of a motion and its start anew: 0.8 s."""


@dataclass(kw_only=True)
class PlayerState(State):
    """The plan, and how it is being played."""

    plan: NominalTrajectory
    failed: bool = False
    """Whether the last solve ended without a solution."""
    playback: Playback
    rest_steps: int = 0
    """World steps since the motion ended."""
    goal_errors: np.ndarray
    """(2,) how far the tip ended from its goal [m], with feedback and in open loop, the last time;
    (0,) before it."""
    steps: int = 0
    """World steps done: t = steps * WORLD_PERIOD."""


S = TypeVar("S", bound=PlayerState)


def play_from_start(state: S, plan: NominalTrajectory, failed: bool) -> S:
    """With another plan."""
    return replace(
        state,
        plan=plan,
        failed=failed,
        playback=start_playback(plan),
        rest_steps=0,
        goal_errors=np.zeros(0),
    )


def advance_clock(state: S) -> tuple[S, bool]:
    """WORLD_PERIOD later, and whether the motion goes on in it: at its end there is a rest, and
    then it is at its start."""
    steps = state.steps + 1
    state = replace(state, t=steps * WORLD_PERIOD, steps=steps)
    if not state.playback.finished(state.plan):
        return state, True
    if state.rest_steps < REST_STEPS:
        return replace(state, rest_steps=state.rest_steps + 1), False
    return replace(state, rest_steps=0, playback=start_playback(state.plan)), False


def measure_runs(state: PlayerState) -> dict[str, float | np.ndarray]:
    """Where both runs are beside the plan, and how far they missed the goal the last time."""
    plan, playback = state.plan, state.playback
    n = plan.X.shape[1] // 2
    k = min(playback.clock // plan.substeps, plan.N)
    found: dict[str, float | np.ndarray] = {
        "q": playback.x[FEEDBACK, :n],
        "q_open": playback.x[OPEN_LOOP, :n],
        "q_plan": plan.X[k, :n],
        "v": playback.x[FEEDBACK, n:],
        "v_open": playback.x[OPEN_LOOP, n:],
        "v_plan": plan.X[k, n:],
        "u": playback.u[FEEDBACK],
        "u_plan": plan.U[min(k, plan.N - 1)],
    }
    for i, suffix in ((FEEDBACK, ""), (OPEN_LOOP, "_open")):
        if len(state.goal_errors):
            found[f"missed{suffix}"] = float(state.goal_errors[i])
    return found
