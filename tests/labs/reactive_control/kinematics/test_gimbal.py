"""The body in the gimbal: where it starts, how it turns, and how its rings lie."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from labs.algorithms.orientation import SEQUENCES, gimbal_lock_sine, skew
from labs.reactive_control.kinematics.gimbal import Gimbal

every_sequence = pytest.mark.parametrize("sequence", SEQUENCES)


@every_sequence
def test_in_the_middle_it_is_this_far_from_the_lock(sequence: str) -> None:
    for distance in (0.0, 0.02, 0.5, 1.5):
        gimbal = Gimbal(sequence, distance, "lost", 0.1)
        middle = Rotation.from_euler(sequence.upper(), [0.0, gimbal.middle, 0.0]).as_matrix()
        np.testing.assert_allclose(gimbal.rotation(0.0), middle, atol=1e-15)
        assert gimbal_lock_sine(sequence, gimbal.middle) == pytest.approx(
            np.sin(distance), abs=1e-15
        )


@every_sequence
@pytest.mark.parametrize("direction", ["lost", "first", "second"])
def test_it_turns_about_a_fixed_axis(sequence: str, direction: str) -> None:
    gimbal = Gimbal(sequence, 0.2, direction, 0.3)
    for phase in (0.1, 0.25, 0.8):
        turn = Rotation.from_matrix(gimbal.rotation(phase) @ gimbal.rotation(0.0).T)
        wanted = 0.3 * np.sin(2.0 * np.pi * phase) * gimbal.axis
        np.testing.assert_allclose(turn.as_rotvec(), wanted, atol=1e-14)
    phase, d = 0.1, 1e-6
    slope = (gimbal.rotation(phase + d) - gimbal.rotation(phase - d)) / (2.0 * d)
    speed = 0.3 * 2.0 * np.pi * np.cos(2.0 * np.pi * phase)
    wanted = speed * skew(gimbal.axis) @ gimbal.rotation(phase)
    np.testing.assert_allclose(slope, wanted, atol=1e-8)


@every_sequence
def test_the_three_directions_are_perpendicular(sequence: str) -> None:
    axes = [Gimbal(sequence, 0.2, name, 0.3).axis for name in ("first", "second", "lost")]
    np.testing.assert_allclose(np.abs(np.linalg.det(axes)), 1.0, atol=1e-15)


@every_sequence
def test_the_rings_are_circles_that_share_the_second_axis(sequence: str) -> None:
    gimbal = Gimbal(sequence, 0.3, "lost", 0.2)
    rotation = gimbal.rotation(0.15)
    first, second, third = gimbal.axes(rotation)
    outer, inner = gimbal.rings(rotation)
    for ring, mine in ((outer, first), (inner, third)):
        np.testing.assert_allclose(np.linalg.norm(ring, axis=1), 1.0, atol=1e-15)
        normal = np.cross(mine, second)
        np.testing.assert_allclose(ring @ normal, 0.0, atol=1e-15)
        assert np.max(ring @ second) == pytest.approx(1.0, abs=1e-15)
    # The third axis is fixed to the body.
    np.testing.assert_allclose(rotation.T @ third, np.eye(3)["xyz".index(sequence[2])], atol=1e-15)


@every_sequence
def test_at_the_lock_the_rings_lie_in_one_plane(sequence: str) -> None:
    outer, inner = Gimbal(sequence, 0.0, "lost", 0.0).rings(
        Gimbal(sequence, 0.0, "lost", 0.0).rotation(0.0)
    )
    lost = Gimbal(sequence, 0.0, "lost", 0.0).axis
    np.testing.assert_allclose(np.concatenate([outer, inner]) @ lost, 0.0, atol=1e-15)
