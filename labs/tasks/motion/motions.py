"""Motions to plan, by DDP, by the direct methods and by MPC: a swing-up of every pendulum, and a
reach of the UR5.

A mechanism starts at rest at x_0 and should end at rest at a goal: a posture q* (swing-ups), or
a place p* of its tip (the reach). Over N steps of h [s], with u_0 a natural size of the controls,

    J = h sum_(t<N) (w_q |q_t - q_ref|^2 + w_v |v_t|^2 + w_u |(u_t - u_ref) / u_0|^2)
        + w_f |q_N - q*|^2 + w_vf |v_N|^2                   of a reach: w_f |p(q_N) - p*|^2

q_ref is q* of a swing-up and the start of a reach; u_ref holds x_0 against gravity. The weights
are scaled so that the same ones serve all mechanisms.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from labs.errors import LabError
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import mechanism
from labs.problems.optimal_control import OptimalControlProblem
from labs.shapes import Vector3
from labs.tasks.motion.cost import MotionCost, TipCost


@dataclass(frozen=True)
class MotionTask:
    """What one mechanism is to do."""

    title: str
    goal: tuple[float, ...]
    """q* (nq,) [rad; m], empty where the tip has a place to reach."""
    control_scale: tuple[float, ...]
    """u_0 (nu,) [N m; N]: what holds a pendulum level; the motors' limits of cart and arm."""
    camera: tuple[Vector3, Vector3]
    """Where a viewer stands and what it looks at [m]."""
    shown_joint: int = 0
    """The joint whose phase portrait tells most."""


NEAR_VIEW = ((1.5, 0.6, 0.95), (0.0, 0.0, 0.72))
FAR_VIEW = ((2.6, 1.0, 1.5), (0.0, 0.0, 1.2))
RAIL_VIEW = ((2.3, 0.6, 1.1), (0.0, 0.0, 0.75))
ROBOT_VIEW = ((1.15, -0.85, 0.8), (0.22, -0.02, 0.33))
MOTIONS: Mapping[str, MotionTask] = {
    "pendulum": MotionTask("Pendulum", (np.pi,), (4.905,), NEAR_VIEW),
    "double-pendulum": MotionTask("Double pendulum", (np.pi, 0.0), (19.62, 4.905), FAR_VIEW),
    "acrobot": MotionTask("Acrobot: elbow driven alone", (np.pi, 0.0), (4.905,), FAR_VIEW),
    "pendubot": MotionTask("Pendubot: shoulder driven alone", (np.pi, 0.0), (19.62,), FAR_VIEW),
    "cart-pole": MotionTask("Cart-pole", (0.0, np.pi), (20.0,), RAIL_VIEW, shown_joint=1),
    "ur5": MotionTask(
        "UR5, reaching", (), (150.0, 150.0, 150.0, 28.0, 28.0, 28.0), ROBOT_VIEW, shown_joint=1
    ),
}


@dataclass(frozen=True)
class MotionWeights:
    """Of J."""

    goal: float
    """w_f [1/rad^2; 1/m^2 of a cart or a tip]"""
    rest: float
    """w_vf [s^2/rad^2; s^2/m^2]"""
    posture: float
    """w_q [1/(rad^2 s); 1/(m^2 s)]"""
    velocity: float
    """w_v [s/rad^2; s/m^2]"""
    control: float
    """w_u [1/s]"""


def motion_problem(
    name: str,
    weights: MotionWeights,
    N: int,
    h: float,
    *,
    method: str = "rk4",
    target: np.ndarray | None = None,
    limit: float = np.inf,
) -> OptimalControlProblem:
    """The motion of this name, a key of MOTIONS. `target` is p* (3,) [m] of a reach, `method` a
    name of INTEGRATORS, and `limit` times u_0 is the most that |u| may be. Raises LabError."""
    if name not in MOTIONS:
        raise LabError(f"no motion is named {name!r}; there are {', '.join(MOTIONS)}")
    motion, system = MOTIONS[name], mechanism(name)
    n, home, u_0 = system.nq, system.arm.home, np.array(motion.control_scale)
    at_rest, tip_cost = np.zeros(n), None
    if not motion.goal:
        if target is None:
            raise LabError(f"{name} takes a target for its tip: (3,) [m]")
        tip_cost = TipCost(system, target, weights.goal)
    cost = MotionCost(
        N,
        Q=h * np.diag(np.repeat([weights.posture, weights.velocity], n)),
        R=h * np.diag(weights.control / u_0**2),
        Q_f=np.diag(np.repeat([0.0 if tip_cost else weights.goal, weights.rest], n)),
        x_ref=np.concatenate([motion.goal or home, at_rest]),
        u_ref=system.equilibrium_control(home),
        tip_cost=tip_cost,
    )
    bound = limit * u_0 if np.isfinite(limit) else None
    x0 = np.concatenate([home, at_rest])
    return OptimalControlProblem(DiscreteMechanism(system, h, method), cost, x0, N, bound)


def initial_controls(
    problem: OptimalControlProblem, u_0: np.ndarray, amplitude: float, rate: float
) -> np.ndarray:
    """U (N, nu) = u_ref + amplitude u_0 cos(2 pi rate t), with u_0 (nu,) and `rate` in Hz; at
    rate 0 it is a constant push. Within the bound of the problem."""
    assert isinstance(problem.cost, MotionCost)
    assert isinstance(problem.dynamics, DiscreteMechanism)
    t = problem.dynamics.h * np.arange(problem.N)
    U = problem.cost.u_ref + amplitude * np.cos(2.0 * np.pi * rate * t)[:, None] * u_0
    return clip_controls(problem, U)


def resample_controls(U: np.ndarray, h: float, new_h: float, N: int) -> np.ndarray:
    """The controls (k, nu), each held for h, as N that are held for new_h; beyond their end the
    last one lasts."""
    middle = (np.arange(N) + 0.5) * new_h
    return np.asarray(U[np.minimum((middle / h).astype(int), len(U) - 1)])


def clip_controls(problem: OptimalControlProblem, U: np.ndarray) -> np.ndarray:
    """U (N, nu) cut to the bound of the problem."""
    return U if problem.bound is None else np.clip(U, -problem.bound, problem.bound)
