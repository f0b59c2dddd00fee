"""Laps: their paths and joint motions by finite differences, and the system along them against
the mechanism itself."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from labs.errors import LabError
from labs.models.discrete import DiscreteMechanism
from labs.models.mechanisms import mechanism
from labs.optimal_control.lqr_tracking.laps import (
    CONTROL_PERIOD,
    INTEGRATION_METHOD,
    PATHS,
    PLANES,
    ReferencePath,
    lap,
    side_force,
    tracked_point,
)

UR5 = ReferencePath("ur5", "circle", 0.15, 200)
CART = ReferencePath("cart-pole", "circle", 0.4, 200)


@pytest.mark.parametrize("name", PATHS)
def test_paths_have_their_derivatives(name: str) -> None:
    phase, d = np.linspace(0.01, 0.99, 14), 1e-5
    ahead, behind = PATHS[name](phase + d), PATHS[name](phase - d)
    _, ds, dds = PATHS[name](phase)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * d), ds, atol=1e-7)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * d), dds, atol=1e-5)


def test_paths_close_and_touch_the_unit_circle() -> None:
    for path in PATHS.values():
        phase = np.arange(800) / 800
        s = path(phase)[0]
        assert np.linalg.norm(s, axis=1).max() == pytest.approx(1.0)
        np.testing.assert_allclose(s[-1], s[0], atol=0.01)
    np.testing.assert_allclose(PATHS["square"](np.array([0.125]))[0], [[0.5**0.5, 0.5**0.5]])


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("path", PATHS)
def test_the_arm_goes_round_and_keeps_its_hand_level(plane: str, path: str) -> None:
    course = replace(UR5, plane=plane, path=path)
    along, robot = lap(course), mechanism("ur5")
    model, data, tip = robot.model, robot.data, robot.arm.tip
    pin.framesForwardKinematics(model, data, robot.arm.home)
    home = data.oMf[tip].copy()
    flat = PATHS[path](np.arange(200) / 200)[0]
    for x, s, point in zip(along.x_ref, flat, along.points, strict=True):
        pin.framesForwardKinematics(model, data, x[:6])
        target = home.translation + course.size * s @ np.array(PLANES[plane])
        np.testing.assert_allclose(data.oMf[tip].translation, target, atol=1e-9)
        np.testing.assert_allclose(point, target, atol=1e-9)
        np.testing.assert_allclose(data.oMf[tip].rotation, home.rotation, atol=1e-9)


@pytest.mark.parametrize("course", [UR5, CART, replace(UR5, plane="side")])
def test_velocities_and_inverse_dynamics_are_those_of_the_motion(course: ReferencePath) -> None:
    """By central differences along the lap, which closes; u_ref by those of the velocity."""
    along, robot = lap(course), mechanism(course.robot)
    q, v = np.split(along.x_ref, 2, axis=1)

    def rate(row: np.ndarray) -> np.ndarray:
        one, two = (np.roll(row, -k, 0) - np.roll(row, k, 0) for k in (1, 2))
        found: np.ndarray = (8.0 * one - two) / (12.0 * CONTROL_PERIOD)
        return found

    np.testing.assert_allclose(rate(q), v, atol=2e-5)
    torque = [pin.rnea(robot.model, robot.data, *row) for row in zip(q, v, rate(v), strict=True)]
    expected = np.array(torque)[:, list(robot.actuated_joints)]
    np.testing.assert_allclose(along.u_ref, expected, atol=2e-3)
    assert np.abs(along.u_ref).max() > 0.5


def test_feed_forward_takes_gravity_or_nothing() -> None:
    robot = mechanism("ur5")
    along = lap(UR5, "gravity")
    np.testing.assert_allclose(along.u_ref[7], robot.equilibrium_control(along.x_ref[7, :6]))
    np.testing.assert_array_equal(lap(UR5, "none").u_ref, 0.0)


@pytest.mark.parametrize("course", [UR5, CART, replace(CART, path="square")])
@pytest.mark.parametrize("force", [0.0, 7.0])
def test_deviations_move_as_the_mechanism_does(course: ReferencePath, force: float) -> None:
    """c is exact; A and B are the derivatives, by central differences."""
    along, robot = lap(course, "gravity", force), mechanism(course.robot)
    discrete = DiscreteMechanism(robot, CONTROL_PERIOD, INTEGRATION_METHOD)
    for t in (0, 57, course.samples - 1):
        x, u = along.x_ref[t], along.u_ref[t]
        held = u + side_force(robot, x[: robot.nq], force)
        after = along.x_ref[(t + 1) % course.samples]
        np.testing.assert_allclose(along.c[t], discrete.step(x, held) - after, atol=1e-12)
        for i, d in enumerate(1e-5 * np.eye(robot.nx)):
            slope = (discrete.step(x + d, held) - discrete.step(x - d, held)) / 2e-5
            np.testing.assert_allclose(along.a[t][:, i], slope, atol=1e-6)
        for i, d in enumerate(1e-3 * np.eye(robot.nu)):
            slope = (discrete.step(x, held + d) - discrete.step(x, held - d)) / 2e-3
            np.testing.assert_allclose(along.b[t][:, i], slope, atol=1e-7)


def test_the_defect_says_how_far_the_reference_is_from_a_motion() -> None:
    """With inverse dynamics only the held control is left, which halves with the step; without,
    gravity's h M^-1 g."""
    fine, coarse = (np.abs(lap(replace(UR5, samples=n)).c).max() for n in (400, 200))
    assert fine < 0.6 * coarse
    assert np.abs(lap(UR5, "none").c).max() > 100 * np.abs(lap(UR5).c).max()
    jump = lap(replace(CART, path="square")).c
    expected = np.zeros_like(jump)
    expected[[99, 199], 0] = 0.8, -0.8
    np.testing.assert_allclose(jump, expected, atol=1e-12)


@pytest.mark.parametrize("course", [UR5, CART])
def test_a_side_force_does_its_work_at_what_is_tracked(course: ReferencePath) -> None:
    robot, rng = mechanism(course.robot), np.random.default_rng(0)
    q, v = lap(course).x_ref[30, : robot.nq], rng.standard_normal(robot.nq)
    moved = (tracked_point(robot, q + 1e-6 * v) - tracked_point(robot, q - 1e-6 * v))[1] / 2e-6
    power = side_force(robot, q, 9.0) @ v[list(robot.actuated_joints)]
    assert power == pytest.approx(9.0 * moved, rel=1e-6)


def test_wrong_courses_are_refused() -> None:
    with pytest.raises(LabError, match="does not reach"):
        lap(replace(UR5, size=0.8))
    with pytest.raises(LabError, match="there are circle, square"):
        lap(replace(UR5, path="spiral"))
    with pytest.raises(LabError, match="there are inverse-dynamics"):
        lap(UR5, "perfect")
