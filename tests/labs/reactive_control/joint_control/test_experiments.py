"""The experiments of joint-control's article, in numbers."""

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.linalg import expm

from labs.models.plant import plant
from labs.params import Value
from labs.reactive_control.joint_control.sampled_stability import LinearisedRobot
from tests.labs.reactive_control.joint_control.runs import (
    ARTICLE,
    LAB,
    PUSHED,
    error,
    final_state,
    gravity,
    parameters,
    states,
)


@ARTICLE.verify("Open loop drifts")
def test_open_loop_drifts(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    path = list(states(params, 2.0))
    world = plant("ur5")
    a, _ = LinearisedRobot.near(world.model, world.data, path[0].q_ref, 0.0).dynamics()
    assert np.linalg.eigvals(a).real.max() == pytest.approx(4.46, abs=0.005)
    for k in (10, 20):
        start = np.concatenate([error(path[0]), np.zeros(6)])
        predicted = (expm(0.01 * k * a) @ start)[:6]
        np.testing.assert_allclose(error(path[k]), predicted, atol=0.0015)
    assert np.abs(error(path[-1])).max() > 1.0
    exact = final_state(parameters(setting, initial_error=0.0), 1.0)
    assert np.abs(error(exact)).max() < 1e-9
    assert ARTICLE.answer("Open loop drifts") == "It leaves."


@ARTICLE.verify("PD alone sags")
def test_pd_sags_by_what_gravity_asks(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    rest = final_state(params, 10.0)
    weight = gravity(params, rest.q)
    np.testing.assert_allclose(params.kp * error(rest), weight, rtol=1e-3, atol=1e-3)
    assert error(rest)[1:3] == pytest.approx([-0.158, -0.049], abs=6e-4)
    assert gravity(params, rest.q_ref)[1] == pytest.approx(-28, abs=0.5)
    assert weight[1] == pytest.approx(-31.7, abs=0.05)
    stiffer = error(final_state(parameters(setting, kp=400.0), 10.0))
    assert stiffer[1] == pytest.approx(error(rest)[1] / 2, rel=0.1)


@ARTICLE.verify("The integral removes the sag")
def test_the_integral_removes_the_sag(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    rest = final_state(params, 20.0)
    assert np.abs(error(rest)).max() < 1e-6
    np.testing.assert_allclose(rest.torque, gravity(params, rest.q_ref), atol=1e-4)
    np.testing.assert_allclose(params.ki * rest.integral, rest.torque, atol=1e-3)


@ARTICLE.verify("Too much integral oscillates")
def test_too_much_integral_oscillates(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    path = list(states(params, 20.0))
    swings = np.array([error(s)[1] for s in path])
    early, late = swings[500:1000], swings[1500:]
    assert np.abs(late).max() > 1.3 * np.abs(early).max()
    fields = LAB.fields(params, path[0])
    rightmost = np.argmax(fields["poles_re"])
    assert fields["poles_re"][rightmost] > 0.0
    crossings = np.flatnonzero(np.diff(np.sign(late)) > 0) * LAB.period
    expected = 2 * np.pi / abs(fields["poles_im"][rightmost])
    assert np.diff(crossings).mean() == pytest.approx(expected, rel=0.05)
    assert np.abs(error(final_state(parameters(setting, kd=60.0), 20.0))).max() < 1e-6


@ARTICLE.verify("Gravity compensation needs no integral")
def test_gravity_compensation_needs_no_integral(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    rest = final_state(params, 5.0)
    assert np.abs(error(rest)).max() < 1e-6
    np.testing.assert_allclose(rest.torque, gravity(params, rest.q_ref), atol=1e-4)
    assert not rest.integral.any()
    settled = LAB.measure(params, rest)["settling_time"]
    assert isinstance(settled, float)
    assert 0.3 < settled < 1.0
    assert ARTICLE.answer("Gravity compensation needs no integral") == "At the set point."


@ARTICLE.verify("An unknown payload brings the sag back")
def test_an_unknown_payload_brings_the_sag_back(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    rest = final_state(params, 10.0)
    missing = plant("ur5").tip_jacobian(rest.q).T @ np.array([0.0, 0.0, 5.0 * 9.81])
    np.testing.assert_allclose(params.kp * error(rest), missing, rtol=1e-3, atol=1e-3)
    assert error(rest)[1] == pytest.approx(-0.105, abs=5e-4)


@ARTICLE.verify("Floating")
def test_a_floating_arm_stays_where_it_stops(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    still = final_state(params, 2.0)
    assert np.abs(still.v).max() < 1e-9
    path = list(states(params, 20.0, {100: PUSHED}))
    assert np.abs(error(path[-1])).max() > 0.3
    assert np.abs(path[-1].v).max() < 1e-3
    np.testing.assert_allclose(path[-1].q, path[-200].q, atol=2e-3)
    held = final_state(parameters(setting, kp=200.0), 20.0, {100: PUSHED})
    assert np.abs(error(held)).max() < 1e-3
    assert ARTICLE.answer("Floating") == "It stays where it stops."


@ARTICLE.verify("Computed torque makes joints alike")
def test_computed_torque_makes_every_joint_alike(setting: Mapping[str, Value]) -> None:
    for k, state in enumerate(states(parameters(setting), 1.5)):
        t = k * LAB.period
        expected = -0.3 * (1 + 10 * t) * np.exp(-10 * t)
        np.testing.assert_allclose(error(state), expected, atol=2e-3)
        assert np.ptp(error(state)) < 1e-5
    loaded = [np.ptp(error(s)) for s in states(parameters(setting, payload=5.0), 1.5)]
    assert max(loaded) > 0.02
    assert ARTICLE.answer("Computed torque makes joints alike") == "None: all are alike."


@ARTICLE.verify("Explicit Euler without damping")
def test_explicit_euler_without_damping_gains_energy(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    *path, stopped = states(params, 10.0)
    assert 2.0 < stopped.t < 3.0
    assert "integrator and its step are at fault" in stopped.trouble
    assert params.kp * params.step == pytest.approx(0.2)
    assert "Semi-implicit Euler or k_d from 0.32 to" in stopped.trouble
    assert sum(plant("ur5").energy(path[-1].q, path[-1].v)) > 10 + sum(
        plant("ur5").energy(path[0].q, path[0].v)
    )
    swinging = list(states(parameters(setting, integrator="semi-implicit-euler"), 10.0))
    assert not swinging[-1].trouble
    assert max(np.abs(error(s)).max() for s in swinging) < 0.2
    assert max(np.abs(error(s)).max() for s in swinging[-100:]) > 0.05
    damped = final_state(parameters(setting, kd=0.4), 20.0)
    assert np.abs(error(damped)).max() < 0.1
    assert ARTICLE.answer("Explicit Euler without damping") == "It swings ever wider."


@ARTICLE.verify("A slow controller chatters")
def test_a_slow_controller_chatters(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    path = list(states(params, 5.0))
    limit = plant("ur5").arm.torque_limit
    saturated = np.mean([np.abs(s.torque) >= limit for s in path[100:]], axis=0)
    assert saturated[5] > 0.9
    assert not saturated[:3].any()
    stopped = final_state(parameters(setting, torque_limits=False), 1.0)
    assert stopped.t < 0.1
    assert "The control period is at fault" in stopped.trouble
    calm = final_state(parameters(setting, kd=5.0), 20.0)
    assert np.abs(error(calm)).max() < 1e-5
    assert ARTICLE.answer("A slow controller chatters") == "The light wrist."


def test_every_experiment_is_verified_here() -> None:
    ARTICLE.check_all_are_verified(at_least=6)
