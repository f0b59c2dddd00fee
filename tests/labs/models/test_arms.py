"""The arms: what the URDFs do not tell is there, and the pendulum is the textbook's."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from labs.errors import LabError
from labs.models.arms import ARMS, JOINT_COUNTS, Arm, load_arm


@pytest.fixture(params=list(ARMS))
def arm(request: pytest.FixtureRequest) -> Arm:
    return load_arm(request.param)


def test_an_arm_is_consistent(arm: Arm) -> None:
    model = arm.model
    assert load_arm(arm.name) is arm
    assert arm.home.shape == (model.nq,) == (model.nv,) == arm.torque_limit.shape
    assert JOINT_COUNTS[arm.name] == model.nv
    assert np.all(np.isfinite(arm.torque_limit))
    assert np.all(arm.torque_limit > 0)
    assert arm.tip < model.nframes


def test_home_is_away_from_singularities_limits_and_the_floor(arm: Arm) -> None:
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, arm.home)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = pin.computeFrameJacobian(arm.model, data, arm.home, arm.tip, axes)
    moving = jacobian[1:3] if arm.name == "double-pendulum" else jacobian
    assert np.linalg.svd(moving, compute_uv=False)[-1] > 0.1
    heights = [data.oMi[j].translation[2] for j in range(1, arm.model.njoints)]
    assert min(*heights, data.oMf[arm.tip].translation[2]) > 0.05
    lower, upper = arm.model.lowerPositionLimit, arm.model.upperPositionLimit
    assert np.all(arm.home > lower)
    assert np.all(arm.home < upper)


def test_home_is_held_with_half_of_the_torque(arm: Arm) -> None:
    gravity = pin.computeGeneralizedGravity(arm.model, arm.model.createData(), arm.home)
    assert np.all(np.abs(gravity) < 0.5 * arm.torque_limit)


def test_every_piece_can_be_drawn(arm: Arm) -> None:
    for piece in (*arm.visuals, *arm.collisions):
        assert 0 <= piece.joint < arm.model.njoints
        assert bool(piece.mesh) != (piece.shape is not None)
        assert not piece.mesh or Path(piece.mesh).is_file()
        assert all(0.0 <= c <= 1.0 for c in piece.color)
    assert {piece.joint for piece in arm.visuals} == set(range(arm.model.njoints))


@pytest.mark.parametrize(
    ("name", "rotor"), [("ur5", [0.255] * 3 + [0.061] * 3), ("panda", [0.1] * 7)]
)
def test_rotors_are_on_the_diagonal_of_the_mass_matrix(name: str, rotor: list[float]) -> None:
    arm = load_arm(name)
    bare = arm.model.copy()
    bare.armature = np.zeros(bare.nv)
    with_rotors = pin.crba(arm.model, arm.model.createData(), arm.home)
    without = pin.crba(bare, bare.createData(), arm.home)
    np.testing.assert_allclose(with_rotors - without, np.diag(rotor), atol=1e-12)


def test_the_panda_has_no_loose_fingers() -> None:
    assert load_arm("panda").model.nq == 7
    assert sum("finger" in piece.mesh for piece in load_arm("panda").visuals) == 2


def test_the_double_pendulum_is_the_textbook_one() -> None:
    arm = load_arm("double-pendulum")
    data = arm.model.createData()
    m, length, r, g = 2.0, 0.5, 0.03, 9.81
    inertia = m * (3 * r**2 + length**2) / 12
    q = np.array([0.7, -1.1])
    c2 = np.cos(q[1])
    outer = inertia + m * length**2 / 4
    coupling = outer + m * length**2 / 2 * c2
    inner = inertia + m * length**2 / 4 + outer + m * length**2 + m * length**2 * c2
    mass = pin.crba(arm.model, data, q)
    np.testing.assert_allclose(
        [mass[0, 0], mass[0, 1], mass[1, 1]], [inner, coupling, outer], rtol=1e-12
    )
    both = q[0] + q[1]
    weight = (
        m * g * length * np.array([1.5 * np.sin(q[0]) + 0.5 * np.sin(both), 0.5 * np.sin(both)])
    )
    gravity = pin.computeGeneralizedGravity(arm.model, data, q)
    np.testing.assert_allclose(gravity, weight, rtol=1e-12)
    pin.framesForwardKinematics(arm.model, data, np.array([np.pi / 2, 0.0]))
    np.testing.assert_allclose(data.oMf[arm.tip].translation, [0.0, 1.0, 1.3], atol=1e-12)


def test_the_scara_is_the_textbook_one() -> None:
    """Two links in the plane, and a quill whose weight only its own motor carries."""
    arm = load_arm("scara")
    data = arm.model.createData()
    q = np.array([0.3, 1.1, 0.05, -0.7])
    pin.framesForwardKinematics(arm.model, data, q)
    tip = data.oMf[arm.tip]
    x, y = 0.4 * np.cos(0.3) + 0.3 * np.cos(1.4), 0.4 * np.sin(0.3) + 0.3 * np.sin(1.4)
    np.testing.assert_allclose(tip.translation, [x, y, 0.28 + 0.05], atol=1e-15)
    np.testing.assert_allclose(tip.rotation, pin.exp3(np.array([0.0, 0.0, 0.7])), atol=1e-15)
    gravity = pin.computeGeneralizedGravity(arm.model, data, q)
    np.testing.assert_allclose(gravity, [0.0, 0.0, 1.5 * 9.81, 0.0], atol=1e-12)
    mass = pin.crba(arm.model, data, q)
    assert mass[2, 2] == pytest.approx(1.5 + arm.model.armature[2], rel=1e-14)
    np.testing.assert_allclose(mass[2, [0, 1, 3]], 0.0, atol=1e-15)


def test_an_unknown_name_is_refused_with_those_there_are() -> None:
    with pytest.raises(LabError, match=r"'ur6'.*ur5, panda, double-pendulum"):
        load_arm("ur6")
