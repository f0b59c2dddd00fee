"""The lab integration: what its article claims, in numbers, and how its world moves."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
import pytest

from labs.algorithms.butcher_tableau import parse_tableau
from labs.algorithms.runge_kutta import TABLEAUS, order
from labs.appendix.integration.convergence import exact_solution
from labs.appendix.integration.params import (
    METHOD_NAMES,
    IntegrationParams,
)
from labs.errors import ParameterError
from labs.models.pendulums import pendulum
from labs.params import Value
from labs.plots import channel_names, field_names
from labs.scene import NullScene
from tests.labs.appendix.integration.runs import (
    EXPERIMENTS,
    LAB,
    ORDERS,
    angles,
    energies,
    of_method,
    simulated,
    solved,
    time_over_the_top,
)

# The experiments


@EXPERIMENTS.verify("Euler feeds the swing")
def test_euler_feeds_the_swing(setting: Mapping[str, Value]) -> None:
    world, states = simulated(20.0, setting)
    euler, semi = (energies(world, states, m) for m in ("euler", "semi"))
    assert euler[0] == pytest.approx(2.25, abs=0.005)
    upright = world.params.plant.energy(np.array([np.pi, 0.0]))
    assert upright == pytest.approx(9.81, abs=0.005)
    assert np.argmax(euler > upright) * LAB.period == pytest.approx(2.0, abs=0.05)
    assert 2.0 < time_over_the_top(states, "euler") < 3.0
    assert euler[-1] > 5.0 * upright
    assert np.all((semi > 2.0) & (semi < 2.6))
    assert EXPERIMENTS.answer("Euler feeds the swing") == "It swings ever wider."


@EXPERIMENTS.verify("Half the step")
def test_half_the_step(setting: Mapping[str, Value]) -> None:
    world = solved(setting)
    for name, p in ORDERS.items():
        assert of_method(world, "global_orders", name) == pytest.approx(p, abs=0.1), name
        assert of_method(world, "local_orders", name) == pytest.approx(p + 1, abs=0.1), name
    errors = dict(zip(METHOD_NAMES, world.state.global_errors, strict=True))
    assert errors["euler"][-2] / errors["euler"][-1] == pytest.approx(2.0, abs=0.1)
    assert errors["rk4"][-2] / errors["rk4"][-1] == pytest.approx(16.0, abs=0.5)
    own = parse_tableau(world.params.tableau)
    assert order(own) == order(TABLEAUS["rk3"]) == 3
    assert not np.array_equal(own.a, TABLEAUS["rk3"].a)
    factor = errors["rk4"][-2] / errors["rk4"][-1]
    assert factor == pytest.approx(EXPERIMENTS.answer("Half the step"), abs=0.5)


@EXPERIMENTS.verify("Four looks a step, and still cheaper")
def test_rk4_is_cheaper(setting: Mapping[str, Value]) -> None:
    state = solved(setting).state
    rk4, euler = METHOD_NAMES.index("rk4"), METHOD_NAMES.index("euler")
    assert state.costs[rk4, 1] == 80
    assert state.global_errors[rk4, 1] == pytest.approx(2e-5, rel=0.15)
    assert state.costs[euler, -1] == 320
    assert state.global_errors[euler, -1] == pytest.approx(0.03, rel=0.2)
    assert 320 * state.global_errors[euler, -1] / state.global_errors[rk4, 1] > 5e5
    assert EXPERIMENTS.answer("Four looks a step, and still cheaper") == "No, RK4 by far."


@EXPERIMENTS.verify("A wrong digit")
def test_a_wrong_digit(setting: Mapping[str, Value]) -> None:
    world = solved(setting)
    tableau = parse_tableau(world.params.tableau)
    np.testing.assert_array_equal(tableau.a, TABLEAUS["rk4"].a)
    assert tableau.b.sum() == pytest.approx(31 / 30)
    assert order(tableau) == 0
    assert of_method(world, "global_orders", "yours") == pytest.approx(0.0, abs=0.01)
    errors = world.state.global_errors[METHOD_NAMES.index("yours")]
    assert np.ptp(errors) < 0.01 * errors[0]
    assert LAB.measure(world.params, world.state)["own_order"] == 0.0
    assert EXPERIMENTS.answer("A wrong digit") == "To 0."


@EXPERIMENTS.verify("Order is no insurance")
def test_order_is_no_insurance(setting: Mapping[str, Value]) -> None:
    world, states = simulated(30.0, setting)
    semi = energies(world, states, "semi")
    assert semi.min() == pytest.approx(1.8, abs=0.05)
    assert semi.max() == pytest.approx(3.0, abs=0.05)
    assert time_over_the_top(states, "semi") == np.inf
    assert time_over_the_top(states, "midpoint") < 20.0
    assert time_over_the_top(states, "heun") < 20.0
    rk4 = energies(world, states, "rk4")
    assert 1.0 - rk4[-1] / rk4[0] == pytest.approx(0.07, abs=0.005)
    implicit = energies(world, states, "implicit")
    assert np.abs(implicit / implicit[0] - 1.0).max() < 0.01
    assert EXPERIMENTS.answer("Order is no insurance") == "Semi-implicit Euler."


@EXPERIMENTS.verify("Beyond the limit")
def test_beyond_the_limit(setting: Mapping[str, Value]) -> None:
    world, states = simulated(20.0, setting)
    assert LAB.measure(world.params, world.state)["reach"] == pytest.approx(2.17, abs=0.005)
    limits = dict(zip(METHOD_NAMES, solved(setting).state.limits, strict=True))
    assert limits["rk3"] == pytest.approx(0.319, abs=5e-4)
    assert limits["semi"] == pytest.approx(0.369, abs=5e-4)
    assert limits["rk4"] == pytest.approx(0.522, abs=5e-4)
    assert 5.0 < time_over_the_top(states, "rk3") < 7.0
    assert np.abs(angles(states[-300:], "rk4")).max() < 1e-3
    assert np.abs(angles(states[-1500:], "implicit")).max() == pytest.approx(0.1, abs=0.002)
    assert np.abs(angles(states[-300:], "semi")).max() > 0.2
    assert EXPERIMENTS.answer("Beyond the limit") == "RK4 alone."


@EXPERIMENTS.verify("Friction rescues Euler")
def test_friction_rescues_euler(setting: Mapping[str, Value]) -> None:
    world, states = simulated(20.0, setting)
    lam = world.params.plant.eigenvalues
    np.testing.assert_allclose(lam.real, -1.2, atol=0.005)
    np.testing.assert_allclose(np.abs(lam.imag), 5.29, atol=0.005)
    limit = -2 * lam[0].real / abs(lam[0]) ** 2
    assert limit == pytest.approx(0.082, abs=5e-4)
    assert solved(setting).state.limits[0] == pytest.approx(limit, rel=1e-4)
    assert np.abs(angles(states[-100:], "euler")).max() < 1e-3
    halved = {**setting, "friction": 0.2}
    assert solved(halved).state.limits[0] == pytest.approx(0.041, abs=5e-4)
    _, states = simulated(20.0, halved)
    assert np.abs(angles(states[-200:], "euler")).max() > 0.5
    assert EXPERIMENTS.answer("Friction rescues Euler") == "Yes."


@EXPERIMENTS.verify("Two stages, order four")
def test_two_stages_order_four(setting: Mapping[str, Value]) -> None:
    world, states = simulated(20.0, setting)
    gauss = energies(world, states, "implicit")
    assert np.abs(gauss / gauss[0] - 1).max() < 0.003
    assert world.state.newton_iterations == 3
    assert of_method(solved(setting), "global_orders", "implicit") == pytest.approx(4.0, abs=0.1)
    world, states = simulated(10.0, {**setting, "implicit": "implicit-midpoint"})
    midpoint = energies(world, states, "implicit")
    assert np.abs(midpoint / midpoint[0] - 1).max() == pytest.approx(0.02, abs=0.002)
    assert EXPERIMENTS.answer("Two stages, order four") == "Within 0.3 %."


@EXPERIMENTS.verify("Chaos beats every order")
def test_chaos_beats_every_order(setting: Mapping[str, Value]) -> None:
    def time_of_departure(h: float) -> float:
        _, states = simulated(5.2, {**setting, "h": h})
        i = METHOD_NAMES.index("rk4")
        off = [np.abs(s.x[i, :2] - s.reference[:2]).max() > 0.5 for s in states]
        return float(np.argmax(off)) * LAB.period

    assert setting["h"] == 0.01
    assert time_of_departure(0.01) == pytest.approx(3.7, abs=0.2)
    assert time_of_departure(0.005) - time_of_departure(0.01) == pytest.approx(1.0, abs=0.2)
    assert EXPERIMENTS.answer("Chaos beats every order") == "about 4 s"


def test_every_experiment_is_verified_here() -> None:
    EXPERIMENTS.check_all_are_verified()


# The world


@pytest.mark.parametrize("system", ["pendulum", "double-pendulum"])
def test_the_reference_is_the_motion(system: str) -> None:
    world, _ = simulated(3.0, {"system": system})
    wanted = exact_solution(world.params.plant.vector_field, world.params.x0(), 0.0, 3.0)
    np.testing.assert_allclose(world.state.reference, wanted, atol=1e-7)


def test_methods_take_whole_steps() -> None:
    world, states = simulated(0.5, {"h": 0.07})
    moves = [k for k in range(1, 51) if not np.array_equal(states[k].x, states[k - 1].x)]
    assert moves == [7, 14, 21, 28, 35, 42, 49]
    assert world.state.method_time == pytest.approx(0.49)
    wanted = pendulum(1).f(states[0].x[0], 0.0) * 0.07 + states[0].x[0]
    np.testing.assert_allclose(states[7].x[0], wanted, atol=1e-15)


def test_what_blows_up_stops_and_the_others_go_on() -> None:
    world, states = simulated(14.0, {"h": 0.4, "start": 0.1})
    lost = world.state.stopped
    assert lost[METHOD_NAMES.index("midpoint")]
    assert not lost[METHOD_NAMES.index("rk4")]
    assert LAB.measure(world.params, world.state)["going"] == 8 - lost.sum() < 8
    scene = NullScene()
    LAB.draw(scene, world.params, world.state)
    assert "lost midpoint" in scene.names
    i = METHOD_NAMES.index("midpoint")
    first = next(k for k, s in enumerate(states) if s.stopped[i])
    np.testing.assert_array_equal(states[first].x[i], states[-1].x[i])


def test_the_tip_is_where_pinocchio_has_it() -> None:
    world, states = simulated(1.0, {"system": "double-pendulum"})
    arm = pendulum(2).model
    data = arm.createData()
    pin.framesForwardKinematics(arm, data, states[-1].reference[:2])
    side = LAB.measure(world.params, world.state)["tip"]
    assert side == pytest.approx(data.oMf[arm.getFrameId("tip")].translation[1])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("0 |; 1 | 1/2; | 0 1", "row 2: c = 1 but"), ("1", "at least two rows")],
)
def test_a_wrong_tableau_is_refused_with_its_row(text: str, sentence: str) -> None:
    with pytest.raises(ParameterError) as refusal:
        IntegrationParams().change({"tableau": text})
    assert sentence in str(refusal.value)


def test_every_channel_shown_is_measured() -> None:
    world = solved({})
    channels = set(LAB.measure(world.params, world.state))
    fields = set(LAB.fields(world.params, world.state))
    for plot in LAB.plots:
        assert set(channel_names(plot)) <= channels
        assert set(field_names(plot)) <= fields
