"""Orientation: every conversion against SciPy's Rotation, every rate by finite differences."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from labs.algorithms.orientation import (
    SEQUENCES,
    angle_axis_to_matrix,
    angle_axis_to_quaternion,
    elementary_rotation,
    euler_axes,
    euler_rates,
    euler_to_matrix,
    gimbal_lock_direction,
    gimbal_lock_sine,
    matrix_to_angle_axis,
    matrix_to_euler,
    matrix_to_quaternion,
    matrix_to_rpy,
    quaternion_rate,
    quaternion_to_matrix,
    rpy_to_matrix,
    skew,
)

RANDOM = Rotation.random(40, random_state=1)
every_sequence = pytest.mark.parametrize("sequence", SEQUENCES)


def rotations() -> Iterator[np.ndarray]:
    """Random ones, none at all, half turns, and all 24 that map axes onto axes."""
    yield from RANDOM.as_matrix()
    for turn in Rotation.create_group("O"):
        yield np.round(turn.as_matrix())
    for axis in ([1.0, 2.0, -2.0], [0.0, 3.0, 4.0], [1e-9, 0.0, 1.0]):
        unit = np.array(axis) / np.linalg.norm(axis)
        yield 2.0 * np.outer(unit, unit) - np.eye(3)
        yield angle_axis_to_matrix(1e-9, unit)


def test_all_twelve_sequences_are_there() -> None:
    wanted = {a + b + c for a in "xyz" for b in "xyz" for c in "xyz" if a != b != c}
    assert set(SEQUENCES) == wanted
    assert len(SEQUENCES) == 12


@pytest.mark.parametrize("axis", "xyz")
def test_a_turn_about_an_axis(axis: str) -> None:
    wanted = Rotation.from_euler(axis, 0.7).as_matrix()
    np.testing.assert_allclose(elementary_rotation(axis, 0.7), wanted, atol=1e-15)


@every_sequence
def test_euler_angles_against_scipy(sequence: str) -> None:
    for rotation in RANDOM:
        matrix = rotation.as_matrix()
        angles = matrix_to_euler(sequence, matrix)
        wanted = rotation.as_euler(sequence.upper())
        np.testing.assert_allclose(angles, wanted, atol=1e-13)
        np.testing.assert_allclose(euler_to_matrix(sequence, wanted), matrix, atol=1e-14)


@every_sequence
def test_euler_angles_give_the_rotation_back(sequence: str) -> None:
    """Also at the lock, where SciPy only warns, and close to it."""
    close = [
        euler_to_matrix(sequence, np.array([0.4, middle + d, -1.1]))
        for middle in (-np.pi / 2, 0.0, np.pi / 2, np.pi)
        for d in (0.0, 1e-13, 1e-9, -1e-6)
    ]
    for matrix in [*rotations(), *close]:
        angles = matrix_to_euler(sequence, matrix)
        np.testing.assert_allclose(euler_to_matrix(sequence, angles), matrix, atol=2e-12)
        low, high = (-np.pi / 2, np.pi / 2) if sequence[2] != sequence[0] else (0.0, np.pi)
        assert low <= angles[1] <= high


@every_sequence
def test_at_the_lock_the_third_angle_is_zero(sequence: str) -> None:
    lock = np.pi / 2 if sequence[2] != sequence[0] else 0.0
    angles = matrix_to_euler(sequence, euler_to_matrix(sequence, np.array([0.3, lock, 0.5])))
    assert angles[2] == 0.0
    assert min(abs(angles[0] - 0.8), abs(angles[0] + 0.2)) < 1e-15


def test_roll_pitch_yaw_turn_about_fixed_axes() -> None:
    for rotation in RANDOM:
        wanted = rotation.as_euler("xyz")  # lower case: about fixed axes
        np.testing.assert_allclose(matrix_to_rpy(rotation.as_matrix()), wanted, atol=1e-13)
        np.testing.assert_allclose(rpy_to_matrix(wanted), rotation.as_matrix(), atol=1e-14)


def test_angle_and_axis() -> None:
    for rotation in RANDOM:
        vector = rotation.as_rotvec()
        angle, axis = matrix_to_angle_axis(rotation.as_matrix())
        np.testing.assert_allclose(angle * axis, vector, atol=1e-13)
        np.testing.assert_allclose(
            angle_axis_to_matrix(angle, axis), rotation.as_matrix(), atol=1e-14
        )
        quaternion = angle_axis_to_quaternion(angle, axis)
        np.testing.assert_allclose(
            quaternion_to_matrix(quaternion), rotation.as_matrix(), atol=1e-14
        )
    for matrix in rotations():
        angle, axis = matrix_to_angle_axis(matrix)
        assert 0.0 <= angle <= np.pi
        assert np.linalg.norm(axis) == pytest.approx(1.0, abs=1e-15)
        np.testing.assert_allclose(angle_axis_to_matrix(angle, axis), matrix, atol=1e-15 * 4)


def test_a_tiny_rotation_keeps_its_axis() -> None:
    axis = np.array([0.6, 0.0, -0.8])
    angle, found = matrix_to_angle_axis(angle_axis_to_matrix(1e-9, axis))
    assert angle == pytest.approx(1e-9, rel=1e-12)
    np.testing.assert_allclose(found, axis, atol=1e-12)


def test_quaternions() -> None:
    for rotation in RANDOM:
        quaternion = matrix_to_quaternion(rotation.as_matrix())
        wanted = rotation.as_quat(canonical=True)[[3, 0, 1, 2]]
        np.testing.assert_allclose(quaternion, wanted, atol=1e-14)
    for matrix in rotations():
        quaternion = matrix_to_quaternion(matrix)
        assert quaternion[0] >= 0.0
        assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-15)
        for both in (quaternion, -quaternion):
            np.testing.assert_allclose(quaternion_to_matrix(both), matrix, atol=1e-15 * 4)


@every_sequence
def test_the_axes_of_the_angles(sequence: str) -> None:
    """Turning one angle is a rotation about its column of E: dR/dangle = [E_i]x R."""
    for angles in np.random.default_rng(2).uniform(-3.0, 3.0, (5, 3)):
        axes, matrix, d = euler_axes(sequence, angles), euler_to_matrix(sequence, angles), 1e-6
        for i, step in enumerate(d * np.eye(3)):
            ahead, behind = (euler_to_matrix(sequence, angles + f * step) for f in (1.0, -1.0))
            slope = (ahead - behind) / (2.0 * d)
            np.testing.assert_allclose(slope, skew(axes[:, i]) @ matrix, atol=1e-9)
        assert abs(np.linalg.det(axes)) == pytest.approx(
            gimbal_lock_sine(sequence, angles[1]), abs=1e-14
        )


@every_sequence
def test_the_rates_of_the_angles(sequence: str) -> None:
    """Against the angles SciPy finds a little before and after."""
    omega, d = np.array([0.3, -0.5, 0.2]), 1e-6
    for rotation in RANDOM[:8]:
        rates = euler_rates(sequence, matrix_to_euler(sequence, rotation.as_matrix()), omega)
        ahead, behind = (
            (Rotation.from_rotvec(f * d * omega) * rotation).as_euler(sequence.upper())
            for f in (1.0, -1.0)
        )
        np.testing.assert_allclose((ahead - behind) / (2.0 * d), rates, rtol=1e-6, atol=1e-8)


@every_sequence
def test_the_amplification_law(sequence: str) -> None:
    """Over all directions of rotation, the fastest angle turns 1/lock_sine times as fast: a row of
    E^-1 has its length as the largest rate, and phi's and psi's rows have just this length."""
    for theta in (0.3, 1.0, 1.5, 1.55, 0.02):
        inverse = np.linalg.inv(euler_axes(sequence, np.array([0.7, theta, -0.4])))
        lengths = np.linalg.norm(inverse, axis=1)
        law = 1.0 / gimbal_lock_sine(sequence, theta)
        np.testing.assert_allclose(lengths, [law, 1.0, law], rtol=1e-11)


@every_sequence
def test_the_lost_direction(sequence: str) -> None:
    lock = np.pi / 2 if sequence[2] != sequence[0] else 0.0
    axes = euler_axes(sequence, np.array([0.7, lock, -0.4]))
    lost = gimbal_lock_direction(sequence, 0.7)
    assert np.linalg.norm(lost) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(lost @ axes, 0.0, atol=1e-15)
    # Close to the lock it is where the law's worst case is met.
    angles = np.array([0.7, lock - 0.01 if lock else 0.01, -0.4])
    fastest = np.abs(euler_rates(sequence, angles, lost)).max()
    assert fastest == pytest.approx(1.0 / np.sin(0.01), rel=1e-12)


def test_the_rate_of_a_quaternion() -> None:
    omega, d = np.array([0.3, -0.5, 0.2]), 1e-6
    for rotation in RANDOM:
        quaternion = rotation.as_quat()[[3, 0, 1, 2]]
        rate = quaternion_rate(quaternion, omega)
        ahead, behind = (
            (Rotation.from_rotvec(f * d * omega) * rotation).as_quat()[[3, 0, 1, 2]]
            for f in (1.0, -1.0)
        )
        np.testing.assert_allclose((ahead - behind) / (2.0 * d), rate, atol=1e-9)
        assert np.linalg.norm(rate) == pytest.approx(0.5 * np.linalg.norm(omega), rel=1e-14)
