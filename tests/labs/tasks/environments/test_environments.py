"""Environments to learn in, against what is known of them."""

import numpy as np
import pinocchio as pin
import pytest

from labs.errors import LabError
from labs.models.arms import load_arm
from labs.models.pendulums import ROD_LENGTH, ROD_MASS, ROD_RADIUS
from labs.tasks.environments.reach import MOVING_JOINTS, reach
from labs.tasks.environments.swing_up import swing_up

RANDOM = np.arange(1, 5, dtype=np.uint64)


def test_the_pendulum_steps_as_its_equation_says_and_costs_as_gymnasiums_does() -> None:
    """theta = 0 upright: v' = (m g L / 2 sin theta + u) / (m L^2 / 3 + m r^2 / 4); and
    theta^2 + 0.1 v^2 + 0.001 u^2."""
    environment, h = swing_up("pendulum"), 0.0125
    X = environment.initial_states(RANDOM.copy(), 200) * [1.0, 8.0]
    U = np.arange(200) % environment.control_count
    after, costs, ends = environment.step(X, U)
    theta = np.remainder(X[:, 0], 2 * np.pi) - np.pi
    u, v, q = environment.torques[U, 0], X[:, 1], X[:, 0]
    inertia = ROD_MASS * ROD_LENGTH**2 / 3 + ROD_MASS * ROD_RADIUS**2 / 4
    np.testing.assert_allclose(costs, theta**2 + 0.1 * v**2 + 0.001 * u**2, atol=1e-12)
    for _ in range(4):
        torque = 0.5 * ROD_MASS * 9.81 * ROD_LENGTH * -np.sin(q) + u
        v = np.clip(v + h * torque / inertia, -12, 12)
        q = q + h * v
    np.testing.assert_allclose(after, np.column_stack([q, v]), atol=1e-12)
    assert not ends.any()
    observed = environment.observe(X)
    around = np.column_stack([np.cos(theta), np.sin(theta)])
    np.testing.assert_allclose(observed[:, :2], around, atol=1e-6)
    assert observed.dtype == np.float32


@pytest.mark.parametrize("name", ["pendulum", "double-pendulum"])
def test_rest_at_the_goal_costs_nothing_without_torque(name: str) -> None:
    environment = swing_up(name)
    idle = int(np.flatnonzero(~environment.torques.any(axis=1))[0])
    X = np.concatenate([environment.goal, np.zeros(environment.mechanism.nq)])[None]
    after, costs, _ = environment.step(X, np.array([idle]))
    np.testing.assert_allclose(after, X, atol=1e-9)
    assert costs[0] == pytest.approx(0.0, abs=1e-20)
    turned = X.copy()
    turned[0, 0] += 2 * np.pi
    assert environment.step(turned, np.array([idle]))[1][0] == pytest.approx(0.0, abs=1e-20)


def test_an_unknown_swing_up_is_refused() -> None:
    with pytest.raises(LabError, match="there are pendulum, double-pendulum"):
        swing_up("acrobat")


def test_the_reaching_arm_is_the_ur5_with_its_other_joints_locked() -> None:
    environment, arm = reach(), load_arm("ur5")
    X = environment.initial_states(RANDOM.copy(), 5)
    for q, tip in zip(X[:, :2], environment.tips(X[:, :2]), strict=True):
        whole = arm.home.copy()
        whole[list(MOVING_JOINTS)] = q
        data = arm.model.createData()
        pin.framesForwardKinematics(arm.model, data, whole)
        np.testing.assert_allclose(tip, data.oMf[arm.tip].translation, atol=1e-12)


def test_a_reaching_arm_left_alone_stays() -> None:
    environment = reach()
    idle = int(np.flatnonzero(~environment.torques.any(axis=1))[0])
    X = environment.initial_states(RANDOM.copy(), 20)
    after, costs, _ = environment.step(X, np.full(20, idle))
    np.testing.assert_allclose(after, X, atol=1e-9)
    way = environment.tips(X[:, 4:]) - environment.tips(X[:, :2])
    np.testing.assert_allclose(costs, np.linalg.norm(way, axis=1), atol=1e-12)
    np.testing.assert_allclose(environment.observe(X)[:, 4:7], way, atol=1e-6)
