"""The linear loops against the integrators and against the nonlinear robot itself."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import fsolve

from labs.algorithms.integrators import INTEGRATORS
from labs.algorithms.joint_control import CONTROL_LAWS, Gains
from labs.models.plant import plant
from labs.reactive_control.joint_control.divergence import divergence_message
from labs.reactive_control.joint_control.remedies import (
    GAIN_MARGIN,
    AvailableSettings,
    find_remedies,
    robustly_stable,
)
from labs.reactive_control.joint_control.sampled_control import SampledLoop, simulate_sampled
from labs.reactive_control.joint_control.sampled_stability import (
    GROWTH_TOLERANCE,
    LinearisedRobot,
    LinearLoop,
    LoopParameters,
)

DEFAULT = LoopParameters("pd-gravity", Gains(200.0, 0.0, 30.0), 1e-3, "semi-implicit-euler", 1e-3)
UNSTABLE = {
    "gains": replace(DEFAULT, controller="pid", gains=Gains(200.0, 2000.0, 10.0)),
    "period": replace(DEFAULT, control_period=0.02, integrator="rk4"),
    "integrator": replace(DEFAULT, gains=Gains(200.0, 0.0, 0.0), integrator="explicit-euler"),
}
AVAILABLE = AvailableSettings(
    (0.001, 0.002, 0.005, 0.01, 0.02, 0.05), (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3), 2000.0, 200.0
)


def linear(robot: str = "ur5", payload: float = 0.0, friction: float = 0.0) -> LinearLoop:
    world, known = plant(robot, payload), plant(robot)
    q = known.arm.home
    return LinearLoop(
        LinearisedRobot.near(world.model, world.data, q, friction), known.model, known.data, q
    )


def growth_of_the_robot(setting: LoopParameters, start: float, seconds: float) -> float:
    """Measured on the nonlinear UR5 by the power method: the growth rate of a tiny deviation
    from rest at home, scaled back to `start` after every control period."""
    world = plant("ur5")
    home, n = world.arm.home, 6
    held = np.zeros(n)
    loop = SampledLoop(
        law=CONTROL_LAWS[setting.controller](world.model, world.model.createData(), setting.gains),
        limit=np.full(n, np.inf),
        acceleration=world.acceleration(held),
        held=held,
        integrate=INTEGRATORS[setting.integrator].step,
        h=setting.step,
        integral_gain=setting.period,
    )
    steps = round(setting.period / setting.step)
    rest = np.zeros(n)
    if setting.controller == "pid":
        rest = pin.computeGeneralizedGravity(world.model, world.data, home) / setting.gains.ki
    x = np.random.default_rng(0).normal(size=(3, n))
    weight = np.array([[10.0], [1.0], [10.0]])  # makes a swing's q and v of one size
    x[2] *= setting.controller == "pid"
    logs: list[float] = []
    periods = round(seconds / setting.period)
    for _ in range(periods):
        x *= start / np.linalg.norm(weight * x)
        q, v, z, _ = simulate_sampled(
            loop,
            (0,),
            steps,
            (home[None], np.zeros((1, n)), np.zeros((1, n))),
            None,
            home + x[0],
            x[1],
            rest + x[2],
        )
        x = np.array([q - home, v, (z - rest) * (setting.controller == "pid")])
        logs.append(float(np.log(np.linalg.norm(weight * x) / start)))
    late = np.cumsum(logs)[periods // 2 :]
    return float(np.polyfit(setting.period * np.arange(len(late)), late, 1)[0])


def test_dynamics_are_the_derivatives_of_the_robot() -> None:
    world, b = plant("panda", 1.5), 2.0
    home = world.arm.home
    a_matrix, b_matrix = linear("panda", 1.5, b).robot.dynamics()
    n, d = len(home), 1e-6
    tau = pin.computeGeneralizedGravity(world.model, world.data, home).copy()
    for i, unit in enumerate(np.eye(n) * d):
        zero = np.zeros(n)
        by_q = [world.acceleration(tau, b)(home + s * unit, zero) for s in (1, -1)]
        by_v = [world.acceleration(tau, b)(home, s * unit) for s in (1, -1)]
        by_u = [world.acceleration(tau + s * unit, b)(home, zero) for s in (1, -1)]
        for pair, column in (
            (by_q, a_matrix[n:, i]),
            (by_v, a_matrix[n:, n + i]),
            (by_u, b_matrix[n:, i]),
        ):
            np.testing.assert_allclose((pair[0] - pair[1]) / (2 * d), column, atol=2e-6)


def test_a_pid_loop_has_its_textbook_stability_limit() -> None:
    """One joint of inertia m without gravity: stable while k_i < k_p k_d / m."""
    m = 1.7
    one = LinearLoop(
        LinearisedRobot(np.array([[m]]), np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1)),
        model := pin.buildSampleModelManipulator(),
        model.createData(),
        np.zeros(1),
    )
    for share, decays in ((0.999, True), (1.001, False)):
        gains = Gains(90.0, share * 90.0 * 4.0 / m, 4.0)
        # The law's matrices come from the model's size, so give it a one-joint model.
        single = pin.Model()
        single.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "joint")
        loop = replace(one, model=single, data=single.createData())
        poles = loop.poles(replace(DEFAULT, controller="pid", gains=gains))
        assert len(poles) == 3
        assert (poles.real.max() < 0) == decays


@pytest.mark.parametrize("fault", UNSTABLE)
def test_each_verdict_and_its_growth_hold_for_the_nonlinear_robot(fault: str) -> None:
    """The simulation grows as predicted; the two loops before the faulty one, simulated nearly
    continuously or nearly exactly, do not explain it."""
    loop, setting = linear(), UNSTABLE[fault]
    diagnosis = loop.diagnose(setting)
    assert diagnosis.fault == fault
    measured = growth_of_the_robot(setting, 1e-7, 1.0 if fault == "period" else 20.0)
    assert measured == pytest.approx(diagnosis.simulated, rel=0.03)

    nearly_exact = replace(setting, integrator="rk4", step=min(setting.step, 1e-3))
    nearly_continuous = replace(nearly_exact, control_period=1e-4, step=1e-4)
    if fault == "gains":
        assert growth_of_the_robot(nearly_continuous, 1e-7, 5.0) == pytest.approx(
            diagnosis.continuous, rel=0.05
        )
    else:
        assert diagnosis.continuous < GROWTH_TOLERANCE
    if fault == "period":
        assert growth_of_the_robot(nearly_exact, 1e-7, 1.0) == pytest.approx(
            diagnosis.sampled, rel=0.03
        )
    if fault == "integrator":
        assert growth_of_the_robot(nearly_exact, 1e-7, 12.0) < 0.6 * measured


@pytest.mark.parametrize("fault", UNSTABLE)
def test_what_is_proposed_works_on_the_nonlinear_robot(fault: str) -> None:
    proposals = find_remedies([linear()], UNSTABLE[fault], AVAILABLE)
    assert len(proposals) == 2
    for setting in {setting for proposal in proposals for setting in proposal.settings}:
        if setting.controller == "pid" and setting.gains.ki == 0.0:
            continue  # it does not rest at home
        assert growth_of_the_robot(setting, 1e-7, 20.0) < 0.01


def test_a_proposed_step_is_tried_with_the_control_period_it_makes() -> None:
    """With steps of 2 ms a control period of 5 ms is 6 ms, with steps of 1 ms it is 5."""
    setting = replace(DEFAULT, control_period=5e-3, step=2e-3)
    assert setting.period == pytest.approx(6e-3)
    assert replace(setting, step=1e-3).period == pytest.approx(5e-3)
    setting = replace(UNSTABLE["integrator"], control_period=5e-3, step=5e-3)
    setting = replace(setting, gains=Gains(200.0, 0.0, 0.97))
    changes = [
        s for proposal in find_remedies([linear()], setting, AVAILABLE) for s in proposal.settings
    ]
    assert [change.step for change in changes] == [5e-3, 5e-4]
    assert all(change.control_period == 5e-3 for change in changes)


def test_a_proposed_control_period_is_one_that_can_be_chosen() -> None:
    setting = replace(UNSTABLE["period"], step=2e-3)
    proposal = find_remedies([linear()], setting, AVAILABLE)[0]
    assert proposal.text == "a control period of 2 ms"
    assert [change.control_period for change in proposal.settings] == [0.002]


def test_a_proposed_gain_is_no_more_cautious_than_its_margin() -> None:
    loop = linear()
    less_integral = find_remedies([loop], UNSTABLE["gains"], AVAILABLE)[0].settings[-1]
    bolder = replace(
        less_integral, gains=replace(less_integral.gains, ki=1.05 * less_integral.gains.ki)
    )
    assert robustly_stable([loop], less_integral)
    assert not robustly_stable([loop], bolder)
    for fault in ("period", "integrator"):
        damping = find_remedies([loop], UNSTABLE[fault], AVAILABLE)[-1]
        assert damping.text.startswith("k_d")
        ends = [setting.gains.kd for setting in damping.settings]
        for kd, factor in zip(ends, (0.9, 1.1), strict=True):
            inside = replace(UNSTABLE[fault], gains=Gains(200.0, 0.0, kd))
            assert robustly_stable([loop], inside)
            if 0.0 < kd < 200.0:
                outside = replace(inside, gains=Gains(200.0, 0.0, factor * kd))
                assert not robustly_stable([loop], outside)


DIVERGING_BY_DAMPING = LoopParameters("pid", Gains(330.0, 0.0, 60.0), 0.01, "explicit-euler", 0.01)
"""With explicit Euler at 10 ms too little damping is as bad as too much."""


def test_a_stable_interval_is_named_by_both_ends() -> None:
    loop, setting = linear(), DIVERGING_BY_DAMPING
    grows = {
        kd: loop.growth_rate(replace(setting, gains=Gains(330.0, 0.0, kd))) > GROWTH_TOLERANCE
        for kd in (1.5, 8.0, 60.0)
    }
    assert grows == {1.5: True, 8.0: False, 60.0: True}
    low, high = (
        s.gains.kd
        for proposal in find_remedies([loop], setting, AVAILABLE)
        if proposal.text.startswith("k_d from")
        for s in proposal.settings
    )
    assert 3.3 * GAIN_MARGIN < low < high < 15.0
    for kd in np.linspace(low, high, 12):
        assert loop.growth_rate(replace(setting, gains=Gains(330.0, 0.0, kd))) <= GROWTH_TOLERANCE
    assert f"k_d from {low:g} to {high:g}" in divergence_message([loop], setting, AVAILABLE)


def test_where_nothing_helps_nothing_is_proposed() -> None:
    """No law of these holds an upright arm by damping alone."""
    only_slow = AvailableSettings((0.05,), (0.01,), 0.02, 0.02)
    setting = replace(UNSTABLE["gains"], control_period=0.05, step=0.01)
    assert find_remedies([linear()], setting, only_slow) == []
    sentence = divergence_message([linear()], setting, only_slow)
    assert sentence.endswith("No stable setting was found near this one.")
    assert "Try" not in sentence
    assert "Try" not in divergence_message([linear()], DEFAULT, AVAILABLE)


def test_a_loop_that_needs_its_motors_to_survive_the_integrator_is_not_proposed() -> None:
    """Friction of 19 at the wrist and explicit Euler with 10 ms: M - h b < -M. Stiff feedback
    makes the linear loop stable, and with a motor at its limit it is not."""
    loop = linear(payload=2.8, friction=18.8)
    setting = LoopParameters("pid", Gains(1000.0, 0.0, 0.5), 0.002, "explicit-euler", 0.01)
    assert loop.growth_rate(setting) < -1.0
    assert loop.growth_rate(replace(setting, controller="open-loop")) > 10.0
    assert not robustly_stable([loop], setting)


def test_the_sag_is_where_the_robot_rests() -> None:
    """PD with gravity compensation under a payload it does not know of."""
    loop, setting = linear(payload=1.0), replace(DEFAULT, gains=Gains(2000.0, 0.0, 30.0))
    world, known = plant("ur5", 1.0), plant("ur5")
    home = world.arm.home

    def torque(q: np.ndarray) -> np.ndarray:
        held = 2000.0 * (home - q) + pin.computeGeneralizedGravity(known.model, known.data, q)
        lacking: np.ndarray = held - pin.computeGeneralizedGravity(world.model, world.data, q)
        return lacking

    rest = fsolve(torque, home, xtol=1e-12)
    assert loop.static_deviation(setting) == pytest.approx(np.abs(rest - home).max(), rel=0.02)
    assert linear().static_deviation(setting) == 0.0
    assert (
        loop.static_deviation(replace(setting, controller="pid", gains=Gains(2000.0, 1.0, 30.0)))
        == 0.0
    )
    assert loop.static_deviation(replace(setting, gains=Gains(0.0, 0.0, 30.0))) > 1.0


def test_the_default_is_stable_for_every_robot() -> None:
    for robot in ("ur5", "panda", "double-pendulum"):
        diagnosis = linear(robot).diagnose(DEFAULT)
        assert diagnosis.fault == ""
        assert diagnosis.simulated < -1.0


def test_explicit_euler_needs_damping_of_h_times_k_p() -> None:
    """v+ = v - h/m (k_p q + k_d v), q+ = q + h v has |z|^2 = 1 - h k_d/m + h^2 k_p/m."""
    sentence = divergence_message([linear()], UNSTABLE["integrator"], AVAILABLE)
    assert "Explicit Euler with 1 ms" in sentence
    assert "Semi-implicit Euler or k_d from 0.32 to 120." in sentence


def test_the_sentences_name_the_fault() -> None:
    assert "The gains are at fault" in divergence_message([linear()], UNSTABLE["gains"], AVAILABLE)
    assert "k_i of at most" in divergence_message([linear()], UNSTABLE["gains"], AVAILABLE)
    sentence = divergence_message([linear()], UNSTABLE["period"], AVAILABLE)
    assert "The control period is at fault: with continuous control the error would not grow" in (
        sentence
    )
    assert "Try a control period of 2 ms or k_d from 3.6 to 6.2." in sentence
    open_loop = divergence_message([linear()], replace(DEFAULT, controller="open-loop"), AVAILABLE)
    assert "Nothing feeds the error back" in open_loop
    assert "stable" in divergence_message([linear()], DEFAULT, AVAILABLE)
