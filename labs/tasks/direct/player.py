"""How the plan of a direct method is found and played, in collocation, multiple shooting and
the race of direct methods: on the plant, in open loop beside a regulator about it."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from labs.models.coordinates import coordinate_labels
from labs.models.mechanisms import Mechanism, mechanism
from labs.params import Value
from labs.tasks.direct.history import IterationHistory
from labs.tasks.direct.params import DirectParams
from labs.tasks.direct.plan_params import PlanParams
from labs.tasks.direct.trajectory import PiecewiseTrajectory
from labs.tasks.motion.playback import SUBSTEP, NominalTrajectory, advance_playback
from labs.tasks.motion.player import (
    WORLD_PERIOD,
    PlayerState,
    advance_clock,
    measure_runs,
    play_from_start,
)


@dataclass(kw_only=True)
class DirectState(PlayerState):
    """The motion, how it was found, and how it is being played."""

    motion: PiecewiseTrajectory
    history: IterationHistory
    reusable: bool = False
    """Whether a change may be solved from the motion: it is of a solve that did not fail."""


S = TypeVar("S", bound=DirectState)


def play_motion(
    state: S,
    motion: PiecewiseTrajectory,
    plan: NominalTrajectory,
    history: IterationHistory,
    failed: bool,
) -> S:
    """With another motion, and its plan at ticks with a regulator, to be played from its start."""
    return replace(play_from_start(state, plan, failed), motion=motion, history=history)


def advance_player(params: DirectParams, state: S) -> S:
    """WORLD_PERIOD later; at the end of the motion a rest, and then from the start."""
    state, plays = advance_clock(state)
    if not plays:
        return state
    plant = plant_with_payload(params)
    held = np.zeros(plant.nu)
    playback = advance_playback(
        state.plan,
        state.playback,
        (plant.acceleration(held), held),
        round(WORLD_PERIOD / SUBSTEP),
        params.bound,
    )
    state = replace(state, playback=playback)
    if not playback.finished(state.plan):
        return state
    ends = plant.tip_positions(playback.x)
    missed = [float(np.linalg.norm(end - params.goal_position)) for end in ends]
    return replace(state, goal_errors=np.array(missed))


def measure_player(params: DirectParams, state: DirectState) -> dict[str, float | np.ndarray]:
    """Where both runs are beside the plan, and numbers of the iterations."""
    return measure_runs(state) | {
        "cost": float(state.history.cost[-1]),
        "iteration": float(state.history.iterations),
        "violation": float(state.history.violation[-1]),
        "largest_gap": float(state.history.gaps[-1].max()),
        "T": state.motion.T,
    }


def edit_balls(
    params: PlanParams, handle: str, point: tuple[float, float, float]
) -> dict[str, Value]:
    """What the balls "target" and "obstacle" at `point` [m] say."""
    if handle not in ("target", "obstacle"):
        return {}
    names = (f"{handle}_{axis}" for axis in "xyz")
    return {name: params.nearest(name, x) for name, x in zip(names, point, strict=True)}


def plan_labels(params: PlanParams) -> dict[str, str | tuple[str, ...]]:
    """Of coordinates, and of the one that tells most."""
    words, joint = coordinate_labels(params.task.mechanism), params.task.shown
    name = {"mass": "position", "cart-pole": "pole", "ur5": "joint 2"}
    shown = name.get(params.system, "angle")
    return {**words, "shown": shown, "shown_unit": words["q_unit"][joint]}


def plant_with_payload(params: DirectParams) -> Mechanism:
    """The plant, with what the plan does not know of."""
    return mechanism(params.task.motion, params.payload)
