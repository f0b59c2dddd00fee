"""Resolved-rate inverse kinematics: joint velocities for a wanted velocity of the end-effector.

A task velocity v (m,) and its Jacobian J (m, n) ask for J q' = v (the relation of the notes,
1.1.3, read backwards). With J = sum over k of sigma_k u_k r_k^T, three answers:

    pseudo-inverse          q' = J^+ v = sum of r_k (u_k . v) / sigma_k
    transpose               q' = J^T v = sum of r_k (u_k . v) sigma_k
    damped least squares    q' = J^T (J J^T + lambda^2 I)^-1 v
                               = sum of r_k (u_k . v) sigma_k / (sigma_k^2 + lambda^2)

The first is exact wherever v is possible, and unbounded as sigma -> 0. The second never inverts.
The third minimises |J q' - v|^2 + lambda^2 |q'|^2; since sigma / (sigma^2 + lambda^2) is at most
1 / (2 lambda), so is |q'| / |v|. (Nakamura and Hanafusa 1986; Wampler 1986.)
"""

from collections.abc import Callable, Iterable, Mapping

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from labs.algorithms.jacobian import ForwardKinematics, geometric_jacobian

REACH_TOLERANCE = 1e-3
"""[m] A place is within reach if the frame comes as near as this."""
POSTURE_STEPS, POSTURE_DAMPING = 60, 0.05
"""Of the search for the posture nearest to a place: steps, and the least damping [m/rad]."""
RELATIVE_CUTOFF = 1e-12
"""Singular values below this share of the largest count as zero in the pseudo-inverse."""

INVERSE_KINEMATICS_METHODS: Mapping[str, str] = {
    "pseudo-inverse": "Pseudo-inverse",
    "transpose": "Transpose",
    "damped": "Damped",
}


def pseudo_inverse(jacobian: np.ndarray, v: np.ndarray) -> np.ndarray:
    """q' (n,) = J^+ v: of all q' that come closest to J q' = v the shortest. J (m, n), v (m,)."""
    u, sigma, rt = np.linalg.svd(jacobian, full_matrices=False)
    kept = sigma > RELATIVE_CUTOFF * sigma[0]
    rates: np.ndarray = rt[kept].T @ ((u.T @ v)[kept] / sigma[kept])
    return rates


def jacobian_transpose(jacobian: np.ndarray, v: np.ndarray) -> np.ndarray:
    """q' (n,) = J^T v: downhill for |e|^2 / 2 where v is proportional to the error e."""
    rates: np.ndarray = jacobian.T @ v
    return rates


def damped_least_squares(jacobian: np.ndarray, v: np.ndarray, damping: float) -> np.ndarray:
    """q' (n,) = J^T (J J^T + lambda^2 I)^-1 v, lambda = `damping` > 0 in the units of J."""
    m = len(v)
    rates: np.ndarray = jacobian.T @ np.linalg.solve(
        jacobian @ jacobian.T + damping**2 * np.eye(m), v
    )
    return rates


def joint_rates(method: str, jacobian: np.ndarray, v: np.ndarray, damping: float) -> np.ndarray:
    """q' (n,) by one of INVERSE_KINEMATICS_METHODS; `damping` is of damped least squares alone."""
    match method:
        case "pseudo-inverse":
            return pseudo_inverse(jacobian, v)
        case "transpose":
            return jacobian_transpose(jacobian, v)
        case _:
            return damped_least_squares(jacobian, v, damping)


def pose_error(placement: pin.SE3, target: pin.SE3) -> np.ndarray:
    """e (6,): p* - p_e [m] above log(R* R_e^T) [rad], in the world's axes. Moving at the
    constant velocity e for one second leads from `placement` to `target`."""
    turn = pin.log3(target.rotation @ placement.rotation.T)
    return np.concatenate([target.translation - placement.translation, turn])


def scale_to_speed_limit(rates: np.ndarray, fastest: float) -> np.ndarray:
    """q' (n,), all of it scaled down by one factor where a joint exceeds `fastest`: the
    direction of the motion stays."""
    peak = float(np.abs(rates).max())
    return rates if peak <= fastest else rates * (fastest / peak)


def manipulability(jacobian: np.ndarray) -> tuple[np.ndarray, float]:
    """The singular values of J (m, n), min(m, n) of them from the largest down, and their
    product: sqrt(det(J J^T)) for m <= n (Yoshikawa 1985)."""
    sigma = np.linalg.svd(jacobian, compute_uv=False)
    return sigma, float(np.prod(sigma))


def nearest_distance(
    kinematics: ForwardKinematics,
    target: np.ndarray,
    starts: Iterable[np.ndarray],
    lower: np.ndarray,
    upper: np.ndarray,
) -> float:
    """The least |p_e(q) - p*| [m] to a place p* (3,) over lower <= q <= upper (n,), by
    Gauss-Newton steps in a trust region (scipy.optimize.least_squares) from each start (n,) until
    one is within REACH_TOLERANCE. Such minima are local: what is found is at least the least
    distance."""
    least = np.inf
    for start in starts:
        found = least_squares(
            lambda q: kinematics.at(q).placement.translation - target,
            np.clip(start, lower + 1e-6, upper - 1e-6),
            lambda q: geometric_jacobian(kinematics.at(q))[:3],
            (lower, upper),
            ftol=1e-6,
            xtol=1e-6,
        )
        least = min(least, float(np.linalg.norm(found.fun)))
        if least <= REACH_TOLERANCE:
            break
    return least


def nearest_posture(
    tip: Callable[[np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray], np.ndarray],
    target: np.ndarray,
    home: np.ndarray,
) -> np.ndarray:
    """q (n,) of revolute joints with tip(q) (3,) [m] at, or as near as found to, `target`, each
    joint within half a turn of `home` (n,), from where it is sought. `jacobian(q)` is (3, n).

    Damped least squares, with the damping of Levenberg and Marquardt: a step that leads away is
    not taken, but damped more, so that a place out of reach leaves the arm stretched towards it.
    """
    q, damping = home, POSTURE_DAMPING
    error = target - tip(q)
    for _ in range(POSTURE_STEPS):
        tried = q + damped_least_squares(jacobian(q), error, damping)
        left = target - tip(tried)
        if left @ left < error @ error:
            q, error, damping = tried, left, max(0.5 * damping, POSTURE_DAMPING)
        else:
            damping *= 4.0
    turns = np.round((q - home) / (2.0 * np.pi))
    return np.asarray(q - 2.0 * np.pi * turns)
