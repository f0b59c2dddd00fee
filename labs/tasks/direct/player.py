"""How the plan of a direct method is found and played, in collocation, multiple shooting and
the race of direct methods: on the plant, in open loop beside a regulator about it."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from labs.lab import State
from labs.models.coordinates import coordinate_labels
from labs.models.mechanisms import Mechanism, mechanism
from labs.params import Value
from labs.tasks.direct.history import History
from labs.tasks.direct.params import DirectParams
from labs.tasks.direct.trajectory import Trajectory
from labs.tasks.motion.playback import (
    FEEDBACK,
    OPEN_LOOP,
    SUBSTEP,
    Plan,
    Playback,
    advance_playback,
    start_playback,
)

PERIOD = 0.01
"""[s] A step of the world."""
REST_STEPS = 80
"""World steps between the end of a motion and its start anew: 0.8 s."""


@dataclass(kw_only=True)
class DirectState(State):
    """The motion, how it was found, and how it is being played."""

    motion: Trajectory
    plan: Plan
    """The motion, at ticks and with its regulator."""
    history: History
    failed: bool = False
    """Whether the last solve ended without a solution."""
    playback: Playback
    rested: int = 0
    """World steps since the motion ended."""
    missed: np.ndarray
    """(2,) how far the tip ended from its goal [m], with feedback and in open loop, the last time;
    (0,) before it."""
    steps: int = 0
    """World steps done: t = steps * PERIOD."""


S = TypeVar("S", bound=DirectState)


def replayed(state: S, motion: Trajectory, plan: Plan, history: History, failed: bool) -> S:
    """With another motion, to be played from its start."""
    return replace(
        state,
        motion=motion,
        plan=plan,
        history=history,
        failed=failed,
        playback=start_playback(plan),
        rested=0,
        missed=np.zeros(0),
    )


def advanced(params: DirectParams, state: S) -> S:
    """PERIOD later; at the end of the motion a rest, and then from the start."""
    steps = state.steps + 1
    state = replace(state, t=steps * PERIOD, steps=steps)
    if state.playback.finished(state.plan):
        if state.rested < REST_STEPS:
            return replace(state, rested=state.rested + 1)
        return replace(state, rested=0, playback=start_playback(state.plan))
    plant = loaded(params)
    held = np.zeros(plant.nu)
    playback = advance_playback(
        state.plan,
        state.playback,
        (plant.acceleration(held), held),
        round(PERIOD / SUBSTEP),
        params.bound,
    )
    state = replace(state, playback=playback)
    if not playback.finished(state.plan):
        return state
    ends = [plant.tip(x[: plant.nq]) for x in playback.x]
    missed = [float(np.linalg.norm(end - params.goal_place)) for end in ends]
    return replace(state, missed=np.array(missed))


def measured(params: DirectParams, state: DirectState) -> dict[str, float | np.ndarray]:
    """Where both runs are beside the plan, and numbers of the iterations."""
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
        "cost": float(state.history.cost[-1]),
        "iteration": float(state.history.iterations),
        "violation": float(state.history.violation[-1]),
        "largest_gap": float(state.history.gaps[-1].max()),
        "T": state.motion.T,
    }
    for i, suffix in ((FEEDBACK, ""), (OPEN_LOOP, "_open")):
        if len(state.missed):
            found[f"missed{suffix}"] = float(state.missed[i])
    return found


def dragged(
    params: DirectParams, handle: str, point: tuple[float, float, float]
) -> dict[str, Value]:
    """What the balls "target" and "obstacle" at `point` [m] say."""
    if handle not in ("target", "obstacle"):
        return {}
    names = (f"{handle}_{axis}" for axis in "xyz")
    return {name: params.nearest(name, x) for name, x in zip(names, point, strict=True)}


def labels_of(params: DirectParams) -> dict[str, str | tuple[str, ...]]:
    """Of coordinates, and of the one that tells most."""
    words, joint = coordinate_labels(params.task.mechanism), params.task.shown
    name = {"mass": "position", "cart-pole": "pole", "ur5": "joint 2"}
    shown = name.get(params.system, "angle")
    return {**words, "shown": shown, "shown_unit": words["q_unit"][joint]}


def loaded(params: DirectParams) -> Mechanism:
    """The plant, with what the plan does not know of."""
    return mechanism(params.task.motion, params.payload)
