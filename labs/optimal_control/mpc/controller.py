"""The problem that is solved at every period, its planner, and a period of the controller.

    l(x, u) = h / 2 (w_q |q - q*|^2 + w_v |v|^2 + w_u |(u - g(q*)) / u_0|^2)
    l_f(x)  = w_f / 2 |q - q*|^2 + w_vf / 2 |v|^2

The target is a posture q*, found by inverse kinematics once whenever the ball is moved, not the
place of the tip itself: the cost stays quadratic, so that Gauss-Newton leaves nothing out and one
iteration is nearly the whole way; and the torques g(q*) that hold the goal are known, so that it
is the cost's minimum, and the robot comes to rest there exactly.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from labs.algorithms import mpc
from labs.algorithms.mpc import RecedingHorizonState
from labs.algorithms.nonlinear_mpc import NonlinearMpc
from labs.algorithms.nonlinear_mpc_problem import NonlinearMpcProblem
from labs.optimal_control.mpc.params import MpcParams
from labs.optimal_control.mpc.systems import dynamics, goal_posture
from labs.problems.receding_horizon import Plan
from labs.resumable import Resumable, run_to_completion
from labs.tasks.motion.tip_constraints import ObstacleConstraint


@dataclass(eq=False)
class RecordingPlanner:
    """A planner, and what it said last. Plans pass without their durations, which are none of a
    state's business."""

    planner: NonlinearMpc
    last_plan: Plan | None = field(default=None)

    def plan(self, x: np.ndarray, guess: Plan | None, N: int | None = None) -> Resumable[Plan]:
        """`labs.problems.receding_horizon.Planner.plan`."""
        self.last_plan = yield from self.planner.plan(x, guess, N)
        return replace(self.last_plan, seconds={})


def control_step(
    params: MpcParams, aim: np.ndarray, at: RecedingHorizonState, x: np.ndarray
) -> tuple[RecedingHorizonState, Plan | None]:
    """A period later, with the target at `aim` (3,) [m]; and what the planner said, if it was
    asked."""
    model, planner = dynamics(params.system, params.h), RecordingPlanner(planner_of(params, aim))
    brake = np.clip(params.robot.brake(x), -params.bounds[2], params.bounds[2])
    if params.mode == "plan":
        plan = run_to_completion(planner.plan(x, at.guess if params.start == "warm" else None))
        if plan.found:
            at = replace(at, plan=plan, guess=plan, age=-1, u=brake)
        return at, planner.last_plan
    work = mpc.step(planner, model.step, params.options, at, x, brake, params.mode == "both")
    at = run_to_completion(work)
    # What no planner found has no cost; a state holds numbers only.
    guess = at.guess and replace(at.guess, cost=0.0)
    return replace(at, guess=guess), planner.last_plan


def planner_of(params: MpcParams, aim: np.ndarray) -> NonlinearMpc:
    """Of these parameters, as far as they say what is to be solved, for the target at `aim`."""
    return _planner(params.model_copy(update=FIELDS_OUTSIDE_PROBLEM), tuple(aim.tolist()))


FIELDS_OUTSIDE_PROBLEM = {
    name: MpcParams.model_fields[name].default
    for name in (
        "mode", "horizon", "start", "last", "delay", "compensate", "fallback", "push", "payload",
        "target_x", "target_y", "target_z", "cart", "tip_y", "tip_z", "turns",
    )
}  # fmt: skip


@lru_cache(maxsize=8)
def _planner(params: MpcParams, aim: tuple[float, ...]) -> NonlinearMpc:
    x_ref, u_ref = goal_equilibrium(params, np.array(aim))
    return _base_planner(params).with_reference(x_ref, u_ref)


@lru_cache(maxsize=4)
def _base_planner(params: MpcParams) -> NonlinearMpc:
    """For some target: the costly part, which a moving one does not ask for anew."""
    return NonlinearMpc(mpc_problem(params, params.target), params.max_iterations)


def goal_equilibrium(params: MpcParams, aim: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the robot rests with its target at `aim` (3,) [m]: (nx,), and what holds it (nu,)."""
    at, goal = params.robot, goal_posture(params.system, aim)
    return np.concatenate([goal, np.zeros(at.n)]), at.mechanism.equilibrium_control(goal)


def mpc_problem(params: MpcParams, aim: np.ndarray) -> NonlinearMpcProblem:
    """What is solved at every period, for the target at `aim` (3,) [m]."""
    at, h = params.robot, params.h
    x_ref, u_ref = goal_equilibrium(params, aim)
    x_lower, x_upper, u_max = params.bounds
    ball, rest = params.ball, np.concatenate([np.full(at.n, np.nan), np.zeros(at.n)])
    return NonlinearMpcProblem(
        dynamics(params.system, h),
        params.N,
        Q=h * np.diag(np.repeat([params.w_q, params.w_v], at.n)),
        R=h * np.diag(params.w_u / at.u_0**2),
        Q_f=np.diag(np.repeat([params.w_f, params.w_vf], at.n)),
        x_ref=x_ref,
        u_ref=u_ref,
        x_lower=x_lower,
        x_upper=x_upper,
        u_lower=-u_max,
        u_upper=u_max,
        path=ObstacleConstraint(at.mechanism, (ball,)) if ball else None,
        x_final=rest if params.end == "rest" else None,
        penalty=params.penalty if params.soft else None,
    )


def cost_terms(params: MpcParams, aim: np.ndarray, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    """(3,): what position, velocity and control add to l."""
    goal, n = planner_of(params, aim).problem, params.robot.n
    dx, du = x - goal.x_ref, u - goal.u_ref
    position, velocity = (
        0.5 * dx[part] @ goal.Q[part, part] @ dx[part] for part in _position_velocity_slices(n)
    )
    return np.array([position, velocity, 0.5 * du @ goal.R @ du])


def _position_velocity_slices(n: int) -> tuple[slice, slice]:
    return slice(n), slice(n, None)
