"""A nonlinear programme, as the discretised problems of the direct methods are (notes, 2.3.1), in
shooting, collocation and the brachistochrone.

    minimise f(y)   subject to   c(y) = 0,   g(y) <= 0,   lower <= y <= upper

Its Lagrangian is L = f + lam' c + mu' g + nu' y, with mu >= 0, and nu > 0 where y pushes against
an upper bound, nu < 0 against a lower one.
"""

from typing import NamedTuple, Protocol

import numpy as np
from scipy.sparse import csc_array

from labs.resumable import Resumable


class ProgramValues(NamedTuple):
    """At a point; f is infinite where the programme has no value, as of a diverged rollout."""

    f: float
    c: np.ndarray
    """(number of equalities,)"""
    g: np.ndarray
    """(number of inequalities,)"""


class ProgramDerivatives(NamedTuple):
    """First ones, at a point. The pattern of a Jacobian is the same everywhere."""

    f_y: np.ndarray
    """(n,)"""
    c_y: csc_array
    g_y: csc_array


class NonlinearProgram(Protocol):
    """What a solver asks. Arrays it gets are never written into."""

    @property
    def lower(self) -> np.ndarray:
        """(n,), -inf where there is none."""
        ...

    @property
    def upper(self) -> np.ndarray:
        """(n,), inf where there is none."""
        ...

    @property
    def free_time(self) -> bool:
        """Whether the last variable is a final time, which stretches all that happens."""
        ...

    def values(self, y: np.ndarray) -> ProgramValues:
        """At y (n,)."""
        ...

    def derivatives(self, y: np.ndarray) -> ProgramDerivatives:
        """At y (n,)."""
        ...

    def hessian(
        self, y: np.ndarray, lam: np.ndarray, mu: np.ndarray, exact: bool
    ) -> Resumable[csc_array]:
        """Of L (n, n), symmetric, exactly; or by Gauss-Newton: of f alone, and never indefinite.
        Pauses within what takes long."""
        ...

    def equality_name(self, i: int) -> str:
        """What c_i says, for a sentence: "the defect of step 12"."""
        ...

    def inequality_name(self, i: int) -> str:
        """What g_i says, for a sentence: "the tip's distance from obstacle 1 at t = 0.4 s"."""
        ...

    def variable_name(self, i: int) -> str:
        """What y_i is, for a sentence about its bound: "torque 2 at t = 0.4 s"."""
        ...
