"""What receding-horizon control asks at every period (notes, 2.5): a plan from the measured state,
by linear or by nonlinear MPC, nominal, robust or stochastic.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from labs.resumable import Resumable


@dataclass(frozen=True, eq=False)
class Plan:
    """What an optimiser answered. Arrays are never written after they are made."""

    X: np.ndarray
    """(N + 1, nx) the predicted states, the first of them the measured one; that of a tube may be
    another."""
    U: np.ndarray
    """(N, nu) the controls."""
    cost: float
    """V_N of this plan; NaN where there is none."""
    found: bool
    """Whether X and U meet the constraints and what the optimiser calls solved; a real-time
    iteration counts as found where its QP was."""
    message: str
    """Why it stopped, in a sentence: solved; infeasible, with what and when."""
    active: Mapping[str, np.ndarray] = field(default_factory=dict)
    """By kind ("position", "velocity", "state", "control", "terminal", ...), whether each limit is
    active: (how many steps, how many limits) booleans; what limits x_N alone has one step."""
    K: np.ndarray | None = None
    """(nu, nx) what acts is u_k + K (x - x_k), where a gain goes with the plan."""
    violation: float = 0.0
    """By how much softened limits are exceeded."""
    gap: float = 0.0
    """Largest |x_(k+1) - f(x_k, u_k)| about which the plan was linearised, where X are variables
    of their own and the optimiser was not iterated to the end."""
    iterations: int = 0
    """Of the optimiser, at this period."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Wall-clock time by phase ("derivatives", "QP", "rest"), for show alone."""


class Planner(Protocol):
    """Solves the finite-horizon problem, from scratch or warm."""

    def plan(self, x: np.ndarray, guess: Plan | None, N: int | None = None) -> Resumable[Plan]:
        """The plan from x (nx,), which starts from `guess` where it can; over N steps instead of
        the usual number where it is given (shrinking horizon). What is infeasible is a plan that
        was not found, never an exception. Pauses between pieces of some milliseconds."""
        ...
