"""The motions to plan: their cost term by term, guesses, and new time steps."""

import numpy as np
import pinocchio as pin
import pytest

from labs.errors import LabError
from labs.models.mechanisms import mechanism
from labs.tasks.motion.motions import (
    MOTIONS,
    MotionWeights,
    initial_controls,
    motion_problem,
    resample_controls,
)

WEIGHTS = MotionWeights(goal=7.0, rest=5.0, posture=3.0, velocity=2.0, control=0.5)
TARGET = np.array([0.4, 0.2, 0.3])


@pytest.mark.parametrize("name", MOTIONS)
def test_the_cost_is_that_of_the_docstring(name: str) -> None:
    N, h, motion, moved = 6, 0.02, MOTIONS[name], mechanism(name)
    n, rng = moved.nq, np.random.default_rng(1)
    problem = motion_problem(name, WEIGHTS, N, h, target=TARGET)
    X, U = rng.normal(size=(N + 1, 2 * n)), rng.normal(size=(N, moved.nu))
    held = pin.computeGeneralizedGravity(moved.model, moved.data, moved.arm.home)[
        list(moved.actuated_joints)
    ]
    before = np.array(motion.goal) if motion.goal else moved.arm.home
    J = 0.0
    for x, u in zip(X[:-1], U, strict=True):
        J += h * 3.0 * ((x[:n] - before) ** 2).sum() + h * 2.0 * (x[n:] ** 2).sum()
        J += h * 0.5 * (((u - held) / motion.control_scale) ** 2).sum()
    off = X[-1, :n] - motion.goal if motion.goal else moved.tip(X[-1, :n]) - TARGET
    J += 7.0 * (off**2).sum() + 5.0 * (X[-1, n:] ** 2).sum()
    assert problem.cost.value(X, U) == pytest.approx(J)
    np.testing.assert_array_equal(problem.x0, [*moved.arm.home, *np.zeros(n)])


@pytest.mark.parametrize("name", [name for name, motion in MOTIONS.items() if motion.goal])
def test_the_goal_of_a_swing_up_is_to_balance_upright(name: str) -> None:
    moved, goal = mechanism(name), np.array(MOTIONS[name].goal)
    assert moved.tip(goal)[2] > moved.tip(moved.arm.home)[2] + 0.9
    at_rest = np.concatenate([goal, np.zeros(len(goal))])
    np.testing.assert_allclose(moved.f(at_rest, np.zeros(moved.nu)), 0.0, atol=1e-12)


def test_the_size_of_a_pendulums_control_holds_it_level() -> None:
    level = {"pendulum": [np.pi / 2], "double-pendulum": [np.pi / 2, 0.0]}
    for name, q in level.items():
        np.testing.assert_allclose(
            mechanism(name).equilibrium_control(np.array(q)), MOTIONS[name].control_scale
        )


def test_the_first_guess_is_a_push_or_a_swing_within_the_bound() -> None:
    problem = motion_problem("pendulum", WEIGHTS, 100, 0.01, limit=0.3)
    size = np.array([2.0])
    np.testing.assert_array_equal(initial_controls(problem, size, 0.1, 0.0), np.full((100, 1), 0.2))
    swing = initial_controls(problem, size, 0.1, 1.0)[:, 0]
    np.testing.assert_allclose(swing, 0.2 * np.cos(0.02 * np.pi * np.arange(100)), atol=1e-15)
    assert initial_controls(problem, size, 9.0, 0.0).max() == pytest.approx(0.3 * 4.905)
    reach = motion_problem("ur5", WEIGHTS, 3, 0.01, target=TARGET)
    still = initial_controls(reach, np.ones(6), 0.0, 0.0)
    arm = mechanism("ur5")
    np.testing.assert_allclose(arm.f(np.r_[arm.arm.home, np.zeros(6)], still[2]), 0.0, atol=1e-9)


def test_controls_fit_another_step_and_horizon() -> None:
    U = np.arange(4.0)[:, None]
    np.testing.assert_array_equal(resample_controls(U, 0.02, 0.02, 4), U)
    np.testing.assert_array_equal(resample_controls(U, 0.02, 0.02, 2), U[:2])
    np.testing.assert_array_equal(
        resample_controls(U, 0.02, 0.01, 10)[:, 0], [0, 0, 1, 1, 2, 2, 3, 3, 3, 3]
    )
    np.testing.assert_array_equal(resample_controls(U, 0.01, 0.02, 3)[:, 0], [1, 3, 3])


def test_wrong_use_is_said() -> None:
    with pytest.raises(LabError, match="no motion is named 'ant'"):
        motion_problem("ant", WEIGHTS, 3, 0.01)
    with pytest.raises(LabError, match="takes a target"):
        motion_problem("ur5", WEIGHTS, 3, 0.01)
