"""What linear MPC solves at every period (notes, 2.5.1): a finite-horizon problem with limits.

    V*_N(x) = minimise  sum_(k<N) l_k(x_k, u_k) + l_f(x_N)
    subject to  x_(k+1) = A x_k + B u_k + c,   x_0 = x,
                x_k in X and u_k in U for k < N,   x_N in X_f

    l_k(x, u) = (x - xr_k)' Q (x - xr_k) / 2 + (u - ur_k)' R (u - ur_k) / 2 + q' x + r' u
    l_f(x)    = (x - xr_N)' Q_f (x - xr_N) / 2

with the half of 2.5.3 (Riccati's P and K do not depend on it). q and r make costs that are not
least at the reference (economic MPC). X may be tightened along the horizon, as tubes and chance
constraints do.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labs.errors import LabError
from labs.problems.linear_quadratic import check_shape, check_weight
from labs.problems.polyhedron import Polyhedron


@dataclass(frozen=True, eq=False)
class LinearMpcProblem:
    """One problem for every x. Raises LabError where shapes do not fit, numbers are not finite, R
    is not positive definite, or Q or Q_f are not semidefinite."""

    N: int
    """At least 1."""
    A: np.ndarray
    """(n, n)"""
    B: np.ndarray
    """(n, m)"""
    Q: np.ndarray
    """(n, n)"""
    R: np.ndarray
    """(m, m)"""
    Q_f: np.ndarray
    """(n, n); zero: no terminal cost."""
    state_set: Polyhedron
    """X, for k = 0 ... N - 1."""
    control_set: Polyhedron
    """U"""
    terminal_set: Polyhedron | None = None
    """X_f; None: anywhere, not even X. The origin is a set of 2 n rows with h = 0."""
    c: np.ndarray | None = None
    """(n,) what the dynamics add at each step."""
    x_ref: np.ndarray | None = None
    """xr (n,) or (N + 1, n); left out it is zero, as all below."""
    u_ref: np.ndarray | None = None
    """ur (m,) or (N, m)"""
    q: np.ndarray | None = None
    """(n,)"""
    r: np.ndarray | None = None
    """(m,)"""
    state_margins: np.ndarray | None = None
    """(N, rows of X), by which X's h is less at step k."""
    control_margins: np.ndarray | None = None
    """(N, rows of U), likewise U's."""

    def __post_init__(self) -> None:
        if self.N < 1:
            raise LabError(f"N = {self.N}: a horizon has at least one step")
        n, m, N = self.n, self.m, self.N
        shapes: dict[str, tuple[tuple[int, ...], ...]] = {
            "A": ((n, n),),
            "B": ((n, m),),
            "Q": ((n, n),),
            "R": ((m, m),),
            "Q_f": ((n, n),),
            "c": ((n,),),
            "x_ref": ((n,), (N + 1, n)),
            "u_ref": ((m,), (N, m)),
            "q": ((n,),),
            "r": ((m,),),
            "state_margins": ((N, len(self.state_set.h)),),
            "control_margins": ((N, len(self.control_set.h)),),
        }
        for name, allowed in shapes.items():
            given = getattr(self, name)
            if given is not None:
                fits = [shape for shape in allowed if np.shape(given) == shape]
                check_shape(name, given, fits[0] if fits else allowed[0])
        for name, size in (("state_set", n), ("control_set", m), ("terminal_set", n)):
            given = getattr(self, name)
            if given is not None and given.n != size:
                raise LabError(f"{name} limits {given.n} numbers; this problem takes {size}")
        check_weight("R", self.R[None], definite=True)
        check_weight("Q", self.Q[None])
        check_weight("Q_f", self.Q_f[None])

    @property
    def n(self) -> int:
        return int(np.shape(self.A)[-1])

    @property
    def m(self) -> int:
        return int(np.shape(self.B)[-1])

    def step(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """A x + B u + c (n,), the state after x (n,) under u (m,)."""
        after: np.ndarray = self.A @ x + self.B @ u
        return after if self.c is None else after + self.c


def check_holds(holds: Sequence[int], N: int) -> None:
    """Raises LabError unless controls held over holds[0], holds[1], ... steps fill N steps."""
    if sum(holds) != N or min(holds) < 1:
        raise LabError(
            f"controls held over {list(holds)} steps: these are {sum(holds)}, and the horizon has "
            f"{N}; each takes at least one"
        )
