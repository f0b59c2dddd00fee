"""The lab integration: what its article claims, in numbers, and what its plots show."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest

from labs.algorithms.runge_kutta import TABLEAUS, order, parse_tableau
from labs.appendix.integration.accuracy import (
    LONGEST_STEP,
    STEP_COUNTS,
    STEP_SIZES,
    one_step_method,
)
from labs.appendix.integration.convergence import exact_solution
from labs.appendix.integration.lab import Integration, IntegrationState
from labs.appendix.integration.params import (
    IMPLICIT_METHODS,
    METHOD_NAMES,
    IntegrationParams,
)
from labs.engine.catalog import find
from labs.engine.run import World
from labs.errors import ParameterError
from labs.lab import Inputs
from labs.models.pendulums import pendulum
from labs.params import Value
from labs.plots import measured, pictured
from labs.scene import NullScene
from tests.labs.experiments import Experiments

LAB = Integration()
EXPERIMENTS = Experiments("labs.appendix", "integration")
ORDERS = {
    "euler": 1,
    "semi": 1,
    "midpoint": 2,
    "heun": 2,
    "rk3": 3,
    "rk4": 4,
    "implicit": 2,
    "yours": 3,
}
UPRIGHT = np.pi


@dataclass
class Run:
    """What one world came to."""

    params: IntegrationParams
    state: IntegrationState


def moved(seconds: float, setting: Mapping[str, Value]) -> tuple[Run, list[IntegrationState]]:
    """A run, and its states from t = 0 on."""
    params = IntegrationParams().change(setting)
    states = [LAB.init(params, np.random.default_rng(0))]
    for _ in range(round(seconds / LAB.period)):
        states.append(LAB.step(params, Inputs(), states[-1]))
    return Run(params, states[-1]), states


def solved(setting: Mapping[str, Value]) -> Run:
    """A run at t = 0 whose study of errors is done."""
    params = IntegrationParams().change(setting)
    state = LAB.init(params, np.random.default_rng(0))
    for snapshot in LAB.solve(params, state):
        state = LAB.accept(params, state, snapshot)
    return Run(params, state)


def energies(world: Run, states: list[IntegrationState], method: str) -> np.ndarray:
    plant = world.params.plant
    return np.array([plant.energy(s.x[METHOD_NAMES.index(method)]) for s in states])


def angles(states: list[IntegrationState], method: str) -> np.ndarray:
    """Of the first rod [rad]."""
    return np.array([s.x[METHOD_NAMES.index(method), 0] for s in states])


def time_over_the_top(states: list[IntegrationState], method: str) -> float:
    """When it first passes the top [s]; infinite if it never does."""
    passed = np.abs(angles(states, method)) > UPRIGHT
    return float(np.argmax(passed)) * LAB.period if passed.any() else np.inf


def of_method(world: Run, field: str, method: str) -> float:
    """A field's number for a method."""
    return float(LAB.fields(world.params, world.state)[field][METHOD_NAMES.index(method)])


# The experiments


@EXPERIMENTS.verify("Euler feeds the swing")
def test_euler_feeds_the_swing(setting: Mapping[str, Value]) -> None:
    world, states = moved(20.0, setting)
    euler, semi = (energies(world, states, m) for m in ("euler", "semi"))
    assert euler[0] == pytest.approx(2.25, abs=0.005)
    upright = world.params.plant.energy(np.array([np.pi, 0.0]))
    assert upright == pytest.approx(9.81, abs=0.005)
    assert np.argmax(euler > upright) * LAB.period == pytest.approx(2.0, abs=0.05)
    assert 2.0 < time_over_the_top(states, "euler") < 3.0
    assert euler[-1] > 5.0 * upright
    assert np.all((semi > 2.0) & (semi < 2.6))


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


@EXPERIMENTS.verify("Four looks a step, and still cheaper")
def test_rk4_is_cheaper(setting: Mapping[str, Value]) -> None:
    state = solved(setting).state
    rk4, euler = METHOD_NAMES.index("rk4"), METHOD_NAMES.index("euler")
    assert state.costs[rk4, 1] == 80
    assert state.global_errors[rk4, 1] == pytest.approx(2e-5, rel=0.15)
    assert state.costs[euler, -1] == 320
    assert state.global_errors[euler, -1] == pytest.approx(0.03, rel=0.2)
    assert 320 * state.global_errors[euler, -1] / state.global_errors[rk4, 1] > 5e5


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


@EXPERIMENTS.verify("Order is no insurance")
def test_order_is_no_insurance(setting: Mapping[str, Value]) -> None:
    world, states = moved(30.0, setting)
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


@EXPERIMENTS.verify("Beyond the limit")
def test_beyond_the_limit(setting: Mapping[str, Value]) -> None:
    world, states = moved(20.0, setting)
    assert LAB.measure(world.params, world.state)["reach"] == pytest.approx(2.17, abs=0.005)
    limits = dict(zip(METHOD_NAMES, solved(setting).state.limits, strict=True))
    assert limits["rk3"] == pytest.approx(0.319, abs=5e-4)
    assert limits["semi"] == pytest.approx(0.369, abs=5e-4)
    assert limits["rk4"] == pytest.approx(0.522, abs=5e-4)
    assert 5.0 < time_over_the_top(states, "rk3") < 7.0
    assert np.abs(angles(states[-300:], "rk4")).max() < 1e-3
    assert np.abs(angles(states[-1500:], "implicit")).max() == pytest.approx(0.1, abs=0.002)
    assert np.abs(angles(states[-300:], "semi")).max() > 0.2


@EXPERIMENTS.verify("Friction rescues Euler")
def test_friction_rescues_euler(setting: Mapping[str, Value]) -> None:
    world, states = moved(20.0, setting)
    lam = world.params.plant.eigenvalues
    np.testing.assert_allclose(lam.real, -1.2, atol=0.005)
    np.testing.assert_allclose(np.abs(lam.imag), 5.29, atol=0.005)
    limit = -2 * lam[0].real / abs(lam[0]) ** 2
    assert limit == pytest.approx(0.082, abs=5e-4)
    assert solved(setting).state.limits[0] == pytest.approx(limit, rel=1e-4)
    assert np.abs(angles(states[-100:], "euler")).max() < 1e-3
    halved = {**setting, "friction": 0.2}
    assert solved(halved).state.limits[0] == pytest.approx(0.041, abs=5e-4)
    _, states = moved(20.0, halved)
    assert np.abs(angles(states[-200:], "euler")).max() > 0.5


@EXPERIMENTS.verify("Two stages, order four")
def test_two_stages_order_four(setting: Mapping[str, Value]) -> None:
    world, states = moved(20.0, setting)
    gauss = energies(world, states, "implicit")
    assert np.abs(gauss / gauss[0] - 1).max() < 0.003
    assert world.state.newton_iterations == 3
    assert of_method(solved(setting), "global_orders", "implicit") == pytest.approx(4.0, abs=0.1)
    world, states = moved(10.0, {**setting, "implicit": "implicit-midpoint"})
    midpoint = energies(world, states, "implicit")
    assert np.abs(midpoint / midpoint[0] - 1).max() == pytest.approx(0.02, abs=0.002)


@EXPERIMENTS.verify("Chaos beats every order")
def test_chaos_beats_every_order(setting: Mapping[str, Value]) -> None:
    def time_of_departure(h: float) -> float:
        _, states = moved(5.2, {**setting, "h": h})
        i = METHOD_NAMES.index("rk4")
        off = [np.abs(s.x[i, :2] - s.reference[:2]).max() > 0.5 for s in states]
        return float(np.argmax(off)) * LAB.period

    assert setting["h"] == 0.01
    assert time_of_departure(0.01) == pytest.approx(3.7, abs=0.2)
    assert time_of_departure(0.005) - time_of_departure(0.01) == pytest.approx(1.0, abs=0.2)


def test_every_experiment_is_verified_here() -> None:
    EXPERIMENTS.check_all_are_verified()


# The study


@pytest.mark.parametrize("system", ["pendulum", "double-pendulum"])
@pytest.mark.parametrize("implicit", IMPLICIT_METHODS)
def test_all_orders_show(system: str, implicit: str) -> None:
    world = solved({"system": system, "implicit": implicit, "start": 0.5})
    orders = ORDERS | {"implicit": order(TABLEAUS[implicit])}
    for name, p in orders.items():
        assert of_method(world, "global_orders", name) == pytest.approx(p, abs=0.1), name


CASH_KARP = (
    "0 | ; 1/5 | 1/5; 3/10 | 3/40 9/40; 3/5 | 3/10 -9/10 6/5; 1 | -11/54 5/2 -70/27 35/27;"
    "7/8 | 1631/55296 175/512 575/13824 44275/110592 253/4096;"
    "| 37/378 0 250/621 125/594 0 512/1771"
)


def growth_of_a_step(method: str, rods: int, friction: float, h: float) -> float:
    """The spectral radius of the derivative of the method's own step at rest, by differences."""
    advance, small = one_step_method(method, rods, friction), 1e-4
    columns = [
        (advance(small * unit, 0.0, h).x - advance(-small * unit, 0.0, h).x) / (2 * small)
        for unit in np.eye(2 * rods)
    ]
    return float(np.abs(np.linalg.eigvals(np.array(columns))).max())


@pytest.mark.parametrize("friction", [0.0, 0.5, 5.0])
@pytest.mark.parametrize("system", ["pendulum", "double-pendulum"])
def test_the_limits_are_where_the_steps_begin_to_grow(system: str, friction: float) -> None:
    world = solved({"system": system, "friction": friction, "tableau": CASH_KARP})
    rods = world.params.rods
    texts = {"yours": CASH_KARP, "implicit": "implicit-midpoint"}
    for name, limit in zip(METHOD_NAMES, world.state.limits, strict=True):
        method = texts.get(name, name)
        if limit == LONGEST_STEP:
            assert growth_of_a_step(method, rods, friction, 1.99) <= 1.0 + 1e-6, name
        elif limit > 0.0:
            assert growth_of_a_step(method, rods, friction, 0.99 * limit) <= 1.0 + 1e-6, name
            assert growth_of_a_step(method, rods, friction, 1.01 * limit) > 1.0 + 1e-6, name
        else:
            assert friction == 0.0
            assert growth_of_a_step(method, rods, friction, 0.05) > 1.0 + 1e-8, name


def test_no_step_of_cash_karp_is_short_enough_without_friction() -> None:
    limits = dict(zip(METHOD_NAMES, solved({"tableau": CASH_KARP}).state.limits, strict=True))
    assert [name for name, limit in limits.items() if limit == 0.0] == [
        "euler",
        "midpoint",
        "heun",
        "yours",
    ]


def test_the_limit_of_semi_implicit_euler() -> None:
    """h^2 k + 2 h d = 4 for q'' = -k q - d q'."""
    for friction in (0.0, 0.5):
        world = solved({"friction": friction})
        k, d = -world.params.plant.jacobian(np.zeros(2), 0.0)[1]
        assert world.state.limits[1] == pytest.approx((np.sqrt(d**2 + 4 * k) - d) / k, rel=1e-4)


def test_growth_crosses_one_at_the_limit() -> None:
    world = solved({"friction": 0.5})
    fields = LAB.fields(world.params, world.state)
    limits = dict(zip(METHOD_NAMES, fields["limits"], strict=True))
    for i, (name, limit) in enumerate(limits.items()):
        if np.isfinite(limit):
            growth = np.interp(limit, fields["growth_steps"], fields["growth"][:, i])
            assert growth == pytest.approx(1.0, abs=0.01), name
            assert fields["limit_steps"][0, i] == limit
        else:
            assert fields["limit_steps"][0, i] == 0.0
    assert np.isnan(limits["implicit"])


def test_local_errors_are_those_of_one_step() -> None:
    world = solved({})
    plant = world.params.plant
    middle = exact_solution(plant.vector_field, world.params.x0(), 0.0, 0.2)
    for h, error in zip(STEP_SIZES, world.state.local_errors[0], strict=True):
        wanted = (
            middle + h * plant.f(middle, 0.0) - exact_solution(plant.vector_field, middle, 0.0, h)
        )
        assert error == pytest.approx(np.linalg.norm(wanted), rel=1e-6)
    np.testing.assert_array_equal(world.state.costs[0], STEP_COUNTS)


def test_the_study_starts_again_when_the_tableau_changes() -> None:
    world = World(find("integration"))
    while world.solving:
        world.iterate()
    before = world.state.global_errors.copy()
    world.change({"tableau": "0 | ; | 1"})
    assert world.solving
    while world.solving:
        world.iterate()
    np.testing.assert_array_equal(world.state.global_errors[7], before[0])
    np.testing.assert_array_equal(world.state.global_errors[:7], before[:7])


# The world


@pytest.mark.parametrize("system", ["pendulum", "double-pendulum"])
def test_the_reference_is_the_motion(system: str) -> None:
    world, _ = moved(3.0, {"system": system})
    wanted = exact_solution(world.params.plant.vector_field, world.params.x0(), 0.0, 3.0)
    np.testing.assert_allclose(world.state.reference, wanted, atol=1e-7)


def test_methods_take_whole_steps() -> None:
    world, states = moved(0.5, {"h": 0.07})
    moves = [k for k in range(1, 51) if not np.array_equal(states[k].x, states[k - 1].x)]
    assert moves == [7, 14, 21, 28, 35, 42, 49]
    assert world.state.method_time == pytest.approx(0.49)
    wanted = pendulum(1).f(states[0].x[0], 0.0) * 0.07 + states[0].x[0]
    np.testing.assert_allclose(states[7].x[0], wanted, atol=1e-15)


def test_what_blows_up_stops_and_the_others_go_on() -> None:
    world, states = moved(14.0, {"h": 0.4, "start": 0.1})
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
    world, states = moved(1.0, {"system": "double-pendulum"})
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
        assert set(measured(plot)) <= channels
        assert set(pictured(plot)) <= fields
