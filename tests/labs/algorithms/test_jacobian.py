"""The Jacobians: against Pinocchio, finite differences and the two-link arm's closed form."""

from dataclasses import replace
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from labs.algorithms.jacobian import (
    SMALLEST_COSINE,
    ForwardKinematics,
    PosedChain,
    analytical_jacobian,
    geometric_jacobian,
    geometric_jacobian_rate,
    inverse_rpy_rate_matrix,
)
from labs.algorithms.orientation import euler_axes, matrix_to_rpy, rpy_to_matrix
from labs.models.arms import Arm, load_arm

ARMS = ("ur5", "panda", "scara", "double-pendulum")
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
D = 1e-6


@pytest.fixture(params=ARMS)
def arm(request: pytest.FixtureRequest) -> Arm:
    return load_arm(request.param)


def postures(arm: Arm, count: int = 5) -> list[np.ndarray]:
    rng = np.random.default_rng(7)
    return [arm.home + rng.uniform(-0.8, 0.8, arm.model.nq) for _ in range(count)]


def velocities(arm: Arm) -> np.ndarray:
    v: np.ndarray = np.random.default_rng(8).normal(size=arm.model.nv)
    return v


def pose_of(kinematics: ForwardKinematics, q: np.ndarray) -> np.ndarray:
    """phi (6,): position and roll-pitch-yaw, the latter by SciPy."""
    placement = kinematics.at(q).placement
    yaw, pitch, roll = Rotation.from_matrix(placement.rotation).as_euler("ZYX")
    return np.array([*placement.translation, roll, pitch, yaw])


def test_geometric_is_pinocchios(arm: Arm) -> None:
    data = arm.model.createData()
    frames = [arm.tip, *(arm.model.getFrameId(name) for name in arm.model.names[1:])]
    frames = [f for f in frames if f < arm.model.nframes]
    assert len(frames) >= 1 if arm.name == "double-pendulum" else len(frames) == 1 + arm.model.nv
    for q, frame in product(postures(arm), frames):
        expected = pin.computeFrameJacobian(arm.model, data, q, frame, WORLD)
        found = geometric_jacobian(ForwardKinematics(arm.model, frame).at(q))
        np.testing.assert_allclose(found, expected, atol=1e-14)


def test_geometric_by_finite_differences(arm: Arm) -> None:
    """Position by differences; rotation by the log of what a small change of q_i turned."""
    kinematics = ForwardKinematics(arm.model, arm.tip)
    for q in postures(arm):
        columns = []
        for step in D * np.eye(arm.model.nv):
            after, before = kinematics.at(q + step).placement, kinematics.at(q - step).placement
            turn = Rotation.from_matrix(after.rotation @ before.rotation.T).as_rotvec()
            columns.append(np.concatenate([after.translation - before.translation, turn]))
        slope = np.array(columns).T / (2 * D)
        np.testing.assert_allclose(geometric_jacobian(kinematics.at(q)), slope, atol=1e-9)


def test_analytical_by_finite_differences(arm: Arm) -> None:
    kinematics = ForwardKinematics(arm.model, arm.tip)
    for q in postures(arm):
        slope = np.array(
            [
                pose_of(kinematics, q + step) - pose_of(kinematics, q - step)
                for step in D * np.eye(arm.model.nv)
            ]
        ).T / (2 * D)
        chain = kinematics.at(q)
        found = analytical_jacobian(chain, geometric_jacobian(chain))
        np.testing.assert_allclose(found, slope, rtol=1e-7, atol=2e-9)
        np.testing.assert_array_equal(found[:3], geometric_jacobian(chain)[:3])


def test_the_rate_of_the_jacobian_is_pinocchios_and_the_limit_of_differences(arm: Arm) -> None:
    kinematics, data, v = (
        ForwardKinematics(arm.model, arm.tip),
        arm.model.createData(),
        velocities(arm),
    )
    for q in postures(arm):
        found = geometric_jacobian_rate(kinematics.at(q), v)
        pin.computeJointJacobiansTimeVariation(arm.model, data, q, v)
        pin.updateFramePlacements(arm.model, data)
        expected = pin.getFrameJacobianTimeVariation(arm.model, data, arm.tip, WORLD)
        np.testing.assert_allclose(found, expected, atol=1e-13)
        after, before = (geometric_jacobian(kinematics.at(q + s * D * v)) for s in (1, -1))
        np.testing.assert_allclose(found, (after - before) / (2 * D), atol=3e-9)


def test_a_joint_beyond_the_frame_does_not_move_it() -> None:
    arm = load_arm("ur5")
    chain = ForwardKinematics(arm.model, arm.model.getFrameId("elbow_joint")).at(arm.home)
    assert chain.supports.tolist() == [True, True, True, False, False, False]
    v = velocities(arm)
    for matrix in (geometric_jacobian(chain), geometric_jacobian_rate(chain, v)):
        assert not matrix[:, 3:].any()
        assert matrix[:, :2].any()


def test_the_two_link_arm_in_closed_form() -> None:
    """p = (l1 c1 + l2 c12, l1 s1 + l2 s12): its derivatives, and their rates."""
    l1, l2, q, v = 0.4, 0.3, np.array([0.3, 1.1]), np.array([0.7, -1.9])
    s1, c1, s12, c12 = np.sin(q[0]), np.cos(q[0]), np.sin(q.sum()), np.cos(q.sum())
    points = np.array([[0.0, 0.0, 0.0], [l1 * c1, l1 * s1, 0.0]])
    tip = pin.SE3(np.eye(3), points[1] + [l2 * c12, l2 * s12, 0.0])
    up = np.tile([0.0, 0.0, 1.0], (2, 1))
    chain = PosedChain(up, points, np.zeros(2, bool), np.ones(2, bool), tip)
    jacobian = geometric_jacobian(chain)
    expected = [[-l1 * s1 - l2 * s12, -l2 * s12], [l1 * c1 + l2 * c12, l2 * c12]]
    np.testing.assert_allclose(jacobian[:2], expected, atol=1e-15)
    np.testing.assert_array_equal(jacobian[2:], [[0, 0], [0, 0], [0, 0], [1, 1]])
    assert np.linalg.det(jacobian[:2]) == pytest.approx(l1 * l2 * np.sin(q[1]), rel=1e-14)
    w = v.sum()
    slope = [[-l1 * c1 * v[0] - l2 * c12 * w, -l2 * c12 * w]]
    slope += [[-l1 * s1 * v[0] - l2 * s12 * w, -l2 * s12 * w]]
    rate = geometric_jacobian_rate(chain, v)
    np.testing.assert_allclose(rate[:2], slope, atol=1e-15)
    assert not rate[2:].any()


def test_the_scara_is_a_two_link_arm_on_a_slide() -> None:
    arm = load_arm("scara")
    q = np.array([0.3, 1.1, 0.07, -0.4])
    chain = ForwardKinematics(arm.model, arm.tip).at(q)
    c1, c12, s1, s12 = np.cos(0.3), np.cos(1.4), np.sin(0.3), np.sin(1.4)
    place = [0.4 * c1 + 0.3 * c12, 0.4 * s1 + 0.3 * s12, 0.28 + 0.07]
    np.testing.assert_allclose(chain.placement.translation, place, atol=1e-15)
    jacobian = geometric_jacobian(chain)
    assert chain.prismatic.tolist() == [False, False, True, False]
    np.testing.assert_array_equal(jacobian[:, 2], [0, 0, 1, 0, 0, 0])
    np.testing.assert_allclose(jacobian[:, 3], [0, 0, 0, 0, 0, 1], atol=1e-15)
    planar = [[-place[1], -0.3 * s12], [place[0], 0.3 * c12]]
    np.testing.assert_allclose(jacobian[:2, :2], planar, atol=1e-15)


def test_a_joint_that_slides_is_carried_around_by_those_before_it() -> None:
    """On a turntable: a slide along a turning axis gains z' = omega x z."""
    model = pin.Model()
    table = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "table")
    offset = pin.SE3(np.eye(3), np.array([0.2, 0.1, 0.3]))
    slide = model.addJoint(table, pin.JointModelPX(), offset, "slide")
    last = model.addJoint(slide, pin.JointModelRY(), offset, "last")
    frame = model.addFrame(pin.Frame("tip", last, offset, pin.FrameType.OP_FRAME))
    q, v = np.array([0.4, 0.25, -0.7]), np.array([1.3, -0.6, 0.9])
    kinematics = ForwardKinematics(model, frame)
    after, before = (geometric_jacobian(kinematics.at(q + s * D * v)) for s in (1, -1))
    found = geometric_jacobian_rate(kinematics.at(q), v)
    np.testing.assert_allclose(found, (after - before) / (2 * D), atol=1e-9)
    np.testing.assert_allclose(found[:3, 1], 1.3 * np.array([-np.sin(0.4), np.cos(0.4), 0]))


def test_the_inverse_rate_matrix_against_pinocchio_and_the_axes_of_the_angles() -> None:
    for angles in np.random.default_rng(2).uniform([-3, -3, -3], [3, 3, 3], (50, 3)):
        expected = pin.rpy.computeRpyJacobian(angles, WORLD)
        axes = euler_axes("zyx", angles[::-1])[:, ::-1]
        np.testing.assert_allclose(axes, expected, atol=1e-15)
        inverse = inverse_rpy_rate_matrix(angles)
        np.testing.assert_allclose(inverse @ axes, np.eye(3), atol=1e-11)
        assert np.linalg.det(axes) == pytest.approx(np.cos(angles[1]), abs=1e-14)
        worst = 1 / np.sqrt(1 - abs(np.sin(angles[1])))
        assert np.linalg.norm(inverse, 2) == pytest.approx(worst, rel=1e-9)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_at_the_lock_the_analytical_jacobian_belongs_to_the_angles_of_the_rotation(
    pitch: float,
) -> None:
    """Roll 0.1 and yaw 0.2 are one angle there; the angles chosen give back the same rotation, and
    T^-1 is taken at them."""
    rotation = rpy_to_matrix(np.array([0.1, pitch, 0.2]))
    angles = matrix_to_rpy(rotation)
    np.testing.assert_allclose(rpy_to_matrix(angles), rotation, atol=1e-15)
    arm = load_arm("ur5")
    chain = ForwardKinematics(arm.model, arm.tip).at(arm.home)
    chain = replace(chain, placement=pin.SE3(rotation, chain.placement.translation))
    jacobian = geometric_jacobian(chain)
    found = analytical_jacobian(chain, jacobian)[3:]
    np.testing.assert_array_equal(found, inverse_rpy_rate_matrix(angles) @ jacobian[3:])
    assert np.isfinite(found).all()


@pytest.mark.parametrize("theta", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9])
def test_the_inverse_rate_stays_finite_where_there_is_none(theta: float) -> None:
    inverse = inverse_rpy_rate_matrix(np.array([0.3, theta, 0.2]))
    assert np.isfinite(inverse).all()
    assert np.abs(inverse).max() == pytest.approx(np.cos(0.2) / SMALLEST_COSINE)
