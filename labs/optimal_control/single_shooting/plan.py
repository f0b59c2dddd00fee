"""What one iterate of the solver means: its motion, as planned and as it really goes, and how much
each state depends on each control."""

from dataclasses import dataclass

import numpy as np

from labs.algorithms.single_shooting import SingleShooting
from labs.optimal_control.single_shooting.params import SingleShootingParams
from labs.optimal_control.single_shooting.simulation import simulate_plan, tracking_gains
from labs.problems.optimal_control import LARGEST_STATE

LARGEST_CONDITION = 1e15
"""Beyond it a condition number is rounding alone."""


@dataclass(frozen=True, eq=False)
class ShootingPlan:
    """Plain data; arrays are never written into again."""

    U: np.ndarray
    """(N, nu) the control of each piece."""
    X: np.ndarray
    """(N M + 1, nx) as planned."""
    T: float
    """[s]"""
    integrator: str
    simulated: np.ndarray
    """(k N + 1, nx) the same controls, integrated finely."""
    tracked: np.ndarray
    """Likewise, with a regulator about the plan,"""
    tracked_U: np.ndarray
    """(N, nu) which gives these."""
    influence: np.ndarray
    """(N + 1, N): |dx(t_i) / d(u_k / u_0)|, in the states' units."""
    condition: float
    """Of the equations of a Newton step, [H J'; J 0] with H by Gauss-Newton and J of the end that
    is to be met, over u / u_0; 0 where they are singular."""

    @property
    def N(self) -> int:
        return len(self.U)

    @property
    def M(self) -> int:
        return (len(self.X) - 1) // self.N

    @property
    def integration_error(self) -> float:
        """|x(T) planned - simulated|."""
        return float(np.linalg.norm(self.X[-1] - self.simulated[-1]))

    def simulated_run(self, feedback: bool) -> tuple[np.ndarray, np.ndarray]:
        """States and controls of the simulation, with feedback or without."""
        return (self.tracked, self.tracked_U) if feedback else (self.simulated, self.U)


def interpolate_state(X: np.ndarray, T: float, t: float) -> np.ndarray:
    """x (nx,) at t [s] on the even grid X (k + 1, nx) over [0, T], linear in between."""
    place = min(max(t / T, 0.0), 1.0) * (len(X) - 1)
    j = min(int(place), len(X) - 2)
    return np.asarray(X[j] + (place - j) * (X[j + 1] - X[j]))


def make_plan(
    params: SingleShootingParams, shooting: SingleShooting, y: np.ndarray
) -> ShootingPlan:
    """Of the variables y, whose rollout does not diverge."""
    u_0, N, nu = params.task.u_0, shooting.N, shooting.nu
    at = shooting.linearize(y, gauss_newton=True)
    S = shooting.sensitivities(at)
    by_control = S[:: shooting.M, :, : N * nu].reshape(N + 1, shooting.nx, N, nu) * u_0
    hessian = shooting.gauss_newton_hessian(y, at, S)[: N * nu, : N * nu]
    scale, T = np.tile(u_0, N), shooting.horizon(y)
    end = shooting.end_sensitivities(y, S)[:, : N * nu] * scale
    U, X = shooting.controls(y).copy(), shooting.rollout(y).X
    nodes, K = X[:: shooting.M], tracking_gains(at, N, u_0)
    simulated, _ = simulate_plan(params.task, nodes, U, np.zeros_like(K), T)
    return ShootingPlan(
        U,
        X,
        T,
        params.integrator,
        simulated,
        *simulate_plan(params.task, nodes, U, K, T),
        np.linalg.norm(by_control, axis=(1, 3)),
        _condition_number(scale[:, None] * hessian * scale, end),
    )


def hold_after_divergence(X: np.ndarray) -> np.ndarray:
    """X (k + 1, nx), resting at its last state that has not diverged."""
    with np.errstate(invalid="ignore"):
        sound = np.abs(X).max(axis=1) <= LARGEST_STATE
    last = len(X) - 1 if sound.all() else int(np.argmin(sound)) - 1
    return np.asarray(X[np.minimum(np.arange(len(X)), last)])


def _condition_number(H: np.ndarray, J: np.ndarray) -> float:
    """The ratio of the largest and the least singular value."""
    m = len(J)
    values = np.abs(np.linalg.eigvalsh(np.block([[H, J.T], [J, np.zeros((m, m))]])))
    ratio = values.max() / max(values.min(), 1e-300)
    return float(ratio) if ratio < LARGEST_CONDITION else 0.0
