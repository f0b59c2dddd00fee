"""The motions as optimal control problems in continuous time: objectives, limits, constraints."""

import numpy as np
import pytest

from labs.errors import LabError
from labs.models.mechanisms import mechanism
from labs.tasks.motion.continuous import (
    CONTINUOUS_MOTIONS,
    OBJECTIVES,
    MotionLimits,
    continuous_motion,
)
from labs.tasks.motion.motions import MotionWeights
from labs.tasks.motion.tip_constraints import Ball, ObstacleConstraint, TipTargetConstraint

TARGET = np.array([0.4, -0.35, 0.25])
BALLS = (Ball(np.array([0.3, -0.2, 0.4]), 0.1), Ball(np.array([0.1, 0.5, 0.3]), 0.2))


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("name", CONTINUOUS_MOTIONS)
def test_every_motion_has_every_objective(name: str, objective: str) -> None:
    problem = continuous_motion(name, objective, 1.0, target=TARGET, T_limits=(0.5, 2.0))
    m, goal = mechanism(name), CONTINUOUS_MOTIONS[name].goal
    rng = np.random.default_rng(0)
    X, U = rng.normal(size=(3, m.nx)), rng.normal(size=(3, m.nu))
    scaled = (U - m.equilibrium_control(m.arm.home)) / CONTINUOUS_MOTIONS[name].control_scale
    running = {
        "least-time": np.ones(3),
        "least-energy": (scaled**2).sum(axis=1),
        "fastest-end": np.zeros(3),
    }
    if objective in running:
        np.testing.assert_allclose(problem.cost.running(X, U), running[objective])
        assert problem.x_final is not None
        assert np.isnan(problem.x_final[: m.nq]).all() == (not goal)
        assert np.isnan(problem.x_final[m.nq :]).all() == (objective == "fastest-end")
        assert (problem.end is None) == bool(goal)
    else:
        assert problem.x_final is None
    if objective == "fastest-end":
        shown = m.nq + CONTINUOUS_MOTIONS[name].shown_joint
        assert problem.cost.final(X[0]) == pytest.approx(-X[0, shown])


@pytest.mark.parametrize("exact", [False, True])
def test_the_derivatives_of_the_cost_are_those_of_finite_differences(exact: bool) -> None:
    weights = MotionWeights(7.0, 5.0, 3.0, 2.0, 0.5)
    limits = MotionLimits((-0.2,) * 6, (0.3,) * 6, 0.4, obstacles=BALLS, soft_weight=20.0)
    cost = continuous_motion(
        "ur5", "weighted", 1.0, weights=weights, limits=limits, target=TARGET
    ).cost
    rng, eps = np.random.default_rng(0), 1e-6
    x, u = rng.normal(size=12), rng.normal(size=6)
    gradient, hessian = cost.final_derivatives(x, exact)
    running = cost.running_derivatives(x[None], u[None], exact)
    for i, e in enumerate(eps * np.eye(12)):
        slope = (cost.final(x + e) - cost.final(x - e)) / (2 * eps)
        assert gradient[i] == pytest.approx(slope, abs=1e-6)
        ahead, behind = cost.running(x[None] + e, u[None]), cost.running(x[None] - e, u[None])
        assert running.l_x[0, i] == pytest.approx((ahead[0] - behind[0]) / (2 * eps), abs=1e-5)
        if exact:
            after, before = (cost.final_derivatives(x + s * e, True)[0] for s in (1, -1))
            np.testing.assert_allclose(hessian[:, i], (after - before) / (2 * eps), atol=1e-5)
    assert np.linalg.eigvalsh(cost.final_derivatives(x, False)[1])[0] > -1e-9


def test_constraints_of_the_tip_and_their_jacobians() -> None:
    m = mechanism("ur5")
    x = np.concatenate([m.arm.home, np.zeros(6)])
    outside, at = ObstacleConstraint(m, BALLS), TipTargetConstraint(m, TARGET)
    p = m.tip(m.arm.home)
    np.testing.assert_allclose(at.values(x[None])[0], p - TARGET)
    center, r = BALLS[0]
    expected = (r**2 - ((p - center) ** 2).sum()) / (2 * r)
    assert outside.values(x[None])[0, 0] == pytest.approx(expected)
    surface = ObstacleConstraint(m, (Ball(p + np.array([0.0, 0.0, 0.11]), 0.1),))
    assert surface.values(x[None])[0, 0] == pytest.approx(-0.01, rel=0.1), "nearly the depth"
    for constraint in (outside, at):
        J = constraint.jacobians(x[None])[0]
        for i, e in enumerate(1e-6 * np.eye(12)):
            ahead, behind = constraint.values((x + e)[None]), constraint.values((x - e)[None])
            np.testing.assert_allclose(J[:, i], (ahead - behind)[0] / 2e-6, atol=1e-7)


def test_limits_are_bounds_or_a_cost() -> None:
    limits = MotionLimits((-1.0, -4.0), (1.0, 4.0), 3.0, 0.5)
    hard = continuous_motion("cart-pole", "weighted", 1.0, limits=limits)
    np.testing.assert_array_equal(hard.x_lower, [-1.0, -4.0, -3.0, -3.0])
    np.testing.assert_array_equal(hard.u_upper, [10.0])
    soft = continuous_motion(
        "cart-pole", "weighted", 1.0, limits=MotionLimits((-1.0, -4.0), (1.0, 4.0), 3.0, 0.5, (), 9)
    )
    assert np.isinf(soft.x_lower).all()
    x, u = np.array([[1.2, 0.0, 0.0, -3.5]]), np.zeros((1, 1))
    more = soft.cost.running(x, u) - hard.cost.running(x, u)
    assert more[0] == pytest.approx(9 * (0.2**2 + 0.5**2))


def test_wrong_use_is_said() -> None:
    with pytest.raises(LabError, match="no motion is named 'duck'; there are mass"):
        continuous_motion("duck", "weighted", 1.0)
    with pytest.raises(LabError, match="no objective is named 'cheapest'; there are weighted"):
        continuous_motion("mass", "cheapest", 1.0)
    with pytest.raises(LabError, match="takes limits between which T is free"):
        continuous_motion("mass", "least-time", 1.0)
    with pytest.raises(LabError, match="ur5 takes a target"):
        continuous_motion("ur5", "least-energy", 1.0)
    with pytest.raises(LabError, match="is to lie within its limits"):
        continuous_motion("mass", "least-time", 1.0, T_limits=(2.0, 3.0))
