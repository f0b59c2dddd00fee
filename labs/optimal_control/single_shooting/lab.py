"""Single shooting (notes, 2.3.2): controls as the only variables, what each of them does to the
whole motion, and the gradient in three ways."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from labs.algorithms import riccati, sqp
from labs.algorithms.single_shooting import SingleShooting
from labs.algorithms.sqp import SqpIterate
from labs.lab import Handle, Inputs, Lab, Measurement, Snapshot, State
from labs.optimal_control.single_shooting.history import ShootingHistory
from labs.optimal_control.single_shooting.params import CHOICE_SETTINGS, SingleShootingParams
from labs.optimal_control.single_shooting.picture import (
    dragged_control,
    draw_change,
    draw_paths,
    draw_robots,
    drawn_path,
)
from labs.optimal_control.single_shooting.plan import ShootingPlan, interpolate_state, make_plan
from labs.optimal_control.single_shooting.plots import (
    PLOTS,
    change_fields,
    iteration_fields,
    sensitivity_fields,
    study_fields,
)
from labs.optimal_control.single_shooting.studies import (
    NO_STUDY,
    AccuracyStudy,
    study_gradients,
    study_integration,
)
from labs.params import Value
from labs.scene import Scene
from labs.tasks.direct.guesses import is_warm_start
from labs.tasks.direct.picture import draw_goal
from labs.tasks.direct.player import edit_balls, plan_labels
from labs.tasks.motion.player import REST_STEPS, WORLD_PERIOD


@dataclass(kw_only=True)
class SingleShootingState(State):
    """The plan, how it was found, and where in its motion the robot is."""

    plan: ShootingPlan
    history: ShootingHistory
    study: AccuracyStudy = NO_STUDY
    failed: bool = False
    """Whether the last solve ended without a solution."""
    reusable: bool = False
    """Whether a change may be solved from the plan: it is of a solve that did not fail."""
    clock: int = 0
    """World steps since the motion began; it ends and rests, then begins anew."""
    shown_fraction: float = 0.0
    """The part of the motion that has been seen since the start: so much of the map is shown."""
    steps: int = 0
    """World steps done: t = steps * period."""


class SingleShootingLab(Lab[SingleShootingParams, SingleShootingState]):
    """Plans a motion by its controls alone, and shows what each of them does to all that
    follows."""

    title = "Single shooting"
    section = "2.3.2"
    summary = (
        "Plan a motion by its controls alone: change one and watch the whole motion swing about, "
        "see sensitivities explode, and get a gradient in three ways."
    )
    Params = SingleShootingParams
    period = WORLD_PERIOD
    plots = PLOTS
    presets: ClassVar[Mapping[str, Mapping[str, Value]]] = {
        "Mass": {"system": "mass"},
        "Upright": {"system": "upright", "horizon": 3.0, "guess": 0.0},
        "Least time": {"system": "mass", "objective": "least-time", "limit": 1.0},
        "Double pendulum": {"system": "double-pendulum", "horizon": 0.8, "guess": 0.5},
        "Cart-pole": {"system": "cart-pole"},
        "UR5 reach": {"system": "ur5", "horizon": 1.0, "guess": 0.0, "delta": 0.1},
        "UR5 past an obstacle": {
            "system": "ur5",
            "horizon": 1.0,
            "guess": 0.0,
            "delta": 0.0,
            "obstacle": True,
        },
    }
    choice_settings = CHOICE_SETTINGS
    handles = (
        Handle("control", "Which control is changed, and by how much."),
        Handle("target", "The UR5's target."),
        Handle("obstacle", "The ball that the UR5's tip must not enter."),
    )

    def init(self, params: SingleShootingParams, rng: np.random.Generator) -> SingleShootingState:
        """The first guess is the first plan; what holds the start, where it diverges."""
        shooting = params.shooting
        y = shooting.pack(params.first_guess(params.N))
        if not np.isfinite(shooting.cost(y)):
            y = shooting.pack(np.tile(params.task.holding, (params.N, 1)))
        at = sqp.init(shooting, y, params.options)
        plan = make_plan(params, shooting, at.y)
        return SingleShootingState(
            plan=plan, history=ShootingHistory.start(at, _path(params, plan))
        )

    # The solver's clock -----------------------------------------------------------------------

    def solve(
        self, params: SingleShootingParams, state: SingleShootingState
    ) -> Iterator[Snapshot | None]:
        """One iteration a snapshot. A first guess that diverges leaves what there was."""
        shooting, seconds, study = params.shooting, dict[str, Any](), NO_STUDY
        at = sqp.init(shooting, _initial_variables(params, shooting, state), params.options)
        if at.stopped:
            why = at.stopped if np.isfinite(at.values.f) else _divergence_message(shooting, at.y)
            kept = _snapshot_data(state.plan, state.history, state.study, at, {})
            yield Snapshot(1, kept, why)
            return
        if params.studied == "gradients":
            study = yield from study_gradients(params, seconds)
        history = ShootingHistory.start(at, _path(params, make_plan(params, shooting, at.y)))
        while not at.stopped:
            at = yield from sqp.resumable_step(shooting, params.options, at)
            yield None
            plan = make_plan(params, shooting, at.y)
            history = history.append(at, _path(params, plan))
            if at.stopped and params.studied == "integration":
                study = yield from study_integration(params, plan)
            data = _snapshot_data(plan, history, study, at, seconds)
            yield Snapshot(at.iteration, data, at.stopped)

    def accept(
        self, params: SingleShootingParams, state: SingleShootingState, snapshot: Snapshot
    ) -> SingleShootingState:
        """Whatever is taken in is played from its start."""
        return replace(
            state,
            plan=snapshot.data["plan"],
            history=snapshot.data["history"],
            study=snapshot.data["study"],
            failed=snapshot.data["failed"],
            reusable=snapshot.data["reusable"],
            seconds=snapshot.data.get("seconds", {}),
            clock=0,
        )

    def edit(
        self, params: SingleShootingParams, handle: str, point: tuple[float, float, float]
    ) -> Mapping[str, Value]:
        """One ball is the change of one control; the others are the UR5's target and obstacle."""
        if handle == "control":
            return dragged_control(params, point)
        return edit_balls(params, handle, point)

    # The world's clock ------------------------------------------------------------------------

    def step(
        self, params: SingleShootingParams, inputs: Inputs, state: SingleShootingState
    ) -> SingleShootingState:
        """10 ms of the motion; at its end a rest, and then from the start."""
        steps, clock = state.steps + 1, state.clock + 1
        if (clock - REST_STEPS) * self.period > state.plan.T:
            clock = 0
        grown = max(state.shown_fraction, min(clock * self.period / state.plan.T, 1.0))
        return replace(state, t=steps * self.period, steps=steps, clock=clock, shown_fraction=grown)

    # What is shown ----------------------------------------------------------------------------

    def measure(self, params: SingleShootingParams, state: SingleShootingState) -> Measurement:
        """Where the simulated motion is, and numbers of the plan."""
        plan, n, t = state.plan, params.task.mechanism.nq, self._motion_time(state)
        piece = min(int(t / plan.T * plan.N), plan.N - 1)
        X, U = plan.simulated_run(params.feedback)
        measured: dict[str, float | np.ndarray] = {
            "q": interpolate_state(X, plan.T, t)[:n],
            "q_plan": interpolate_state(plan.X, plan.T, t)[:n],
            "u": U[piece],
            "cost": float(state.history.cost[-1]),
            "iteration": float(len(state.history.alpha)),
            "first_effect": float(plan.influence[-1, 0]),
            "integration_error": plan.integration_error,
            "missed": params.goal_error(X[-1, :n]),
            "T": plan.T,
        }
        return measured | ({"condition": plan.condition} if plan.condition else {})

    def fields(
        self, params: SingleShootingParams, state: SingleShootingState
    ) -> Mapping[str, np.ndarray]:
        """The iterations, the map of sensitivities, the changed motion and the studies."""
        return (
            iteration_fields(state.history)
            | sensitivity_fields(state.plan, params.chosen_piece, state.shown_fraction)
            | change_fields(params, state.plan)
            | study_fields(state.study, state.seconds)
        )

    def labels(self, params: SingleShootingParams) -> Mapping[str, str | tuple[str, ...]]:
        return plan_labels(params)

    def draw(self, scene: Scene, params: SingleShootingParams, state: SingleShootingState) -> None:
        """The robot, its ghost under the changed control, the paths, and the goal."""
        t = self._motion_time(state)
        draw_robots(scene, params, state.plan, t)
        draw_paths(scene, params, state.plan, state.history.paths, t, state.failed)
        draw_change(scene, params)
        draw_goal(scene, params)

    def _motion_time(self, state: SingleShootingState) -> float:
        """[s] since the motion began; T while it rests."""
        return min(state.clock * self.period, state.plan.T)

    @classmethod
    def prepare(cls) -> None:
        """The solver, one iteration of each kind, and the recursion that tracks a plan."""
        sqp.prepare()
        riccati.prepare()
        for hessian in ("gauss-newton", "exact"):
            params = SingleShootingParams(pieces=3.0, steps=1.0, hessian=hessian)
            shooting = params.shooting
            y = shooting.pack(params.first_guess(3))
            sqp.step(shooting, params.options, sqp.init(shooting, y, params.options))


def _initial_variables(
    params: SingleShootingParams, shooting: SingleShooting, state: SingleShootingState
) -> np.ndarray:
    """y to start from: the present solution, if there is one and it is wanted. Its controls are
    taken at the middles of the new pieces, in parts of the motion."""
    plan = state.plan
    if not is_warm_start(params, state.reusable):
        return shooting.pack(params.first_guess(params.N))
    middle = (np.arange(params.N) + 0.5) / params.N
    U = plan.U[(middle * plan.N).astype(int)]
    return shooting.pack(U, plan.T)


def _divergence_message(shooting: SingleShooting, y: np.ndarray) -> str:
    step, t = shooting.diverges_at(y)
    return (
        f"The first guess diverges in step {step} of {shooting.N * shooting.M}, at t = {t:.3g} s: "
        "take a smaller A, more steps M, or another integrator."
    )


def _path(params: SingleShootingParams, plan: ShootingPlan) -> np.ndarray:
    return drawn_path(params.task, plan.X, plan.T)


def _snapshot_data(
    plan: ShootingPlan,
    history: ShootingHistory,
    study: AccuracyStudy,
    at: SqpIterate,
    seconds: Mapping[str, float | np.ndarray],
) -> dict[str, Any]:
    return {
        "plan": plan,
        "history": history,
        "study": study,
        "failed": bool(at.stopped) and not at.converged,
        "reusable": at.reusable,
        "seconds": seconds,
    }
