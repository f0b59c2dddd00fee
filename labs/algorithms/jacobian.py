"""Geometric and analytical Jacobian of a frame carried by a serial arm (notes, 1.1.3).

With z_i the axis of joint i, p_i a point on it and p_e the frame's origin, all in the world's
axes, the geometric Jacobian has one column a joint:

    revolute    J_pi = z_i x (p_e - p_i)    J_oi = z_i
    prismatic   J_pi = z_i                  J_oi = 0

so that (p_e', omega) = J(q) q'. The notes' (1.2) mixes the two cases.

With the orientation as roll-pitch-yaw angles phi_o = (zeta, theta, psi), R = Rz(psi) Ry(theta)
Rx(zeta), the angular velocity is omega = T(phi_o) phi_o', the columns of T the axes of the three
(`orientation.euler_axes`), and the analytical Jacobian is

    J_A = d phi / d q = (J_p, T^-1 J_o),    det T = cos theta.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from labs.algorithms.orientation import matrix_to_rpy

SMALLEST_COSINE = 1e-6
"""T is not inverted nearer to its singularity than this cos(theta)."""


@dataclass(frozen=True, eq=False)
class PosedChain:
    """The joints of an arm at one posture, and the frame they move; the world's axes."""

    axes: np.ndarray
    """(n, 3) unit vectors z_i."""
    points: np.ndarray
    """(n, 3) [m] the origins p_i of the joints."""
    prismatic: np.ndarray
    """(n,) whether joint i slides."""
    supports: np.ndarray
    """(n,) whether joint i lies between the base and the frame."""
    placement: pin.SE3
    """Of the frame: R_e and p_e [m]."""


class ForwardKinematics:
    """Forward kinematics of an arm of one-degree-of-freedom joints, up to one frame."""

    def __init__(self, model: pin.Model, frame: int) -> None:
        self.model, self.frame = model, frame
        self._data = model.createData()
        n = model.njoints - 1
        # A joint's motion subspace, (6,): linear part, then angular part; one of them is zero.
        subspaces = np.array(
            [np.ravel(model.joints[j].createData().S) for j in range(1, model.njoints)]
        )
        assert subspaces.shape == (n, 6)
        self._prismatic: np.ndarray = ~np.any(subspaces[:, 3:], axis=1)
        self._axes = np.where(self._prismatic[:, None], subspaces[:, :3], subspaces[:, 3:])
        between = set(model.supports[model.frames[frame].parentJoint])
        self._supports = np.array([j in between for j in range(1, model.njoints)])

    def at(self, q: np.ndarray) -> PosedChain:
        """The chain at q (n,) [rad; m where prismatic]."""
        pin.forwardKinematics(self.model, self._data, q)
        placement = pin.updateFramePlacement(self.model, self._data, self.frame).copy()
        joints = self._data.oMi[1:]
        return PosedChain(
            axes=np.array([m.rotation @ z for m, z in zip(joints, self._axes, strict=True)]),
            points=np.array([m.translation for m in joints]),
            prismatic=self._prismatic,
            supports=self._supports,
            placement=placement,
        )


def geometric_jacobian(chain: PosedChain) -> np.ndarray:
    """J (6, n): linear above angular rows, [m/rad, 1; prismatic: 1, 0]."""
    turning = (~chain.prismatic & chain.supports)[:, None]
    sliding = (chain.prismatic & chain.supports)[:, None]
    levers = chain.placement.translation - chain.points
    linear = turning * _cross(chain.axes, levers) + sliding * chain.axes
    return np.concatenate([linear, turning * chain.axes], axis=1).T


def geometric_jacobian_rate(chain: PosedChain, v: np.ndarray) -> np.ndarray:
    """J' (6, n) [1/s times J's units] while the joints move at v (n,) [rad/s; m/s].

    An axis is carried around by the joints before it: z_i' = omega_i x z_i, and
    (z_i x (p_e - p_i))' = z_i' x (p_e - p_i) + z_i x (p_e' - p_i')."""
    n = len(v)
    levers = chain.placement.translation - chain.points
    turning = (~chain.prismatic & chain.supports)[:, None]
    sliding = (chain.prismatic & chain.supports)[:, None]
    spins = turning * chain.axes * v[:, None]
    omega = np.cumsum(spins, axis=0)
    # p_i' by the joints up to i: those that turn, about their own points, and those that slide.
    slides = np.cumsum(sliding * chain.axes * v[:, None], axis=0)
    moments = np.cumsum(_cross(spins, chain.points), axis=0)
    points = _cross(omega, chain.points) - moments + slides
    tip = geometric_jacobian(chain)[:3] @ v
    axes = _cross(omega, chain.axes)
    swing = _cross(axes, levers) + _cross(chain.axes, np.broadcast_to(tip, (n, 3)) - points)
    return np.concatenate([turning * swing + sliding * axes, turning * axes], axis=1).T


def inverse_rpy_rate_matrix(angles: np.ndarray) -> np.ndarray:
    """T^-1 (3, 3): phi_o' = T^-1 omega. It grows as 1 / cos(theta); within SMALLEST_COSINE of
    theta = +-pi/2, where T has no inverse, it stays at its value there and finite."""
    _, theta, psi = angles
    c, s = np.cos(psi), np.sin(psi)
    cos = float(np.cos(theta))
    cos = float(np.copysign(max(abs(cos), SMALLEST_COSINE), cos))
    sin = np.sin(theta)
    return np.array([[c / cos, s / cos, 0.0], [-s, c, 0.0], [c * sin / cos, s * sin / cos, 1.0]])


def analytical_jacobian(chain: PosedChain, jacobian: np.ndarray) -> np.ndarray:
    """J_A (6, n) from the geometric J (6, n): the same linear rows, T^-1 J_o below."""
    angles = matrix_to_rpy(chain.placement.rotation)
    return np.concatenate([jacobian[:3], inverse_rpy_rate_matrix(angles) @ jacobian[3:]])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Row by row, (n, 3); several times faster than np.cross for a handful of rows."""
    return np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ],
        axis=1,
    )
