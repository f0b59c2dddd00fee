"""The motions of `labs.tasks.motion.motions`, and a mass on a line, as optimal control problems in
continuous time (notes, 2.1.1, 2.1.2), in shooting and collocation.

A mechanism starts at rest at x_0. What it should do is one of

    weighted        int w_q |q - q_ref|^2 + w_v |v|^2 + w_u |(u - u_ref) / u_0|^2 dt
                    + w_f |q(T) - q*|^2 + w_vf |v(T)|^2          of a reach: w_f |p(q(T)) - p*|^2
    least-time      T
    least-energy    int |(u - u_ref) / u_0|^2 dt
    fastest-end     -v_k(T), the velocity that one joint ends with

and all but the first end where they should exactly: at q*, or with the tip at p*; the second and
third at rest.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labs.errors import LabError
from labs.models.coordinates import state_and_control_names
from labs.models.mechanisms import mechanism
from labs.problems.continuous_control import ContinuousProblem
from labs.tasks.motion.continuous_cost import ContinuousMotionCost, SoftLimits
from labs.tasks.motion.cost import TipCost
from labs.tasks.motion.motions import MOTIONS, RAIL_VIEW, MotionTask, MotionWeights
from labs.tasks.motion.tip_constraints import Ball, ObstacleConstraint, TipTargetConstraint

CONTINUOUS_MOTIONS: Mapping[str, MotionTask] = {
    "mass": MotionTask("Mass on a line", (1.0,), (1.0,), RAIL_VIEW),
    **MOTIONS,
}
OBJECTIVES: Mapping[str, str] = {
    "weighted": "Weighted",
    "least-time": "Least time",
    "least-energy": "Least energy",
    "fastest-end": "Greatest final speed",
}


@dataclass(frozen=True)
class MotionLimits:
    """Of a motion. Hard ones are constraints; soft ones cost weight |excess|^2 a second."""

    q_lower: tuple[float, ...] = ()
    """[rad; m] of each joint; empty: none."""
    q_upper: tuple[float, ...] = ()
    velocity: float = np.inf
    """[rad/s; m/s] of every joint."""
    control: float = np.inf
    """In units of u_0; always hard."""
    obstacles: tuple[Ball, ...] = ()
    """What the tip must stay out of."""
    soft_weight: float | None = None
    """Of soft limits; None: they are hard."""


def continuous_motion(
    name: str,
    objective: str,
    T: float,
    *,
    weights: MotionWeights | None = None,
    limits: MotionLimits | None = None,
    target: np.ndarray | None = None,
    T_limits: tuple[float, float] | None = None,
) -> ContinuousProblem:
    """The motion of this name, a key of CONTINUOUS_MOTIONS, with an objective of OBJECTIVES in T
    [s], or where T_limits are given in a time between these. `weights` are of the weighted one,
    `target` is p* (3,) [m] of a reach. Raises LabError."""
    if name not in CONTINUOUS_MOTIONS:
        raise LabError(f"no motion is named {name!r}; there are {', '.join(CONTINUOUS_MOTIONS)}")
    if objective not in OBJECTIVES:
        raise LabError(f"no objective is named {objective!r}; there are {', '.join(OBJECTIVES)}")
    if objective == "least-time" and T_limits is None:
        raise LabError("the least time takes limits between which T is free")
    motion, system = CONTINUOUS_MOTIONS[name], mechanism(name)
    n, home, u_0 = system.nq, system.arm.home, np.array(motion.control_scale)
    limits = limits or MotionLimits()
    if not motion.goal and target is None:
        raise LabError(f"{name} takes a target for its tip: (3,) [m]")
    none = np.full(2 * n, np.inf)
    x_lower, x_upper = -none, none.copy()
    if limits.q_lower:
        x_lower[:n] = limits.q_lower
    if limits.q_upper:
        x_upper[:n] = limits.q_upper
    x_lower[n:], x_upper[n:] = -limits.velocity, limits.velocity
    path = ObstacleConstraint(system, limits.obstacles) if limits.obstacles else None
    soft = None
    if limits.soft_weight is not None:
        soft = SoftLimits(limits.soft_weight, x_lower, x_upper, path)
        x_lower, x_upper, path = -none, none, None
    x_final, end = None, None
    if objective != "weighted":
        x_final = np.full(2 * n, np.nan)
        if motion.goal:
            x_final[:n] = motion.goal
        elif target is not None:
            end = TipTargetConstraint(system, target)
        if objective != "fastest-end":
            x_final[n:] = 0.0
    bound = limits.control * u_0
    return ContinuousProblem(
        system,
        _cost(name, objective, weights or MotionWeights(300.0, 10.0, 0.1, 0.01, 1.0), target, soft),
        np.concatenate([home, np.zeros(n)]),
        T,
        x_lower,
        x_upper,
        -bound,
        bound,
        x_final,
        T_limits,
        path,
        end,
        *state_and_control_names(system),
    )


def _cost(
    name: str,
    objective: str,
    weights: MotionWeights,
    target: np.ndarray | None,
    soft: SoftLimits | None,
) -> ContinuousMotionCost:
    motion, system = CONTINUOUS_MOTIONS[name], mechanism(name)
    n, u_0 = system.nq, np.array(motion.control_scale)
    per_control, nothing = np.diag(1.0 / u_0**2), np.zeros((2 * n, 2 * n))
    x_ref = np.concatenate([motion.goal or system.arm.home, np.zeros(n)])
    u_ref, c = system.equilibrium_control(system.arm.home), np.zeros(2 * n)
    if objective == "weighted":
        tip_cost = None
        if not motion.goal and target is not None:
            tip_cost = TipCost(system, target, weights.goal)
        return ContinuousMotionCost(
            0.0,
            np.diag(np.repeat([weights.posture, weights.velocity], n)),
            weights.control * per_control,
            np.diag(np.repeat([0.0 if tip_cost else weights.goal, weights.rest], n)),
            c,
            x_ref,
            u_ref,
            tip_cost,
            soft,
        )
    if objective == "fastest-end":
        c[n + motion.shown_joint] = 1.0
    w_T, R = float(objective == "least-time"), per_control * (objective == "least-energy")
    return ContinuousMotionCost(w_T, nothing, R, nothing, c, x_ref, u_ref, None, soft)
