"""The lab dynamics: what its article claims, in numbers, and what its world must obey."""

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labs.lab import Inputs
from labs.models.plant import plant
from labs.params import Value
from labs.reactive_control.dynamics.equation import plant_under_gravity
from labs.reactive_control.dynamics.lab import SPEED_LIMIT, ArmDynamics, DynamicsState
from labs.reactive_control.dynamics.params import DynamicsParams
from labs.scene import NullScene
from labs.tasks.arm.postures import POSED_ARMS
from tests.labs.experiments import ArticleExperiments
from tests.labs.recording import record

LAB = ArmDynamics()
ARTICLE = ArticleExperiments("labs.reactive_control", "dynamics")
FALL: Mapping[str, Value] = {
    "robot": "double-pendulum",
    "drive": "none",
    "posture": "outstretched",
}


def make_params(setting: Mapping[str, Value], **changes: Value) -> DynamicsParams:
    return DynamicsParams().change({**setting, **changes})


def states(params: DynamicsParams, seconds: float) -> Iterator[DynamicsState]:
    """The states from t = 0 on, until trouble."""
    state = LAB.init(params, np.random.default_rng(0))
    yield state
    for _ in range(round(seconds / LAB.period)):
        state = LAB.step(params, Inputs(), state)
        yield state
        if state.trouble:
            return


def last(params: DynamicsParams, seconds: float) -> DynamicsState:
    *_, state = states(params, seconds)
    return state


def rows(params: DynamicsParams, seconds: float) -> dict[str, np.ndarray]:
    """Every measured channel over time."""
    return record(LAB, params, states(params, seconds))


def at_start(setting: Mapping[str, Value], **changes: Value) -> dict[str, np.ndarray]:
    """All that is measured and pictured at t = 0."""
    params = make_params(setting, **changes)
    state = LAB.init(params, np.random.default_rng(0))
    found: dict[str, Any] = {**LAB.measure(params, state), **LAB.fields(params, state)}
    return found


# The experiments


@ARTICLE.verify("There and back")
def test_there_and_back(setting: Mapping[str, Value]) -> None:
    params = make_params(setting)
    run = rows(params, 4.0)
    assert 0.0 < run["there_and_back"].max() < 5e-14
    for k in (0, 57, 123):
        asked = params.accelerations(6, k * LAB.period)
        np.testing.assert_allclose(run["acceleration"][k], asked, atol=1e-12)
    assert np.abs(run["gravity"][:, 1]).min() > np.abs(run["inertia"][:, 1]).max()
    np.testing.assert_allclose(run["gravity"][:, 0], 0.0, atol=1e-9)
    assert ARTICLE.answer("There and back") == "About $10^{-14}$ away."


@ARTICLE.verify("Push the elbow, move the shoulder")
def test_pushing_the_elbow_moves_the_shoulder(setting: Mapping[str, Value]) -> None:
    row = at_start(setting)
    assert row["acceleration"] == pytest.approx([-5.4, 18.1], abs=0.05)
    np.testing.assert_allclose(row["acceleration"], np.linalg.inv(row["mass"])[:, 1], rtol=1e-9)
    assert abs(row["mass"][0, 1]) > 0.1
    straight = at_start(setting, q1=-0.9, q2=-0.6)
    assert straight["acceleration"][0] == pytest.approx(-8.5, abs=0.05)
    assert ARTICLE.answer("Push the elbow, move the shoulder") == "It swings the other way."


@ARTICLE.verify("The longer, the heavier")
def test_the_longer_the_heavier(setting: Mapping[str, Value]) -> None:
    long, bent = at_start(setting), at_start(setting, posture="home")
    assert bent["mass"][0, 0] == pytest.approx(1.40, abs=0.005)
    assert long["mass"][0, 0] == pytest.approx(4.43, abs=0.005)
    for row in (long, bent):
        assert row["mass"][5, 5] == pytest.approx(0.078, abs=5e-4)
    assert at_start(setting, payload=5.0)["mass"][0, 0] == pytest.approx(8.77, abs=0.005)
    assert long["first_inertia"] == long["mass"][0, 0]


@ARTICLE.verify("A force does not say where to")
def test_a_force_does_not_say_where_to(setting: Mapping[str, Value]) -> None:
    def sets_out(**changes: Value) -> tuple[np.ndarray, float]:
        params = make_params(setting, **changes)
        row = at_start(setting, **changes)
        a = plant("ur5").tip_jacobian(params.start) @ row["acceleration"]
        f = params.force
        return a, float(np.degrees(np.arccos(a @ f / np.linalg.norm(a) / np.linalg.norm(f))))

    along_x, off = sets_out()
    assert off == pytest.approx(14, abs=0.5)
    along_y, less = sets_out(fx=0.0, fy=15.0)
    assert less == pytest.approx(4, abs=0.5)
    assert np.linalg.norm(along_y) > 2 * np.linalg.norm(along_x)
    assert at_start(setting)["apart"] == pytest.approx(off, rel=1e-12)
    held = rows(make_params(setting), ARTICLE.blocks["A force does not say where to"]["hold"])
    assert held["apart"][-1] == pytest.approx(14, abs=0.5), "what is read there"


@ARTICLE.verify("No torque, no gravity, no rest")
def test_no_torque_no_gravity_no_rest(setting: Mapping[str, Value]) -> None:
    run = rows(make_params(setting), 3.0)
    assert not run["torque"].any()
    assert not run["gravity"].any()
    assert run["v"][100].min() == pytest.approx(-1.1, abs=0.05)
    assert run["v"][100].max() == pytest.approx(2.1, abs=0.05)
    np.testing.assert_allclose(run["inertia"], -run["coriolis"], atol=1e-12)
    assert np.abs(run["coriolis"]).max() > 0.1
    assert run["kinetic"][0] == pytest.approx(3.937, abs=5e-4)
    np.testing.assert_allclose(run["kinetic"], run["kinetic"][0], rtol=1e-10)
    assert ARTICLE.answer("No torque, no gravity, no rest") == "They change, and the energy stays."


@ARTICLE.verify("A free fall keeps its energy")
def test_a_free_fall_keeps_its_energy(setting: Mapping[str, Value]) -> None:
    assert {k: setting[k] for k in FALL} == FALL
    params = make_params(setting)
    assert (params.integrator, params.step) == ("rk4", 0.001)
    run = rows(params, 5.0)
    np.testing.assert_allclose(run["total"], 51.01, atol=0.005)
    assert np.ptp(run["total"]) < 1e-6
    assert np.abs(run["drift"]).max() < 1e-6
    assert 19.0 < run["kinetic"].max() < 20.0
    assert ARTICLE.answer("A free fall keeps its energy") == "It is a flat line."


@ARTICLE.verify("A careless integrator makes energy")
def test_a_careless_integrator_makes_energy(setting: Mapping[str, Value]) -> None:
    gained = last(make_params(setting), 5.0).energy_drift
    set_free = rows(make_params(FALL), 5.0)["kinetic"].max()
    assert 9.0 < gained < 0.5 * set_free
    half = last(make_params(setting, step=0.002), 5.0).energy_drift
    assert half / gained == pytest.approx(2 / 5, abs=0.05)
    assert last(make_params(setting, integrator="midpoint"), 5.0).energy_drift == pytest.approx(
        0.01, abs=2e-3
    )
    runge = last(make_params(setting, integrator="rk4"), 5.0).energy_drift
    assert abs(runge) == pytest.approx(0.00006, abs=1e-5)


def test_every_experiment_is_verified_here() -> None:
    ARTICLE.check_all_are_verified()


# The world's laws


@pytest.mark.parametrize("robot", POSED_ARMS)
@pytest.mark.parametrize("drive", ["balanced", "inverse", "none"])
def test_the_equation_holds_at_every_instant(robot: str, drive: str) -> None:
    params = make_params(
        {"robot": robot, "drive": drive, "payload": 2.0, "damping": 0.5, "speed": 0.4},
        **{"fx": 8.0, "fy": -5.0, "fz": 11.0, "tau1": 3.0, "tau2": -2.0},
    )
    run = rows(params, 0.5)
    assert run["residual"].max() < 1e-10
    assert run["there_and_back"].max() < 1e-10
    assert run["back_and_there"].max() < 1e-10
    assert run["least_inertia"].min() > 0.0


@pytest.mark.parametrize("robot", POSED_ARMS)
@pytest.mark.parametrize("drive", ["balanced", "inverse", "none"])
def test_energy_changes_by_the_power_put_in(robot: str, drive: str) -> None:
    """dE/dt = tau . q' + w . v, by differences of order 4. (The torque is held for half a
    millisecond, which is what the tolerance is for.)"""
    params = make_params(
        {"robot": robot, "drive": drive, "payload": 1.0, "damping": 0.3, "speed": 0.5},
        **{"fy": 6.0, "fz": -4.0, "tau1": 1.0, "step": 0.0005},
    )
    run = rows(params, 0.6)
    total, power = run["total"], run["power"][2:-2]
    rate = (8 * (total[3:-1] - total[1:-3]) - (total[4:] - total[:-4])) / (12 * LAB.period)
    assert np.abs(power).max() > 0.5
    np.testing.assert_allclose(rate, power, atol=2e-3 * np.abs(power).max())
    assert np.abs(run["drift"]).max() < 1e-7


def test_the_balance_of_energy_survives_what_changes_on_the_way() -> None:
    """Gravity off, a payload on, in mid-flight: neither is an error of the integrator."""
    params = make_params(FALL)
    state = last(params, 0.5)
    for change in ({"gravity": False}, {"payload": 3.0}, {"gravity": True}, {"fz": 20.0}):
        params = params.change(change)
        for _ in range(30):
            state = LAB.step(params, Inputs(), state)
    assert abs(state.energy_drift) < 1e-6


@pytest.mark.parametrize(
    ("integrator", "order"),
    [("explicit-euler", 1), ("semi-implicit-euler", 1), ("midpoint", 2), ("rk4", 4)],
)
def test_energy_drifts_with_the_order_of_the_method(integrator: str, order: int) -> None:
    fine, coarse = (
        last(make_params(FALL, integrator=integrator, step=h, q2=0.5, speed=1.0), 0.4).energy_drift
        for h in (0.001, 0.002)
    )
    assert abs(fine) > 1e-10
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.05)


@pytest.mark.parametrize("robot", POSED_ARMS)
def test_it_falls_as_scipy_says(robot: str) -> None:
    """The same equation, solved from its matrices by an adaptive method of order 8."""
    params = make_params({"robot": robot, "drive": "none", "payload": 1.0, "fy": 5.0, "tau1": 2.0})
    world = plant_under_gravity(robot, 1.0, True)
    n = world.model.nv
    tau = params.torques(n)

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        state = DynamicsState(q=x[:n], v=x[n:], trail=np.zeros((2, 3)))
        fields = LAB.fields(params, state)
        external = world.tip_jacobian(x[:n]).T @ params.force
        a = np.linalg.solve(fields["mass"], tau + external - fields["bias"][:, 2])
        return np.concatenate([x[n:], a])

    begin = np.concatenate([params.start, np.zeros(n)])
    exact = solve_ivp(rate, (0.0, 0.5), begin, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    found = last(params, 0.5)
    np.testing.assert_allclose(np.concatenate([found.q, found.v]), exact, atol=1e-7)


def test_balanced_it_stays() -> None:
    for robot in POSED_ARMS:
        params = make_params({"robot": robot, "drive": "balanced", "payload": 3.0})
        state = last(params, 1.0)
        np.testing.assert_allclose(state.q, params.start, atol=1e-12)


@pytest.mark.parametrize("robot", POSED_ARMS)
def test_inverse_dynamics_moves_it_as_asked(robot: str) -> None:
    """q = q(0) + a (T / 2 pi)^2 (1 - cos(2 pi t / T)), against an external force too, as the
    time the torque is held goes to zero: half of it, half the error."""

    def errors(step: float) -> np.ndarray:
        params = make_params({"robot": robot, "fy": 10.0, "payload": 1.0, "step": step})
        n = plant(robot).model.nv
        w = 2 * np.pi / params.swing
        moved = params.accelerations(n, 0.0) / w**2 * (1 - np.cos(w))
        off: np.ndarray = last(params, 1.0).q - params.start - moved
        return off

    coarse, fine = errors(0.001), errors(0.0005)
    assert np.abs(fine).max() < 3e-3
    np.testing.assert_allclose(coarse, 2 * fine, atol=5e-5)


def test_without_gravity_there_is_none_in_any_term() -> None:
    row = at_start({"gravity": False, "drive": "balanced", "speed": 1.0})
    assert not row["gravity"].any()
    assert not row["torque"].any()
    assert row["potential"] == 0.0
    with_gravity = at_start({"drive": "balanced", "speed": 1.0})
    np.testing.assert_array_equal(row["mass"], with_gravity["mass"])
    assert plant("ur5").model.gravity.linear[2] == pytest.approx(-9.81)


def test_the_torque_asked_for_holds_against_the_force() -> None:
    row = at_start({"fx": 12.0, "fz": -20.0})
    np.testing.assert_allclose(row["asked_torque"], row["torque"], atol=1e-12)
    np.testing.assert_array_equal(row["bias"][:, 2], row["bias"][:, 0] + row["bias"][:, 1])


@pytest.mark.parametrize("robot", POSED_ARMS)
def test_damping_takes_the_kinetic_energy(robot: str) -> None:
    """Balanced against gravity, d/dt of (q' M q' / 2) = -b |q'|^2."""
    run = rows(
        make_params(
            {"robot": robot, "drive": "balanced", "damping": 1.0, "speed": 1.0, "step": 0.0005}
        ),
        1.0,
    )
    lost = run["kinetic"][0] - run["kinetic"]
    rate = (run["v"] ** 2).sum(axis=1)
    spent = np.concatenate([[0.0], np.cumsum(0.5 * LAB.period * (rate[1:] + rate[:-1]))])
    assert (np.diff(run["kinetic"]) < 0.0).all()
    np.testing.assert_allclose(lost, spent, atol=5e-3 * run["kinetic"][0])


def test_it_stops_before_numbers_mean_nothing() -> None:
    params = make_params({"robot": "double-pendulum", "drive": "balanced", "tau2": 30.0})
    *_, sane, stopped = states(params, 20.0)
    assert "t = " in stopped.trouble
    assert np.linalg.norm(stopped.v) <= SPEED_LIMIT
    np.testing.assert_array_equal(sane.q, stopped.q)
    assert LAB.step(params, Inputs(), stopped) is stopped


def test_a_state_can_be_kept_and_rewound() -> None:
    params = make_params({})
    kept = last(params, 0.3)
    copied = copy.deepcopy(kept)
    after = LAB.step(params, Inputs(), kept)
    LAB.measure(params, kept)
    LAB.fields(params, after)
    for name, value in vars(copied).items():
        np.testing.assert_array_equal(vars(kept)[name], value)
        if isinstance(value, np.ndarray):
            assert not np.shares_memory(vars(kept)[name], vars(after)[name])
    np.testing.assert_array_equal(LAB.step(params, Inputs(), copied).q, after.q)


def test_the_trail_is_where_the_end_effector_was() -> None:
    params = make_params({})
    path = list(states(params, 0.4))
    where = np.array([plant("ur5").tip(s.q) for s in path])
    np.testing.assert_allclose(path[-1].trail[-21:], where[::2], atol=1e-12)
    scene = NullScene()
    LAB.draw(scene, params, path[-1])
    assert {"camera", "robot", "trail", "torque 2"} <= set(scene.names)
