"""The chain of frames against Pinocchio's forward kinematics and Jacobian, and in closed form."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import pytest

from labs.algorithms.frame_chain import FrameChain, multiply_poses
from labs.models.arms import load_arm

both_robots = pytest.mark.parametrize("robot", ["ur5", "panda"])


def chain_of(robot: str) -> FrameChain:
    arm = load_arm(robot)
    return FrameChain(arm.model, arm.tip)


def postures(robot: str) -> Iterator[np.ndarray]:
    model = load_arm(robot).model
    rng = np.random.default_rng(5)
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    yield from (rng.uniform(low, high) for _ in range(10))


@both_robots
def test_the_product_is_the_pose_of_the_end_effector(robot: str) -> None:
    arm, chain = load_arm(robot), chain_of(robot)
    data = arm.model.createData()
    for q in postures(robot):
        factors = chain.factors(q)
        pin.framesForwardKinematics(arm.model, data, q)
        np.testing.assert_allclose(
            multiply_poses(factors), data.oMf[arm.tip].homogeneous, atol=1e-14
        )
        for i in range(1, arm.model.nq):
            so_far = data.oMi[i].homogeneous
            np.testing.assert_allclose(multiply_poses(factors[:i]), so_far, atol=1e-14)


@both_robots
def test_every_matrix_is_a_pose(robot: str) -> None:
    chain = chain_of(robot)
    for q in postures(robot):
        factors = chain.factors(q)
        for pose in (*factors, multiply_poses(factors)):
            rotation = pose[:3, :3]
            np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=2e-15)
            assert np.linalg.det(rotation) == pytest.approx(1.0, abs=2e-15)
            np.testing.assert_array_equal(pose[3], [0.0, 0.0, 0.0, 1.0])
            back = pin.SE3(pose).inverse()
            np.testing.assert_allclose(back.rotation, rotation.T, atol=1e-15)


@both_robots
def test_a_factor_depends_on_one_joint_and_the_product_on_all(robot: str) -> None:
    """The last row by Pinocchio's Jacobian: a rotation changes by sqrt(2) per radian, the
    position by the joint's column."""
    arm, chain = load_arm(robot), chain_of(robot)
    data = arm.model.createData()
    for q in postures(robot):
        found = chain.derivative_norms(q)
        assert found.shape == (len(q) + 1, len(q))
        off = found[:-1][~np.eye(len(q), dtype=bool)]
        np.testing.assert_array_equal(off, 0.0)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        columns = pin.computeFrameJacobian(arm.model, data, q, arm.tip, axes)[:3]
        wanted = np.sqrt(2.0 + np.sum(columns**2, axis=0))
        np.testing.assert_allclose(found[-1], wanted, rtol=1e-8)
        np.testing.assert_allclose(np.diag(found), np.sqrt(2.0), rtol=1e-8)


def test_two_links_in_closed_form() -> None:
    """Rods of 0.5 m hanging from (0, 0, 1.3), turning about x."""
    chain = chain_of("double-pendulum")
    a, b = 0.4, -1.1
    c, s, both = np.cos(a), np.sin(a), a + b
    first, second = chain.factors(np.array([a, b]))
    np.testing.assert_allclose(first[:3, :3], [[1, 0, 0], [0, c, -s], [0, s, c]], atol=1e-15)
    np.testing.assert_allclose(first[:3, 3], [0.0, 0.0, 1.3], atol=1e-15)
    tip = multiply_poses([first, second])
    place = [0.0, 0.5 * (s + np.sin(both)), 1.3 - 0.5 * (c + np.cos(both))]
    np.testing.assert_allclose(tip[:3, 3], place, atol=1e-15)
    c, s = np.cos(both), np.sin(both)
    np.testing.assert_allclose(tip[:3, :3], [[1, 0, 0], [0, c, -s], [0, s, c]], atol=1e-15)
