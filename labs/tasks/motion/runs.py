"""A planned policy on the real plant, open loop beside feedback (notes, 2.4.6).

From x_0, at every tick k of the plan (each h seconds), the two runs set

    open loop   u = u_bar_k
    feedback    u = u_bar_k + K_k (x + n - x_bar_k)

within the bound, and hold it; n is the noise of the measured state. Both plants go on between
ticks in steps of QUANTUM by the classical Runge-Kutta method, under the same disturbing torque.
"""

from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms.integrators import Acceleration, rk4

QUANTUM = 0.005
"""[s] of integration; the step h of a plan is a whole number of them."""
FASTEST = 1e3
"""[rad/s; m/s] a run with a faster joint has diverged, and stops."""
FEEDBACK, OPEN_LOOP = 0, 1
"""The rows of the two runs."""


@dataclass(frozen=True)
class Policy:
    """What a solver found: x_bar (N + 1, nx), u_bar (N, nu), K (N, nu, nx) and h [s]."""

    X: np.ndarray
    U: np.ndarray
    K: np.ndarray
    h: float

    @property
    def N(self) -> int:
        return len(self.U)

    @property
    def quanta(self) -> int:
        """In one step of the plan."""
        return round(self.h / QUANTUM)


@dataclass(frozen=True)
class Runs:
    """How far both have come. Arrays are never written into again."""

    x: np.ndarray
    """(2, nx) now."""
    u: np.ndarray
    """(2, nu) held now."""
    X: np.ndarray
    """(2, N + 1, nx) at the plan's ticks; from the present one on, what is planned."""
    U: np.ndarray
    """(2, N, nu) likewise."""
    clock: int
    """Quanta since the start."""
    lost: np.ndarray
    """(2,) whether a run has diverged; it stays where it was."""

    def finished(self, policy: Policy) -> bool:
        return self.clock >= policy.N * policy.quanta


def begin(policy: Policy) -> Runs:
    """Both at the plan's start."""
    x, u, X, U = (np.stack([a, a]) for a in (policy.X[0], policy.U[0], policy.X, policy.U))
    return Runs(x, u, X, U, clock=0, lost=np.zeros(2, bool))


def advance(
    policy: Policy,
    runs: Runs,
    plant: tuple[Acceleration, np.ndarray],
    quanta: int,
    bound: np.ndarray | None = None,
    disturbance: np.ndarray | None = None,
    noise: np.ndarray | None = None,
) -> Runs:
    """So many quanta later, or at the plan's end. `plant` is its acceleration and the array
    (nu,) it reads the control from; `bound` (nu,) is the most |u| may be, `disturbance` (nu,)
    is added to what the motors give, `noise` (quanta, nx) to the state measured at each."""
    acceleration, held = plant
    n, end = runs.x.shape[1] // 2, policy.N * policy.quanta
    x, u, lost, clock = runs.x.copy(), runs.u.copy(), runs.lost.copy(), runs.clock
    X, U = runs.X.copy(), runs.U.copy()
    step = np.full(n, QUANTUM)
    for i in range(min(quanta, end - clock)):
        k, since = divmod(clock, policy.quanta)
        if since == 0:
            seen = x[FEEDBACK] if noise is None else x[FEEDBACK] + noise[i]
            u[:] = policy.U[k]
            u[FEEDBACK] += policy.K[k] @ (seen - policy.X[k])
            if bound is not None:
                np.clip(u, -bound, bound, out=u)
            X[:, k], U[:, k] = x, u
        for run in np.flatnonzero(~lost):
            held[:] = u[run] if disturbance is None else u[run] + disturbance
            with np.errstate(all="ignore"):
                after = np.concatenate(rk4(acceleration, x[run, :n], x[run, n:], step))
            if np.abs(after[n:]).max() <= FASTEST:
                x[run] = after
            else:
                lost[run] = True
        clock += 1
    if clock >= end:
        X[:, -1] = x
    return replace(runs, x=x, u=u, X=X, U=U, clock=clock, lost=lost)


def kicked(runs: Runs, change: np.ndarray) -> Runs:
    """Both runs with this sudden change (2, nx) of their states."""
    return replace(runs, x=runs.x + np.where(runs.lost[:, None], 0.0, change))
