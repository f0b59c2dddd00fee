"""Orientation in all the representations of the notes (1.1.2), and how fast each must change.

A rotation matrix R (3, 3) has the axes of a turned frame as its columns: v_0 = R v_1. Angles are
in radians, a quaternion is (w, x, y, z) of unit length, an axis has unit length.

Euler angles (phi, theta, psi) of the sequence "abc" turn about axis a, then about the new axis b,
then about the newest axis c: R = R_a(phi) R_b(theta) R_c(psi). Roll, pitch and yaw turn about the
fixed axes x, y and z in this order, which is "zyx" read backwards.
"""

import numpy as np

SEQUENCES = ("xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "xyx", "xzx", "yxy", "yzy", "zxz", "zyz")
"""Three different axes (Cardan angles), then those whose third axis is the first again."""
GIMBAL_LOCK_TOLERANCE = 1e-12
"""Sine of the angle between first and third axis below which they count as one: psi is then 0."""


def skew(v: np.ndarray) -> np.ndarray:
    """[v]x (3, 3) with [v]x u = v x u."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def elementary_rotation(axis: str, angle: float) -> np.ndarray:
    """R_x, R_y or R_z of an angle [rad]: (3, 3)."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    rotation = np.eye(3)
    rotation[j, j] = rotation[k, k] = np.cos(angle)
    rotation[k, j] = np.sin(angle)
    rotation[j, k] = -rotation[k, j]
    return rotation


# Three angles ---------------------------------------------------------------------------------


def euler_to_matrix(sequence: str, angles: np.ndarray) -> np.ndarray:
    """R = R_a(phi) R_b(theta) R_c(psi) (3, 3) of angles (3,) [rad]."""
    first, second, third = map(elementary_rotation, sequence, angles)
    rotation: np.ndarray = first @ second @ third
    return rotation


def matrix_to_euler(sequence: str, rotation: np.ndarray) -> np.ndarray:
    """The angles (phi, theta, psi) (3,) [rad] of R (3, 3); phi and psi within (-pi, pi].

    With i, j, k the first axis, the second and the remaining one, and s = 1 if they are in cyclic
    order, else -1, the i-th row and column of R hold theta with either psi or phi:

        three axes: R_ik = s sin(theta), R_jk = -s sin(phi) cos(theta), R_kk = cos(phi) cos(theta)
        two axes:   R_ii = cos(theta), R_ji = sin(phi) sin(theta), R_ki = -s cos(phi) sin(theta)

    theta lies in [-pi/2, pi/2] with three axes and in [0, pi] with two. psi is what is left in
    R_a(phi)^T R, which stays exact near the lock. Locked (first and third axis parallel), only
    phi + psi or phi - psi is determined: psi is 0 then."""
    i, j, k, s = _axis_order(sequence)
    r = rotation
    if sequence[2] != sequence[0]:
        free = np.hypot(r[i, i], r[i, j])
        theta = np.arctan2(s * r[i, k], free)
        phi = np.arctan2(-s * r[j, k], r[k, k])
    else:
        free = np.hypot(r[i, j], r[i, k])
        theta = np.arctan2(free, r[i, i])
        phi = np.arctan2(r[j, i], -s * r[k, i])
    if free < GIMBAL_LOCK_TOLERANCE:
        return np.array([np.arctan2(s * r[k, j], r[j, j]), theta, 0.0])
    row = (
        elementary_rotation(sequence[0], phi).T[j] @ r
    )  # of R_b(theta) R_c(psi), where R_b leaves row j alone
    psi = np.arctan2(s * row[i] if sequence[2] != sequence[0] else -s * row[k], row[j])
    return np.array([phi, theta, psi])


def rpy_to_matrix(angles: np.ndarray) -> np.ndarray:
    """R = R_z(yaw) R_y(pitch) R_x(roll) (3, 3) of (roll, pitch, yaw) [rad]."""
    return euler_to_matrix("zyx", angles[::-1])


def matrix_to_rpy(rotation: np.ndarray) -> np.ndarray:
    """(roll, pitch, yaw) (3,) [rad]; pitch within [-pi/2, pi/2]. Locked, roll is 0."""
    return matrix_to_euler("zyx", rotation)[::-1]


def euler_axes(sequence: str, angles: np.ndarray) -> np.ndarray:
    """E (3, 3): its columns are the axes, in the world, about which phi, theta and psi turn:

        omega = E (phi', theta', psi'),   E = [e_a,  R_a e_b,  R_a R_b e_c].

    omega (3,) [rad/s] is the angular velocity in the world's axes. det E = +-cos(theta), with two
    axes +-sin(theta): zero at the lock, where the three axes lie in a plane."""
    a, b, c = ("xyz".index(axis) for axis in sequence)
    first = elementary_rotation(sequence[0], angles[0])
    second = first @ elementary_rotation(sequence[1], angles[1])
    return np.column_stack([np.eye(3)[a], first[:, b], second[:, c]])


def euler_rates(sequence: str, angles: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """(phi', theta', psi') (3,) [rad/s] of an angular velocity omega (3,) [rad/s] in the world's
    axes: E^-1 omega. Raises numpy.linalg.LinAlgError where E is exactly singular."""
    rates: np.ndarray = np.linalg.solve(euler_axes(sequence, angles), omega)
    return rates


def gimbal_lock_sine(sequence: str, theta: float) -> float:
    """|cos(theta)| with three axes, |sin(theta)| with two: the sine of the angle between the first
    and the third axis. It is 0 at the lock, and the fastest an angle may have to turn at unit
    angular speed, over all directions of rotation, is exactly its inverse."""
    return float(abs(np.cos(theta) if sequence[2] != sequence[0] else np.sin(theta)))


def gimbal_lock_direction(sequence: str, phi: float) -> np.ndarray:
    """(3,) the direction e_a x R_a(phi) e_b: at the lock no combination of the three angles' rates
    is a rotation about it."""
    a, b = ("xyz".index(axis) for axis in sequence[:2])
    return np.cross(np.eye(3)[a], elementary_rotation(sequence[0], phi)[:, b])


# Four numbers ---------------------------------------------------------------------------------


def angle_axis_to_matrix(angle: float, axis: np.ndarray) -> np.ndarray:
    """R = I + sin(angle) [u]x + (1 - cos(angle)) [u]x^2 (Rodrigues) for a unit axis u (3,)."""
    u = skew(axis)
    rotation: np.ndarray = np.eye(3) + np.sin(angle) * u + (1.0 - np.cos(angle)) * (u @ u)
    return rotation


def matrix_to_angle_axis(rotation: np.ndarray) -> tuple[float, np.ndarray]:
    """The angle in [0, pi] and the unit axis (3,). Without rotation any axis will do: x."""
    quaternion = matrix_to_quaternion(rotation)
    size = float(np.linalg.norm(quaternion[1:]))
    if size == 0.0:
        return 0.0, np.array([1.0, 0.0, 0.0])
    return 2.0 * float(np.arctan2(size, quaternion[0])), quaternion[1:] / size


def angle_axis_to_quaternion(angle: float, axis: np.ndarray) -> np.ndarray:
    """(cos(angle/2), sin(angle/2) u) (4,)."""
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])


def quaternion_to_matrix(quaternion: np.ndarray) -> np.ndarray:
    """R = I + 2 w [v]x + 2 [v]x^2 (3, 3) of a unit quaternion (w, v)."""
    v = skew(quaternion[1:])
    rotation: np.ndarray = np.eye(3) + 2.0 * quaternion[0] * v + 2.0 * (v @ v)
    return rotation


def matrix_to_quaternion(rotation: np.ndarray) -> np.ndarray:
    """The unit quaternion (w, x, y, z) of R (3, 3) with w >= 0; -(w, x, y, z) is the same rotation.

    The entries of R give all products of two components, 4 q q^T; its largest diagonal entry is
    at least 1, so dividing that row by its root loses nothing (Shepperd 1978)."""
    r, trace = rotation, np.trace(rotation)
    products = np.empty((4, 4))
    products[0, 0] = 1.0 + trace
    products[0, 1:] = products[1:, 0] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    products[1:, 1:] = r + r.T + (1.0 - trace) * np.eye(3)
    row = products[np.argmax(np.diag(products))]
    quaternion: np.ndarray = row / np.linalg.norm(row)
    return -quaternion if quaternion[0] < 0.0 else quaternion


def quaternion_rate(quaternion: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """q' (4,) [1/s] = (-v.omega, w omega + omega x v) / 2 of an angular velocity omega (3,) in the
    world's axes. Its length is |omega| / 2 at every orientation: no lock."""
    w, v = quaternion[0], quaternion[1:]
    return 0.5 * np.concatenate([[-v @ omega], w * omega + np.cross(omega, v)])


def _axis_order(sequence: str) -> tuple[int, int, int, int]:
    """First axis, second, the remaining one, and whether they are in cyclic order (1 or -1)."""
    i, j = "xyz".index(sequence[0]), "xyz".index(sequence[1])
    return i, j, 3 - i - j, 1 if (i + 1) % 3 == j else -1
