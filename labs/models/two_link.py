"""Two revolute joints with parallel axes, compiled: for learning, which takes millions of steps, in
deep Q-learning and Gymnasium.

    M(q) v' + h(q, v) = tau,    M = [a + 2 p    b + p],    h = [p' (2 v1 v2 + v2^2) + g1]
                                    [b + p      c    ]         [-p' v1^2            + g2]

p is a combination of cos q2 and sin q2, p' its derivative; g1, g2 and the tip are combinations of
cos q1, sin q1, cos(q1 + q2) and sin(q1 + q2). All coefficients are read off a Pinocchio model.
A single joint has a second one that nothing moves.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from labs.compiled import compiled


@dataclass(frozen=True, eq=False)
class TwoLink:
    """The numbers of one model."""

    joints: int
    """1 or 2."""
    inertia: np.ndarray
    """(5,) [kg m^2]: a, b, c, and p's of cos q2 and sin q2."""
    gravity: np.ndarray
    """(2, 4) [N m]: of g1 and g2."""

    def without_gravity(self) -> "TwoLink":
        """The same, where motors hold it against gravity."""
        return TwoLink(self.joints, self.inertia, np.zeros((2, 4)))


def two_link(model: pin.Model) -> TwoLink:
    """Of a model of one joint, or of two whose axes are parallel and point the same way."""
    data, n = model.createData(), int(model.nv)
    if n == 1:
        at_rest, up = (pin.computeGeneralizedGravity(model, data, np.array([q]))[0]
                       for q in (0.0, np.pi / 2))  # fmt: skip
        m = pin.crba(model, data, np.zeros(1))[0, 0]
        return TwoLink(1, np.array([m, 0.0, 1.0, 0.0, 0.0]),
                       np.array([[at_rest, up, 0.0, 0.0], np.zeros(4)]))  # fmt: skip
    ahead, across, back = (
        np.array(pin.crba(model, data, np.array([0.0, q]))) for q in (0.0, np.pi / 2, np.pi)
    )
    b = 0.5 * (ahead[0, 1] + back[0, 1])
    inertia = [0.5 * (ahead[0, 0] + back[0, 0]), b, ahead[1, 1], ahead[0, 1] - b, across[0, 1] - b]
    Q = sample_postures()
    g = np.array([pin.computeGeneralizedGravity(model, data, q) for q in Q])
    gravity = np.linalg.lstsq(joint_direction_features(Q), g, rcond=None)[0].T
    return TwoLink(2, np.array(inertia), np.ascontiguousarray(gravity))


def sample_postures() -> np.ndarray:
    """(9, 2) postures, enough to tell the directions apart."""
    turns = np.array([0.0, 1.0, 2.5])
    return np.stack(np.meshgrid(turns, turns), axis=-1).reshape(-1, 2)


def joint_direction_features(Q: np.ndarray) -> np.ndarray:
    """(k, 4): cos q1, sin q1, cos(q1 + q2), sin(q1 + q2) of Q (k, 2)."""
    first, both = Q[:, 0], Q[:, 0] + Q[:, 1]
    return np.stack([np.cos(first), np.sin(first), np.cos(both), np.sin(both)], axis=1)


@compiled
def simulate_two_link(
    joints: int, inertia: np.ndarray, gravity: np.ndarray, X: np.ndarray,
    torques: np.ndarray, limits: np.ndarray, h: float, substeps: int,
) -> np.ndarray:  # fmt: skip
    """States X (k, nx), which begin with q and v, after so many substeps v += h v', q += h v under
    constant torques (k, joints) [N m]; no joint gets faster than its limit (joints,) [rad/s]."""
    X, (a, b, c, by_cos, by_sin) = X.copy(), inertia
    q, v, tau = np.zeros(2), np.zeros(2), np.zeros(2)
    for i in range(len(X)):
        q[:joints], v[:joints] = X[i, :joints], X[i, joints : 2 * joints]
        tau[:joints] = torques[i]
        for _ in range(substeps):
            cos, sin = np.cos(q[1]), np.sin(q[1])
            p, dp = by_cos * cos + by_sin * sin, by_sin * cos - by_cos * sin
            first, both = (np.cos(q[0]), np.sin(q[0])), (np.cos(q[0] + q[1]), np.sin(q[0] + q[1]))
            g, left = gravity, np.empty(2)
            for j in range(2):
                left[j] = tau[j] - (
                    g[j, 0] * first[0] + g[j, 1] * first[1] + g[j, 2] * both[0] + g[j, 3] * both[1]
                )
            left[0] -= dp * (2.0 * v[0] + v[1]) * v[1]
            left[1] += dp * v[0] * v[0]
            m11, m12 = a + 2.0 * p, b + p
            determinant = m11 * c - m12 * m12
            v[0] += h * (c * left[0] - m12 * left[1]) / determinant
            v[1] += h * (m11 * left[1] - m12 * left[0]) / determinant
            for j in range(joints):
                v[j] = min(max(v[j], -limits[j]), limits[j])
            q += h * v
        X[i, :joints], X[i, joints : 2 * joints] = q[:joints], v[:joints]
    return X
