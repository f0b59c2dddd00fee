"""Resolved-rate inverse kinematics: against NumPy's pseudo-inverse, a minimiser, and its bound."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import lsq_linear

from labs.algorithms.inverse_kinematics import (
    INVERSE_KINEMATICS_METHODS,
    REACH_TOLERANCE,
    damped_least_squares,
    jacobian_transpose,
    joint_rates,
    manipulability,
    nearest_distance,
    pose_error,
    pseudo_inverse,
    scale_to_speed_limit,
)
from labs.algorithms.jacobian import ForwardKinematics, geometric_jacobian
from labs.arrays import clip_norm
from labs.models.arms import load_arm

RNG = np.random.default_rng(11)


def matrix(m: int, n: int, sigma: list[float]) -> np.ndarray:
    """A Jacobian (m, n) with these singular values."""
    u, _ = np.linalg.qr(RNG.normal(size=(m, m)))
    r, _ = np.linalg.qr(RNG.normal(size=(n, n)))
    k = len(sigma)
    product: np.ndarray = (u[:, :k] * sigma) @ r[:, :k].T
    return product


SHAPES = [
    pytest.param(3, 6, [1.2, 0.7, 0.2], id="wide"),
    pytest.param(6, 6, [2.0, 1.5, 1.0, 0.5, 0.3, 0.1], id="square"),
    pytest.param(6, 4, [2.0, 1.0, 0.5, 0.1], id="tall"),
    pytest.param(3, 6, [1.2, 0.7], id="rank 2"),
]


@pytest.mark.parametrize(("m", "n", "sigma"), SHAPES)
def test_the_pseudo_inverse_is_numpys(m: int, n: int, sigma: list[float]) -> None:
    j, v = matrix(m, n, sigma), RNG.normal(size=m)
    np.testing.assert_allclose(pseudo_inverse(j, v), np.linalg.pinv(j, rcond=1e-10) @ v, atol=1e-12)


@pytest.mark.parametrize(("m", "n", "sigma"), SHAPES)
def test_damped_least_squares_minimises_what_it_says(m: int, n: int, sigma: list[float]) -> None:
    """|J q' - v|^2 + lambda^2 |q'|^2, as an ordinary least-squares problem of SciPy."""
    j, v, damping = matrix(m, n, sigma), RNG.normal(size=m), 0.3
    stacked = np.concatenate([j, damping * np.eye(n)])
    best = lsq_linear(stacked, np.concatenate([v, np.zeros(n)])).x
    np.testing.assert_allclose(damped_least_squares(j, v, damping), best, atol=1e-12)


@pytest.mark.parametrize(("m", "n", "sigma"), SHAPES)
def test_little_damping_is_the_pseudo_inverse(m: int, n: int, sigma: list[float]) -> None:
    j, v = matrix(m, n, sigma), RNG.normal(size=m)
    exact = pseudo_inverse(j, v)
    errors = [np.abs(damped_least_squares(j, v, damping) - exact).max() for damping in (1e-2, 1e-3)]
    assert errors[1] < 1.5e-2 * errors[0], "the error falls as lambda^2"


def test_damping_bounds_the_joint_speed_and_the_bound_is_tight() -> None:
    for damping in (0.01, 0.1, 0.7):
        for _ in range(200):
            j = matrix(3, 6, sorted(10.0 ** RNG.uniform(-4, 1, 3), reverse=True))
            v = RNG.normal(size=3)
            bound = np.linalg.norm(v) / (2 * damping)
            assert np.linalg.norm(damped_least_squares(j, v, damping)) <= bound * (1 + 1e-12)
        u = np.array([1.0, 0.0, 0.0])
        worst = damping * np.outer(u, np.eye(6)[0])
        assert np.linalg.norm(damped_least_squares(worst, u, damping)) == pytest.approx(
            1 / (2 * damping)
        )


def test_the_pseudo_inverse_has_no_bound_and_the_transpose_fades() -> None:
    for sigma in (1e-2, 1e-4, 1e-6):
        j = np.diag([1.0, 1.0, sigma])
        v = np.array([0.0, 0.0, 1.0])
        assert np.linalg.norm(pseudo_inverse(j, v)) == pytest.approx(1 / sigma)
        assert np.linalg.norm(jacobian_transpose(j, v)) == pytest.approx(sigma)


def test_the_transpose_goes_down_the_gradient_of_the_squared_error() -> None:
    arm = load_arm("ur5")
    kinematics, target, d = ForwardKinematics(arm.model, arm.tip), np.array([0.4, 0.3, 0.5]), 1e-6

    def half_square(q: np.ndarray) -> float:
        error = target - kinematics.at(q).placement.translation
        return float(error @ error) / 2

    steps = d * np.eye(6)
    slope = [(half_square(arm.home + s) - half_square(arm.home - s)) / (2 * d) for s in steps]
    chain = kinematics.at(arm.home)
    rates = jacobian_transpose(geometric_jacobian(chain)[:3], target - chain.placement.translation)
    np.testing.assert_allclose(rates, -np.array(slope), atol=1e-9)


@pytest.mark.parametrize("robot", ["ur5", "panda", "scara"])
@pytest.mark.parametrize("method", INVERSE_KINEMATICS_METHODS)
def test_it_converges_to_a_pose_within_reach(method: str, robot: str) -> None:
    """From home to where known joint angles lead, all six rows."""
    arm = load_arm(robot)
    kinematics = ForwardKinematics(arm.model, arm.tip)
    goal = kinematics.at(arm.home + 0.1 * np.linspace(-1, 1, arm.model.nv)).placement
    q = arm.home.copy()
    steps = {"pseudo-inverse": (0.5, 60), "damped": (0.5, 200), "transpose": (0.4, 1500)}
    gain, count = steps[method]
    for _ in range(count):
        chain = kinematics.at(q)
        q = q + gain * joint_rates(
            method, geometric_jacobian(chain), pose_error(chain.placement, goal), 0.1
        )
    assert np.abs(pose_error(kinematics.at(q).placement, goal)).max() < 1e-8
    np.testing.assert_allclose(pose_error(goal, goal), np.zeros(6), atol=1e-15)


def test_the_pose_error_leads_to_the_target_in_a_second() -> None:
    placement, target = pin.SE3.Random(), pin.SE3.Random()
    error = pose_error(placement, target)
    np.testing.assert_allclose(placement.translation + error[:3], target.translation)
    np.testing.assert_allclose(pin.exp3(error[3:]) @ placement.rotation, target.rotation, atol=1e-9)


def test_limits_keep_the_direction() -> None:
    for vector in RNG.normal(size=(50, 6)):
        for limited, size in (
            (clip_norm(vector, 0.8), np.linalg.norm),
            (scale_to_speed_limit(vector, 0.8), peak),
        ):
            assert size(limited) <= 0.8 * (1 + 1e-12)
            np.testing.assert_allclose(limited * (size(vector) / size(limited)), vector)
    small = np.array([0.1, -0.2])
    assert clip_norm(small, 0.5) is small
    assert scale_to_speed_limit(small, 0.5) is small


def peak(vector: np.ndarray) -> float:
    return float(np.abs(vector).max())


@pytest.mark.parametrize(("m", "n", "sigma"), SHAPES[:3])
def test_manipulability_is_the_root_of_a_determinant(m: int, n: int, sigma: list[float]) -> None:
    j = matrix(m, n, sigma)
    found, product = manipulability(j)
    np.testing.assert_allclose(found, sigma, rtol=1e-12)
    gram = j @ j.T if m <= n else j.T @ j
    assert product == pytest.approx(np.sqrt(np.linalg.det(gram)), rel=1e-10)


def test_the_nearest_distance_of_a_planar_arm_in_closed_form() -> None:
    """Links of 0.4 and 0.3 m on a slide of 0.3 m: a ring, extended up and down."""
    arm = load_arm("scara")
    kinematics, model = ForwardKinematics(arm.model, arm.tip), arm.model
    limits = model.lowerPositionLimit, model.upperPositionLimit
    height = kinematics.at(arm.home).placement.translation[2]
    top = height + limits[1][2] - arm.home[2]
    starts = [arm.home, arm.home + np.array([0.5, -0.7, 0.0, 0.0])]
    for target, wanted in (
        ([2.0, 0.0, height], 1.3),
        ([0.0, 0.7, height], 0.0),
        ([0.5, 0.2, top + 0.4], 0.4),
        ([1.0, 0.0, top + 0.4], 0.5),
    ):
        found = nearest_distance(kinematics, np.array(target), starts, *limits)
        assert found == pytest.approx(wanted, abs=REACH_TOLERANCE)


@pytest.mark.parametrize("robot", ["ur5", "panda", "scara"])
def test_no_place_a_posture_reaches_is_out_of_reach(robot: str) -> None:
    arm, rng = load_arm(robot), np.random.default_rng(5)
    kinematics, model = ForwardKinematics(arm.model, arm.tip), arm.model
    limits = model.lowerPositionLimit, model.upperPositionLimit
    within = np.maximum(limits[0], -np.pi), np.minimum(limits[1], np.pi)
    for q in rng.uniform(*within, (30, model.nq)):
        place = kinematics.at(q).placement.translation
        starts = [arm.home, *rng.uniform(*within, (5, model.nq))]
        assert nearest_distance(kinematics, place, starts, *limits) <= REACH_TOLERANCE
