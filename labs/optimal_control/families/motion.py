"""What each of the four methods comes to: a motion and its costates, at the same instants."""

from dataclasses import dataclass, replace

import numpy as np

from labs.problems.continuous_control import ContinuousProblem

SAMPLES = 150
"""Instants after the start at which a motion is kept."""


@dataclass(frozen=True, eq=False)
class MethodMotion:
    """A method's motion, if it has found one."""

    t: np.ndarray
    """(SAMPLES + 1,) [s]"""
    X: np.ndarray
    """(SAMPLES + 1, 2)"""
    U: np.ndarray
    """(SAMPLES + 1,)"""
    P: np.ndarray
    """(SAMPLES + 1, 2) costates, multipliers, or the gradient of V."""
    cost: float = 0.0
    """int l dt + l_f along it."""
    promised: float = 0.0
    """What the method said that it would cost: V(x_0) of a table."""
    iterations: int = 0
    known: bool = False
    """Whether there is a motion."""
    converged: bool = False
    """Whether it fulfils the conditions of its method."""
    message: str = "It is on its way."
    """In a sentence."""

    def at(self, t: float) -> np.ndarray:
        """x (2,) at t [s]."""
        return np.array([np.interp(t, self.t, column) for column in self.X.T])

    def control(self, t: float) -> float:
        """u at t [s]."""
        return float(np.interp(t, self.t, self.U))


def time_grid(T: float, start: float = 0.0) -> np.ndarray:
    """From `start` for T [s]."""
    return start + np.linspace(0.0, T, SAMPLES + 1)


def no_motion(problem: ContinuousProblem) -> MethodMotion:
    """Before anything is found: at rest in x_0."""
    still = np.zeros(SAMPLES + 1)
    X = np.tile(problem.x0, (SAMPLES + 1, 1))
    return MethodMotion(time_grid(problem.T), X, still, np.zeros_like(X))


def stretch_motion(motion: MethodMotion, T: float) -> MethodMotion:
    """The same, stretched to T [s]."""
    return replace(motion, t=time_grid(T))


def first_guess(problem: ContinuousProblem, swing: float) -> MethodMotion:
    """From q_0 to 0 and to rest, and on the way out by about `swing` and back; the control that
    this takes, within its limits, and the costates for which that control would minimise H."""
    t = time_grid(problem.T)
    s = t / problem.T
    q = problem.x0[0] * (1.0 - s) ** 2 * (1.0 + 2.0 * s)
    q = q + 4.0 * swing * s * (1.0 - s) * np.sin(2.0 * np.pi * s)
    v = np.gradient(q, t, edge_order=2)
    a = np.gradient(v, t, edge_order=2)
    X, none = np.stack([q, v], axis=1), np.zeros((len(t), 1))
    f, _, f_u = problem.dynamics.derivatives(X, none)
    gain = f_u[:, 1, 0]
    U = np.clip((a - f[:, 1]) / gain, problem.u_lower, problem.u_upper)
    cost = problem.cost.running_derivatives(X, U[:, None], exact=True)
    p_v = -cost.l_u[:, 0] / gain
    p_q = -np.gradient(p_v, t, edge_order=2) - cost.l_x[:, 1]
    return MethodMotion(t, X, U, np.stack([p_q, p_v], axis=1), known=True)
