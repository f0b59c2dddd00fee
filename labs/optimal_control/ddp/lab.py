"""Differential dynamic programming (notes, 2.4.6): swing-ups and a reach, solved and played."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from labs.algorithms import ddp
from labs.algorithms.ddp import DdpIterate
from labs.lab import Action, Handle, Inputs, Lab, Measurement, Snapshot
from labs.models.coordinates import coordinate_labels
from labs.models.mechanisms import mechanism
from labs.optimal_control.ddp.disturbances import apply_impulse, sample_noise
from labs.optimal_control.ddp.history import DdpHistory, subsample
from labs.optimal_control.ddp.params import DdpParams
from labs.optimal_control.ddp.picture import draw_goal, draw_paths, draw_robots
from labs.optimal_control.ddp.plots import (
    PHASES,
    PLOTS,
    iteration_fields,
    plan_gain_fields,
    portrait_fields,
)
from labs.params import Value
from labs.problems.optimal_control import OptimalControlProblem
from labs.scene import Scene
from labs.tasks.motion.motions import clip_controls, initial_controls, resample_controls
from labs.tasks.motion.playback import (
    FEEDBACK,
    OPEN_LOOP,
    SUBSTEP,
    NominalTrajectory,
    advance_playback,
    start_playback,
)
from labs.tasks.motion.player import (
    WORLD_PERIOD,
    PlayerState,
    advance_clock,
    measure_runs,
    play_from_start,
)

ARROW_STEPS = 30
"""World steps the arrow of a push stays."""


@dataclass(kw_only=True)
class DdpState(PlayerState):
    """The plan, how it was found, and how it is being played."""

    history: DdpHistory
    run_costs: np.ndarray
    """(2,) cost of the last whole motion with feedback and in open loop; (0,) before it."""
    arrow_steps_left: int = 0
    """World steps the arrow of a push still stays."""
    key: int = 0
    """Of the noise's random numbers; their counter is `steps`."""


class Ddp(Lab[DdpParams, DdpState]):
    """Plans a motion by DDP or iLQR before one's eyes, and plays it on a plant it does not
    quite know."""

    title = "Differential dynamic programming"
    section = "2.4.6"
    summary = (
        "Swing up pendulums and reach with a UR5: watch DDP find the motion, then play it with "
        "and without its feedback gains."
    )
    Params = DdpParams
    period = WORLD_PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Weak motor": {"limited": True, "limit": 0.3, "horizon": 3.0},
        "Cart-pole": {"system": "cart-pole"},
        "Double pendulum": {"system": "double-pendulum"},
        "Acrobot": {"system": "acrobot", "horizon": 2.5},
        "Pendubot": {"system": "pendubot"},
        "UR5 reach": {"system": "ur5", "horizon": 1.0, "goal": 3000.0},
        "UR5 with an unknown payload": {
            "system": "ur5",
            "horizon": 1.0,
            "goal": 3000.0,
            "control": 0.01,
            "payload": 2.0,
        },
    }
    actions = (
        Action("push", "Push", "Strikes the tip of both robots, while the motion plays.", "World"),
    )
    handles = (Handle("target", "The UR5's target."),)

    def init(self, params: DdpParams, rng: np.random.Generator) -> DdpState:
        """The first guess, rolled out, is the first plan; the start at rest, where it diverges."""
        problem = _problem(params)
        at = ddp.init(problem, _guessed_controls(params, problem), params.options)
        if at.stopped:
            X = np.tile(problem.x0, (problem.N + 1, 1))
            U = initial_controls(problem, params.control_scale, 0.0, 0.0)
            at = replace(at, X=X, U=U, cost=problem.cost.value(X, U))
        plan = NominalTrajectory(at.X, at.U, at.K, params.h)
        return DdpState(
            plan=plan,
            history=DdpHistory.start(at, *_paths(params, at), None),
            playback=start_playback(plan),
            run_costs=np.zeros(0),
            goal_errors=np.zeros(0),
            key=int(rng.integers(2**63)),
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(self, params: DdpParams, state: DdpState) -> Iterator[Snapshot | None]:
        """One iteration of DDP a snapshot. A first guess that diverges leaves what there was."""
        problem = _problem(params)
        at = ddp.init(problem, _initial_controls(params, problem, state), params.options)
        if at.stopped:
            yield Snapshot(1, _snapshot_data(state.plan, state.history, True, {}), at.stopped)
            return
        history = DdpHistory.start(at, *_paths(params, at), state.history)
        seconds = {phase: np.zeros(0) for phase in PHASES}
        while not at.stopped:
            at = yield from ddp.resumable_step(problem, params.options, at)
            history = history.append(at, *_paths(params, at))
            seconds = {name: np.append(seconds[name], at.seconds[name]) for name in PHASES}
            plan = NominalTrajectory(at.X, at.U, at.K, params.h)
            failed = bool(at.stopped) and not at.converged
            yield Snapshot(at.iteration, _snapshot_data(plan, history, failed, seconds), at.stopped)

    def accept(self, params: DdpParams, state: DdpState, snapshot: Snapshot) -> DdpState:
        """Whatever is taken in is played from its start."""
        data = snapshot.data
        return replace(
            play_from_start(state, data["plan"], data["failed"]),
            history=data["history"],
            seconds=data["seconds"],
            arrow_steps_left=0,
            run_costs=np.zeros(0),
        )

    def edit(
        self, params: DdpParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """The ball is the UR5's target."""
        if handle != "target":
            return {}
        names = ("target_x", "target_y", "target_z")
        return {name: params.nearest(name, x) for name, x in zip(names, point, strict=True)}

    # The world's clock ------------------------------------------------------------------------

    def step(self, params: DdpParams, inputs: Inputs, state: DdpState) -> DdpState:
        """10 ms of both runs; at the end of the motion a rest, and then from the start."""
        if state.trouble:
            return state
        plant = mechanism(params.system, params.payload, params.friction)
        state, plays = advance_clock(
            replace(state, arrow_steps_left=max(state.arrow_steps_left - 1, 0))
        )
        if not plays:
            return state
        playback, pushed = state.playback, state.arrow_steps_left
        if "push" in inputs.actions:
            playback, pushed = apply_impulse(plant, playback, params.push), ARROW_STEPS
        substeps = round(self.period / SUBSTEP)
        disturbance, noise = sample_noise(params, substeps, state.key, state.steps)
        held = np.zeros(plant.nu)
        playback = advance_playback(
            state.plan,
            playback,
            (plant.acceleration(held), held),
            substeps,
            params.bound,
            disturbance,
            noise,
        )
        state = replace(state, playback=playback, arrow_steps_left=pushed)
        return self._evaluate(params, state) if playback.finished(state.plan) else state

    def _evaluate(self, params: DdpParams, state: DdpState) -> DdpState:
        """What each run paid, at the present weights, and where it came to."""
        cost = params.problem(state.plan.N, state.plan.h).cost
        runs = zip(state.playback.X, state.playback.U, strict=True)
        ends = mechanism(params.system).tip_positions(state.playback.X[:, -1])
        goal = _goal_position(params)
        return replace(
            state,
            run_costs=np.array([cost.value(X, U) for X, U in runs]),
            goal_errors=np.array([np.linalg.norm(end - goal) for end in ends]),
        )

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: DdpParams, state: DdpState) -> Measurement:
        """The two runs, and what the last motion that came to its end cost them."""
        found = measure_runs(state) | {
            "cost": float(state.history.cost[-1]),
            "iteration": float(len(state.history.alpha)),
        }
        for i, suffix in ((FEEDBACK, ""), (OPEN_LOOP, "_open")):
            if len(state.run_costs):
                found[f"paid{suffix}"] = float(state.run_costs[i])
        return found

    def fields(self, params: DdpParams, state: DdpState) -> Mapping[str, np.ndarray]:
        """The iterations so far, and the gains along the motion."""
        return (
            iteration_fields(state.history, state.seconds)
            | portrait_fields(state.history, _feedback_states(state), params.motion.shown_joint)
            | plan_gain_fields(state.plan)
        )

    def labels(self, params: DdpParams) -> Mapping[str, tuple[str, ...]]:
        return coordinate_labels(mechanism(params.system))

    def draw(self, scene: Scene, params: DdpParams, state: DdpState) -> None:
        """The robot under feedback, its open-loop ghost, and the paths of plan and iterations."""
        playback = state.playback
        draw_robots(scene, params, playback.x, playback.u)
        draw_paths(scene, params, state.history, state.failed, _feedback_states(state))
        draw_goal(scene, params, playback.x, _goal_position(params), bool(state.arrow_steps_left))

    @classmethod
    def prepare(cls) -> None:
        """One iteration of every kind."""
        for changes in ({}, {"method": "ddp"}, {"limited": True}):
            params = DdpParams(**changes)
            problem = params.problem(3, params.h)
            ddp.step(problem, params.options, ddp.init(problem, np.zeros((3, 1)), params.options))


@lru_cache(maxsize=16)
def _problem(params: DdpParams) -> OptimalControlProblem:
    return params.problem(round(params.horizon / params.h), params.h)


def _guessed_controls(params: DdpParams, problem: OptimalControlProblem) -> np.ndarray:
    return initial_controls(problem, params.control_scale, params.guess, params.guess_rate)


def _initial_controls(
    params: DdpParams, problem: OptimalControlProblem, state: DdpState
) -> np.ndarray:
    """U to start from: the present solution, if there is one and it is wanted."""
    if params.start == "cold" or not len(state.history.alpha):
        return _guessed_controls(params, problem)
    return clip_controls(
        problem, resample_controls(state.plan.U, state.plan.h, params.h, problem.N)
    )


def _snapshot_data(
    plan: NominalTrajectory, history: DdpHistory, failed: bool, seconds: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    return {"plan": plan, "history": history, "failed": failed, "seconds": seconds}


def _paths(params: DdpParams, at: DdpIterate) -> tuple[np.ndarray, np.ndarray]:
    """Of the tip (PATH_POINTS, 3), and of the joint shown (PATH_POINTS, 2)."""
    system, joint = mechanism(params.system), params.motion.shown_joint
    X = subsample(at.X)
    return system.tip_positions(X), X[:, [joint, system.nq + joint]]


def _feedback_states(state: DdpState) -> np.ndarray:
    """The states (k, nx) under feedback at the plan's steps, as far as it has come."""
    playback = state.playback
    played: np.ndarray = playback.X[FEEDBACK, : playback.clock // state.plan.substeps + 1]
    return played


def _goal_position(params: DdpParams) -> np.ndarray:
    """Where the tip should end (3,) [m]."""
    goal = params.motion.goal
    return mechanism(params.system).tip(np.array(goal)) if goal else params.target
