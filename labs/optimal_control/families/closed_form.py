"""The mass's value function in closed form, where no limit is met: V(x, t) = x' P(t) x.

P solves the Riccati differential equation -P' = Q + A'P + PA - P B R^-1 B' P, P(T) = Q_f, which is
linear in (X, Y) with P = Y X^-1: (X, Y)' = [A, -B R^-1 B'; -Q, -A'] (X, Y).
"""

import numpy as np
from scipy.linalg import expm

from labs.optimal_control.families.motion import MethodMotion, time_grid
from labs.optimal_control.families.params import FamiliesParams


def riccati(params: FamiliesParams, to_go: np.ndarray) -> np.ndarray:
    """P (k, 2, 2) with so much time left (k,) [s]."""
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    B = np.array([[0.0], [1.0 / params.body.inertia]])
    Q, Q_f = np.diag([params.w_q, params.w_v]), np.diag([params.w_f, params.w_vf])
    H = np.block([[A, -B @ B.T / params.w_u], [-Q, -A.T]])
    XY = expm(-H * to_go[:, None, None]) @ np.vstack([np.eye(2), Q_f])
    return np.asarray(XY[:, 2:] @ np.linalg.inv(XY[:, :2]))


def closed_form(params: FamiliesParams, x0: np.ndarray, T: float) -> MethodMotion | None:
    """The optimal motion of the mass from x0 (2,), if it meets no limit."""
    if params.system != "mass":
        return None
    t = time_grid(T)
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    B = np.array([[0.0], [1.0 / params.body.inertia]])
    P_0 = riccati(params, np.array([T]))[0]
    H = np.block([[A, -B @ B.T / params.w_u], [-np.diag([params.w_q, params.w_v]), -A.T]])
    z = expm(H * t[:, None, None]) @ np.concatenate([x0, P_0 @ x0])
    X, P = z[:, :2], 2.0 * z[:, 2:]
    U = -P[:, 1] / (2.0 * params.w_u * params.body.inertia)
    inside = np.abs(U).max() < params.u_max and not params.cost.excess(X[:, 0]).any()
    cost = float(x0 @ P_0 @ x0)
    return MethodMotion(t, X, U, P, cost, cost, known=True, converged=True) if inside else None
