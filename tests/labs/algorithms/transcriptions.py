"""What the tests of all transcriptions share: derivatives by finite differences, and problems with
a known solution."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_discrete_are  # noqa: F401

from labs.models.mechanisms import mechanism
from labs.problems.continuous_control import ContinuousProblem
from labs.problems.nonlinear_program import NonlinearProgram
from labs.resumable import run_to_completion
from labs.tasks.motion.continuous import MotionLimits, continuous_motion
from labs.tasks.motion.continuous_cost import ContinuousMotionCost
from labs.tasks.motion.tip_constraints import Ball

EPSILON = 1e-6
REACH_TARGET = np.array([0.4, -0.35, 0.25])


def check_derivatives(program: NonlinearProgram, y: np.ndarray, seed: int = 0) -> None:
    """First and second ones at y along random directions, against central differences."""
    rng, d = np.random.default_rng(seed), program.derivatives(y)
    values = program.values(y)
    lam, mu = rng.normal(size=len(values.c)), rng.uniform(size=len(values.g))

    def gradient(at: np.ndarray) -> np.ndarray:
        d = program.derivatives(at)
        return np.asarray(d.f_y + d.c_y.T @ lam + d.g_y.T @ mu)

    H = run_to_completion(program.hessian(y, lam, mu, exact=True))
    np.testing.assert_allclose((H - H.T).data, 0.0, atol=1e-9 * np.abs(H.data).max())
    for _ in range(4):
        s = rng.normal(size=len(y))
        ahead, behind = y + EPSILON * s, y - EPSILON * s
        after, before = program.values(ahead), program.values(behind)
        pairs = [
            (d.f_y @ s, (after.f - before.f) / (2 * EPSILON)),
            (d.c_y @ s, (after.c - before.c) / (2 * EPSILON)),
            (d.g_y @ s, (after.g - before.g) / (2 * EPSILON)),
            (H @ s, (gradient(ahead) - gradient(behind)) / (2 * EPSILON)),
        ]
        for found, expected in pairs:
            scale = np.abs(expected).max() if np.size(expected) else 1.0
            np.testing.assert_allclose(found, expected, atol=2e-7 * max(scale, 1.0))
    f_yy = run_to_completion(program.hessian(y, lam, mu, exact=False)).toarray()
    assert np.linalg.eigvalsh(f_yy)[0] >= -1e-9 * np.abs(f_yy).max()


@dataclass(frozen=True)
class Guess:
    """A trajectory to begin with."""

    X: np.ndarray
    U: np.ndarray


def straight_guess(problem: ContinuousProblem, N: int) -> Guess:
    """A straight line to what the cost refers to, or of a reach a rest, its control what holds
    the start."""
    assert isinstance(problem.cost, ContinuousMotionCost)
    end = problem.cost.x_ref
    X = problem.x0 + np.linspace(0.0, 1.0, N + 1)[:, None] * (end - problem.x0)
    return Guess(X, np.tile(problem.cost.u_ref, (N, 1)))


def regulated_mass(T: float = 2.0) -> ContinuousProblem:
    """A double integrator with a quadratic cost, without limits: linear-quadratic."""
    problem = continuous_motion("mass", "weighted", T, limits=MotionLimits())
    return problem


def minimum_energy() -> ContinuousProblem:
    """The mass, 1 m in 2 s from rest to rest: u = 3/2 - 3/2 t, int u^2 dt = 3/2."""
    return continuous_motion("mass", "least-energy", 2.0)


def minimum_time() -> ContinuousProblem:
    """The mass, 1 m from rest to rest with |u| <= 1 N: T = 2 s, switching at 1 s."""
    limits = MotionLimits(control=1.0)
    return continuous_motion("mass", "least-time", 3.0, limits=limits, T_limits=(0.5, 6.0))


def limited_reach(
    control: float, objective: str = "least-energy", T_limits: tuple[float, float] | None = None
) -> ContinuousProblem:
    """The UR5 within 0.85 rad of home and 1.8 rad/s, around a ball in the midst of its way."""
    body = mechanism("ur5")
    home, middle = body.arm.home, 0.5 * (body.tip(body.arm.home) + REACH_TARGET)
    limits = MotionLimits(
        tuple(home - 0.85),
        tuple(home + 0.85),
        1.8,
        control,
        (Ball(middle + np.array([0.03, 0.0, 0.0]), 0.06),),
    )
    return continuous_motion(
        "ur5", objective, 0.7, limits=limits, target=REACH_TARGET, T_limits=T_limits
    )
