"""Motions to plan: a swing-up of every pendulum, and a reach of the UR5.

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
import pinocchio as pin

from labs.errors import LabError
from labs.models.discrete import Discrete
from labs.models.mechanisms import Mechanism, mechanism
from labs.problems.optimal_control import Problem
from labs.shapes import Vector3
from labs.tasks.motion.cost import MotionCost, Reach


@dataclass(frozen=True)
class Motion:
    """What one mechanism is to do."""

    title: str
    goal: tuple[float, ...]
    """q* (nq,) [rad; m], empty where the tip has a place to reach."""
    size: tuple[float, ...]
    """u_0 (nu,) [N m; N]: what holds a pendulum level; the motors' limits of cart and arm."""
    camera: tuple[Vector3, Vector3]
    """Where a viewer stands and what it looks at [m]."""
    shown: int = 0
    """The joint whose phase portrait tells most."""


NEAR = ((1.5, 0.6, 0.95), (0.0, 0.0, 0.72))
FAR = ((2.6, 1.0, 1.5), (0.0, 0.0, 1.2))
RAIL = ((2.3, 0.6, 1.1), (0.0, 0.0, 0.75))
ROBOT = ((1.15, -0.85, 0.8), (0.22, -0.02, 0.33))
MOTIONS: Mapping[str, Motion] = {
    "pendulum": Motion("Pendulum", (np.pi,), (4.905,), NEAR),
    "double-pendulum": Motion("Double pendulum", (np.pi, 0.0), (19.62, 4.905), FAR),
    "acrobot": Motion("Acrobot: elbow driven alone", (np.pi, 0.0), (4.905,), FAR),
    "pendubot": Motion("Pendubot: shoulder driven alone", (np.pi, 0.0), (19.62,), FAR),
    "cart-pole": Motion("Cart-pole", (0.0, np.pi), (20.0,), RAIL, shown=1),
    "ur5": Motion("UR5, reaching", (), (150.0, 150.0, 150.0, 28.0, 28.0, 28.0), ROBOT, shown=1),
}


@dataclass(frozen=True)
class Weights:
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
    weights: Weights,
    N: int,
    h: float,
    *,
    method: str = "rk4",
    target: np.ndarray | None = None,
    limit: float = np.inf,
) -> Problem:
    """The motion of this name, a key of MOTIONS. `target` is p* (3,) [m] of a reach, `method` a
    name of INTEGRATORS, and `limit` times u_0 is the most that |u| may be. Raises LabError."""
    if name not in MOTIONS:
        raise LabError(f"no motion is named {name!r}; there are {', '.join(MOTIONS)}")
    motion, moved = MOTIONS[name], mechanism(name)
    n, size = moved.nq, np.array(motion.size)
    at_rest, x0 = np.zeros(n), np.concatenate([moved.arm.home, np.zeros(n)])
    reach = None
    if not motion.goal:
        if target is None:
            raise LabError(f"{name} takes a target for its tip: (3,) [m]")
        reach = Reach(moved, target, weights.goal)
    cost = MotionCost(
        N,
        Q=h * np.diag(np.repeat([weights.posture, weights.velocity], n)),
        R=h * np.diag(weights.control / size**2),
        Q_f=np.diag(np.repeat([0.0 if reach else weights.goal, weights.rest], n)),
        x_ref=np.concatenate([motion.goal or moved.arm.home, at_rest]),
        u_ref=moved.holding(moved.arm.home),
        reach=reach,
    )
    bound = limit * size if np.isfinite(limit) else None
    return Problem(Discrete(moved, h, method), cost, x0, N, bound)


def first_guess(problem: Problem, size: np.ndarray, amplitude: float, rate: float) -> np.ndarray:
    """U (N, nu) = u_ref + amplitude u_0 cos(2 pi rate t), with u_0 = `size` (nu,) and `rate` in
    Hz; at rate 0 it is a constant push. Within the bound of the problem."""
    assert isinstance(problem.cost, MotionCost)
    assert isinstance(problem.dynamics, Discrete)
    t = problem.dynamics.h * np.arange(problem.N)
    U = problem.cost.u_ref + amplitude * np.cos(2.0 * np.pi * rate * t)[:, None] * size
    return within(problem, U)


def resampled(U: np.ndarray, h: float, new_h: float, N: int) -> np.ndarray:
    """The controls (k, nu), each held for h, as N that are held for new_h; beyond their end the
    last one lasts."""
    middle = (np.arange(N) + 0.5) * new_h
    return np.asarray(U[np.minimum((middle / h).astype(int), len(U) - 1)])


def within(problem: Problem, U: np.ndarray) -> np.ndarray:
    """U (N, nu) cut to the bound of the problem."""
    return U if problem.bound is None else np.clip(U, -problem.bound, problem.bound)


def struck(moved: Mechanism, q: np.ndarray, impulse: np.ndarray) -> np.ndarray:
    """How v (nv,) jumps when an impulse (3,) [N s] strikes the tip at q: M^-1 J' impulse."""
    J = moved.tip_jacobian(q)
    inverse = np.reshape(pin.computeMinverse(moved.model, moved.data, q), (len(q), len(q)))
    return np.asarray(inverse @ J.T @ impulse)


def tips(moved: Mechanism, X: np.ndarray) -> np.ndarray:
    """Where the tip is (k, 3) [m] along X (k, nx)."""
    return np.array([moved.tip(x[: moved.nq]) for x in X])
