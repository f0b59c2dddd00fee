"""A plan played on the real plant, open loop beside feedback (notes, 2.4.6): DDP's, and those of
collocation and multiple shooting.

From x_0, at every tick k of the plan (each h seconds), the two runs set

    open loop   u = u_bar_k
    feedback    u = u_bar_k + K_k (x + n - x_bar_k)

within the bound, and hold it; n is the noise of the measured state. Both plants go on between
ticks in steps of SUBSTEP by the classical Runge-Kutta method, under the same disturbing torque.
"""

from dataclasses import dataclass, replace

import numpy as np

from labs.algorithms.integrators import Acceleration, rk4

SUBSTEP = 0.005
"""[s] of integration; the step h of a plan is a whole number of them."""
LARGEST_VELOCITY = 1e3
"""[rad/s; m/s] a run with a faster joint has diverged, and stops."""
FEEDBACK, OPEN_LOOP = 0, 1
"""The rows of the two playback."""


@dataclass(frozen=True)
class NominalTrajectory:
    """What a solver found: x_bar (N + 1, nx), u_bar (N, nu), gains K (N, nu, nx) and h [s]."""

    X: np.ndarray
    U: np.ndarray
    K: np.ndarray
    h: float

    @property
    def N(self) -> int:
        return len(self.U)

    @property
    def substeps(self) -> int:
        """In one step of the plan."""
        return round(self.h / SUBSTEP)


@dataclass(frozen=True)
class Playback:
    """How far both runs have come. Arrays are never written into again."""

    x: np.ndarray
    """(2, nx) now."""
    u: np.ndarray
    """(2, nu) held now."""
    X: np.ndarray
    """(2, N + 1, nx) at the plan's ticks; from the present one on, what is planned."""
    U: np.ndarray
    """(2, N, nu) likewise."""
    clock: int
    """Substeps since the start."""
    diverged: np.ndarray
    """(2,) whether a run has diverged; it stays where it was."""

    def finished(self, plan: NominalTrajectory) -> bool:
        return self.clock >= plan.N * plan.substeps


def start_playback(plan: NominalTrajectory) -> Playback:
    """Both at the plan's start."""
    x, u, X, U = (np.stack([a, a]) for a in (plan.X[0], plan.U[0], plan.X, plan.U))
    return Playback(x, u, X, U, clock=0, diverged=np.zeros(2, bool))


def advance_playback(
    plan: NominalTrajectory,
    playback: Playback,
    plant: tuple[Acceleration, np.ndarray],
    substeps: int,
    bound: np.ndarray | None = None,
    disturbance: np.ndarray | None = None,
    noise: np.ndarray | None = None,
) -> Playback:
    """So many substeps later, or at the plan's end. `plant` is its acceleration and the array
    (nu,) it reads the control from; `bound` (nu,) is the most |u| may be, `disturbance` (nu,)
    is added to what the motors give, `noise` (substeps, nx) to the state measured at each."""
    acceleration, held = plant
    n, end = playback.x.shape[1] // 2, plan.N * plan.substeps
    x, u, clock = playback.x.copy(), playback.u.copy(), playback.clock
    X, U, diverged = playback.X.copy(), playback.U.copy(), playback.diverged.copy()
    step = np.full(n, SUBSTEP)
    for i in range(min(substeps, end - clock)):
        k, since = divmod(clock, plan.substeps)
        if since == 0:
            seen = x[FEEDBACK] if noise is None else x[FEEDBACK] + noise[i]
            u[:] = plan.U[k]
            u[FEEDBACK] += plan.K[k] @ (seen - plan.X[k])
            if bound is not None:
                np.clip(u, -bound, bound, out=u)
            X[:, k], U[:, k] = x, u
        for run in np.flatnonzero(~diverged):
            held[:] = u[run] if disturbance is None else u[run] + disturbance
            with np.errstate(all="ignore"):
                after = np.concatenate(rk4(acceleration, x[run, :n], x[run, n:], step))
            if np.abs(after[n:]).max() <= LARGEST_VELOCITY:
                x[run] = after
            else:
                diverged[run] = True
        clock += 1
    if clock >= end:
        X[:, -1] = x
    return replace(playback, x=x, u=u, X=X, U=U, clock=clock, diverged=diverged)


def apply_state_jump(playback: Playback, change: np.ndarray) -> Playback:
    """Both runs with this sudden change (2, nx) of their states."""
    still = playback.diverged[:, None]
    return replace(playback, x=playback.x + np.where(still, 0.0, change))
