"""The lab joint-control: what its article claims, in numbers, and what its world must obey."""

import copy
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import expm

from labs.algorithms.divergence import remedies
from labs.algorithms.integrators import INTEGRATORS
from labs.lab import Inputs
from labs.models.plant import plant
from labs.params import Choice, Knob, Toggle, Value
from labs.plots import measured, pictured
from labs.reactive_control.joint_control.lab import (
    CONTROLLERS,
    MENU,
    PUSH_STEPS,
    REFERENCES,
    ROBOTS,
    SPRING,
    STRONGEST_PULL,
    VELOCITY_NOISE,
    JointControl,
    JointParams,
    JointState,
    along_the_reference,
)
from labs.reactive_control.joint_control.sampled_stability import Robot
from labs.scene import NullScene

LAB = JointControl()
ARTICLE = files("labs.reactive_control").joinpath("joint_control.md").read_text(encoding="utf-8")
EXPERIMENTS: Mapping[str, Mapping[str, Value]] = {
    block["title"]: block["set"]
    for block in map(tomllib.loads, re.findall(r"```experiment\n(.*?)```", ARTICLE, re.DOTALL))
}
VERIFIED: set[str] = set()
PUSHED = Inputs(actions=("push",))


def experiment(title: str) -> pytest.MarkDecorator:
    """Marks the test that verifies this experiment and gives it the experiment's settings."""
    VERIFIED.add(title)
    return pytest.mark.parametrize("setting", [EXPERIMENTS[title]], ids=[title])


def with_(setting: Mapping[str, Value], **changes: Value) -> JointParams:
    return JointParams().change({**setting, **changes})


def states(
    params: JointParams, seconds: float, inputs: Mapping[int, Inputs] | None = None, seed: int = 0
) -> Iterator[JointState]:
    """The states from t = 0 on, until trouble."""
    state = LAB.init(params, np.random.default_rng(seed))
    yield state
    for k in range(round(seconds / LAB.period)):
        state = LAB.step(params, (inputs or {}).get(k, Inputs()), state)
        yield state
        if state.trouble:
            return


def last(
    params: JointParams, seconds: float, inputs: Mapping[int, Inputs] | None = None
) -> JointState:
    *_, state = states(params, seconds, inputs)
    return state


def error(state: JointState) -> np.ndarray:
    e: np.ndarray = state.q_ref - state.q
    return e


def gravity(params: JointParams, q: np.ndarray) -> np.ndarray:
    """g(q) of the controller's model."""
    known = plant(params.robot)
    torque: np.ndarray = pin.computeGeneralizedGravity(known.model, known.data, q).copy()
    return torque


# The experiments


@experiment("Open loop drifts")
def test_open_loop_drifts(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    path = list(states(params, 2.0))
    world = plant("ur5")
    a, _ = Robot.near(world.model, world.data, path[0].q_ref, 0.0).dynamics()
    assert np.linalg.eigvals(a).real.max() == pytest.approx(4.46, abs=0.005)
    for k in (10, 20):
        start = np.concatenate([error(path[0]), np.zeros(6)])
        predicted = (expm(0.01 * k * a) @ start)[:6]
        np.testing.assert_allclose(error(path[k]), predicted, atol=0.0015)
    assert np.abs(error(path[-1])).max() > 1.0
    exact = last(with_(setting, initial_error=0.0), 1.0)
    assert np.abs(error(exact)).max() < 1e-9


@experiment("PD alone sags")
def test_pd_sags_by_what_gravity_asks(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    rest = last(params, 10.0)
    weight = gravity(params, rest.q)
    np.testing.assert_allclose(params.kp * error(rest), weight, rtol=1e-3, atol=1e-3)
    assert error(rest)[1:3] == pytest.approx([-0.158, -0.049], abs=6e-4)
    assert gravity(params, rest.q_ref)[1] == pytest.approx(-28, abs=0.5)
    assert weight[1] == pytest.approx(-31.7, abs=0.05)
    stiffer = error(last(with_(setting, kp=400.0), 10.0))
    assert stiffer[1] == pytest.approx(error(rest)[1] / 2, rel=0.1)


@experiment("The integral removes the sag")
def test_the_integral_removes_the_sag(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    rest = last(params, 20.0)
    assert np.abs(error(rest)).max() < 1e-6
    np.testing.assert_allclose(rest.torque, gravity(params, rest.q_ref), atol=1e-4)
    np.testing.assert_allclose(params.ki * rest.integral, rest.torque, atol=1e-3)


@experiment("Too much integral oscillates")
def test_too_much_integral_oscillates(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
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
    assert np.abs(error(last(with_(setting, kd=60.0), 20.0))).max() < 1e-6


@experiment("Gravity compensation needs no integral")
def test_gravity_compensation_needs_no_integral(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    rest = last(params, 5.0)
    assert np.abs(error(rest)).max() < 1e-6
    np.testing.assert_allclose(rest.torque, gravity(params, rest.q_ref), atol=1e-4)
    assert not rest.integral.any()
    settled = LAB.measure(params, rest)["settling_time"]
    assert isinstance(settled, float)
    assert 0.3 < settled < 1.0


@experiment("An unknown payload brings the sag back")
def test_an_unknown_payload_brings_the_sag_back(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    rest = last(params, 10.0)
    missing = plant("ur5").tip_jacobian(rest.q).T @ np.array([0.0, 0.0, 5.0 * 9.81])
    np.testing.assert_allclose(params.kp * error(rest), missing, rtol=1e-3, atol=1e-3)
    assert error(rest)[1] == pytest.approx(-0.105, abs=5e-4)


@experiment("Floating")
def test_a_floating_arm_stays_where_it_stops(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    still = last(params, 2.0)
    assert np.abs(still.v).max() < 1e-9
    path = list(states(params, 20.0, {100: PUSHED}))
    assert np.abs(error(path[-1])).max() > 0.3
    assert np.abs(path[-1].v).max() < 1e-3
    np.testing.assert_allclose(path[-1].q, path[-200].q, atol=2e-3)
    held = last(with_(setting, kp=200.0), 20.0, {100: PUSHED})
    assert np.abs(error(held)).max() < 1e-3


@experiment("Computed torque makes joints alike")
def test_computed_torque_makes_every_joint_alike(setting: Mapping[str, Value]) -> None:
    for k, state in enumerate(states(with_(setting), 1.5)):
        t = k * LAB.period
        expected = -0.3 * (1 + 10 * t) * np.exp(-10 * t)
        np.testing.assert_allclose(error(state), expected, atol=2e-3)
        assert np.ptp(error(state)) < 1e-5
    loaded = [np.ptp(error(s)) for s in states(with_(setting, payload=5.0), 1.5)]
    assert max(loaded) > 0.02


@experiment("Explicit Euler without damping")
def test_explicit_euler_without_damping_gains_energy(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    *path, stopped = states(params, 10.0)
    assert 2.0 < stopped.t < 3.0
    assert "integrator and its step are at fault" in stopped.trouble
    assert params.kp * params.step == pytest.approx(0.2)
    assert "Semi-implicit Euler or k_d from 0.32 to" in stopped.trouble
    assert sum(plant("ur5").energy(path[-1].q, path[-1].v)) > 10 + sum(
        plant("ur5").energy(path[0].q, path[0].v)
    )
    swinging = list(states(with_(setting, integrator="semi-implicit-euler"), 10.0))
    assert not swinging[-1].trouble
    assert max(np.abs(error(s)).max() for s in swinging) < 0.2
    assert max(np.abs(error(s)).max() for s in swinging[-100:]) > 0.05
    damped = last(with_(setting, kd=0.4), 20.0)
    assert np.abs(error(damped)).max() < 0.1


@experiment("A slow controller chatters")
def test_a_slow_controller_chatters(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    path = list(states(params, 5.0))
    limit = plant("ur5").arm.torque_limit
    saturated = np.mean([np.abs(s.torque) >= limit for s in path[100:]], axis=0)
    assert saturated[5] > 0.9
    assert not saturated[:3].any()
    stopped = last(with_(setting, torque_limits=False), 1.0)
    assert stopped.t < 0.1
    assert "The control period is at fault" in stopped.trouble
    calm = last(with_(setting, kd=5.0), 20.0)
    assert np.abs(error(calm)).max() < 1e-5


def test_every_experiment_is_verified_here() -> None:
    assert set(EXPERIMENTS) == VERIFIED
    assert len(EXPERIMENTS) >= 6


# The world's laws


def test_it_starts_as_asked() -> None:
    params = with_({}, initial_error=-0.2, amplitude=0.4, frequency=0.5)
    state = LAB.init(params, np.random.default_rng(0))
    home = plant("ur5").arm.home
    np.testing.assert_allclose(state.q, home - 0.2, atol=1e-15)
    np.testing.assert_allclose(state.v, 0.4 * np.pi)
    np.testing.assert_array_equal(state.q_ref, home)


def totals(params: JointParams) -> np.ndarray:
    """The energy at every step of two seconds [J]."""
    return np.array([LAB.measure(params, s)["total"] for s in states(params, 2.0)])


def test_without_torque_energy_stays() -> None:
    free: dict[str, Value] = {
        "controller": "pid",
        "kp": 0.0,
        "kd": 0.0,
        "integrator": "rk4",
        "step": 0.0005,
    }
    for robot in ("ur5", "double-pendulum"):
        params = with_(free, robot=robot, payload=1.0)
        energies = totals(params)
        np.testing.assert_allclose(energies, energies[0], atol=1e-5)
        losing = with_(free, robot=robot, friction=0.5)
        assert np.all(np.diff(totals(losing)) < 0.0)


@pytest.mark.parametrize("robot", ["ur5", "panda", "double-pendulum"])
def test_energy_changes_by_the_work_done(robot: str) -> None:
    """With the torque held over whole world steps its work is tau dq, and a push's is f dx."""
    params = with_(
        {"control_period": 0.01, "integrator": "rk4", "step": 0.0005, "kd": 5.0},
        robot=robot,
        payload=2.0,
        push_direction="z",
        torque_limits=False,
    )
    world = plant(robot, 2.0)
    path = list(states(params, 1.0, {30: PUSHED}))
    assert not path[-1].trouble
    for before, after in pairwise(path):
        work = after.torque @ (after.q - before.q)
        work += after.force @ (world.tip(after.q) - world.tip(before.q))
        gained = sum(world.energy(after.q, after.v)) - sum(world.energy(before.q, before.v))
        assert gained == pytest.approx(work, abs=2e-7)


def test_a_push_is_an_impulse() -> None:
    """From rest and compensated, M v = J' f 0.2 s for a small force."""
    params = with_(
        {"reference": "set-point", "kp": 0.0, "kd": 0.0, "push_force": 0.1, "amplitude": 0.0},
        push_direction="-z",
    )
    path = list(states(params, 0.5, {5: PUSHED}))
    forces = [LAB.measure(params, s)["force"] for s in path]
    assert forces == [0.1 if 5 < k <= 5 + PUSH_STEPS else 0.0 for k in range(len(path))]
    world = plant("ur5")
    mass = Robot.near(world.model, world.data, path[0].q, 0.0).mass
    impulse = world.tip_jacobian(path[0].q).T @ np.array([0.0, 0.0, -0.1 * 0.2])
    np.testing.assert_allclose(path[26].v, np.linalg.solve(mass, impulse), rtol=2e-3, atol=1e-5)


def test_the_handle_pulls_like_a_spring() -> None:
    params = with_({}, reference="set-point", amplitude=0.0)
    start = LAB.init(params, np.random.default_rng(0))
    tip = plant("ur5").tip(start.q)
    for offset, size in (([0.0, 0.1, 0.0], 0.1 * SPRING), ([0.0, 5.0, 0.0], STRONGEST_PULL)):
        pulling = Inputs(handles={"pull": tuple(tip + offset)})
        state = LAB.step(params, pulling, start)
        assert float(np.linalg.norm(state.force)) == pytest.approx(size, rel=0.02)
        path = list(states(params, 1.0, dict.fromkeys(range(100), pulling)))
        assert plant("ur5").tip(path[-1].q)[1] > tip[1] + 0.01
        assert not LAB.step(params, Inputs(), state).force.any()


@pytest.mark.parametrize("robot", ["ur5", "panda", "double-pendulum"])
def test_torque_stays_within_its_limits(robot: str) -> None:
    setting: dict[str, Value] = {
        "robot": robot,
        "kp": 2000.0,
        "reference": "set-point",
        "initial_error": 0.5,
    }
    limit = plant(robot).arm.torque_limit
    limited = list(states(with_(setting), 0.5))
    assert all(np.all(np.abs(s.torque) <= limit) for s in limited)
    assert limited[-1].peak_torque == limit.max()
    free = list(states(with_(setting, torque_limits=False), 0.02))
    assert np.any(np.abs(free[1].torque) > limit)


def test_a_slow_controller_looks_across_world_steps() -> None:
    path = list(states(with_({}, control_period=0.05), 0.5))
    changes = [k for k in range(1, 50) if np.any(path[k + 1].torque != path[k].torque)]
    assert changes == [5, 10, 15, 20, 25, 30, 35, 40, 45]


def test_the_reference_is_the_one_asked_for_at_its_time() -> None:
    home = plant("ur5").arm.home
    for k, state in enumerate(states(with_({}, amplitude=0.25, frequency=0.7), 4.0)):
        sine = 0.25 * np.sin(2 * np.pi * 0.7 * k * LAB.period)
        np.testing.assert_allclose(state.q_ref, home + sine, atol=1e-12)
    for k, state in enumerate(states(with_({}, reference="minimum-jerk", duration=0.5), 3.0)):
        if k * LAB.period % 1.5 in (0.5, 0.75):
            np.testing.assert_allclose(state.q_ref, home + 0.3, atol=1e-12)


def test_the_controller_sees_the_reference_of_its_own_tick() -> None:
    """At 5 ms the last tick of a world step is 5 ms before its end."""
    params = with_({"controller": "open-loop", "control_period": 0.005}, frequency=1.0)
    known = plant("ur5")
    for state in list(states(params, 0.3))[1:]:
        phase = 2 * np.pi * (state.t - 0.005)
        s, v, a = (
            0.3 * np.sin(phase),
            0.3 * 2 * np.pi * np.cos(phase),
            -0.3 * (2 * np.pi) ** 2 * np.sin(phase),
        )
        ones = np.ones(6)
        tau = pin.rnea(known.model, known.data, known.arm.home + s, v * ones, a * ones)
        np.testing.assert_allclose(state.torque, tau, rtol=1e-9, atol=1e-9)


def test_eigenvalues_are_those_of_the_loop_with_its_payload_and_friction() -> None:
    params = with_({}, payload=4.0, friction=3.0, amplitude=0.0)
    state = LAB.init(params, np.random.default_rng(0))
    world, q0, d = plant("ur5", 4.0), state.q_ref, 1e-6

    # What holds the payload where the loop is linearised, so that it rests there.
    held = pin.computeGeneralizedGravity(world.model, world.data, q0) - gravity(params, q0)

    def rate(x: np.ndarray) -> np.ndarray:
        q, v = x[:6], x[6:]
        tau = held + params.kp * (q0 - q) - params.kd * v + gravity(params, q)
        return np.concatenate([v, world.acceleration(tau, 3.0)(q, v)])

    at = np.concatenate([q0, np.zeros(6)])
    slope = np.array([(rate(at + d * e) - rate(at - d * e)) / (2 * d) for e in np.eye(12)]).T
    fields = LAB.fields(params, state)
    found = np.sort_complex(fields["poles_re"] + 1j * fields["poles_im"])
    np.testing.assert_allclose(found, np.sort_complex(np.linalg.eigvals(slope)), rtol=1e-5)


def test_changing_the_frequency_live_does_not_move_the_reference() -> None:
    slow, fast = with_({}), with_({}, frequency=2.0)
    state = last(slow, 1.23)
    after = LAB.step(fast, Inputs(), state)
    assert np.abs(after.q_ref - state.q_ref).max() < 0.3 * 2 * np.pi * 2.0 * LAB.period


def test_the_integral_is_empty_unless_used() -> None:
    filled = last(with_({}, controller="pid", ki=100.0), 0.5)
    assert filled.integral.any()
    assert not LAB.step(with_({}, controller="pid"), Inputs(), filled).integral.any()
    assert not LAB.step(with_({}, ki=100.0), Inputs(), filled).integral.any()


def test_the_step_response_of_a_known_system() -> None:
    """Computed torque with zeta = 0.5, omega = 6: overshoot exp(-pi zeta / sqrt(1 - zeta^2))."""
    params = with_(
        {"controller": "computed-torque", "kp": 36.0, "kd": 6.0, "reference": "set-point"},
        initial_error=0.2,
        torque_limits=False,
        integrator="rk4",
    )
    rest = last(params, 5.0)
    measure = LAB.measure(params, rest)
    assert measure["overshoot"] == pytest.approx(16.30, abs=0.3)
    assert measure["settling_time"] == pytest.approx(1.347, abs=0.02)
    assert "settling_time" not in LAB.measure(params, last(params, 0.5))
    moved = LAB.step(params.change({"amplitude": 0.5}), Inputs(), rest)
    assert moved.response is not None
    assert moved.response.size == pytest.approx(0.2)
    assert moved.response.time == pytest.approx(5.0)


def test_read_outs_are_what_they_say() -> None:
    params = with_({}, initial_error=0.1, payload=3.0)
    path = list(states(params, 3.0))
    errors = np.array([error(s) for s in path])
    measure = LAB.measure(params, path[-1])
    assert measure["rms_error"] == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-12)
    mean = np.abs(errors[-100:].mean(axis=0)).max()
    assert measure["steady_state_error"] == pytest.approx(mean, rel=1e-12)
    assert "steady_state_error" not in LAB.measure(params, path[99])


# Data, not surprises


def arrays(state: JointState) -> list[np.ndarray]:
    return [value for value in vars(state).values() if isinstance(value, np.ndarray)]


def same(one: JointState, other: JointState) -> bool:
    pairs = zip(arrays(one), arrays(other), strict=True)
    return one.t == other.t and all(np.array_equal(a, b) for a, b in pairs)


def test_the_same_seed_gives_the_same_bits() -> None:
    params = with_({}, noise=0.003, controller="pid", ki=50.0)
    one, two = (list(states(params, 1.0, {20: PUSHED}, seed=3)) for _ in range(2))
    assert all(same(a, b) for a, b in zip(one, two, strict=True))
    other = list(states(params, 1.0, {20: PUSHED}, seed=4))
    assert not same(one[-1], other[-1])


def test_a_state_can_be_kept_and_rewound() -> None:
    params = with_({}, noise=0.003, reference="set-point", initial_error=0.1)
    kept = last(params, 0.3)
    copied = copy.deepcopy(kept)
    after = LAB.step(params, PUSHED, kept)
    LAB.step(params.change({"payload": 4.0}), Inputs(), after)
    assert same(kept, copied)
    assert same(LAB.step(params, PUSHED, copied), after)
    for old in arrays(kept):
        assert not any(np.shares_memory(old, new) for new in arrays(after))


def test_noise_has_the_deviation_asked_for_and_no_memory() -> None:
    params = with_({}, noise=0.004)
    state = LAB.init(params, np.random.default_rng(1))
    rows = []
    for k in range(2000):
        state.steps = k
        noise = LAB._noise(params, state, tuple(range(10)))
        assert noise is not None
        rows.append(noise)
    samples = np.concatenate(rows)
    n = samples[:, 0].size
    for kind, sigma in ((0, 0.004), (1, 0.004 * VELOCITY_NOISE)):
        x = samples[:, kind] / sigma
        assert abs(x.mean()) < 4 / np.sqrt(n)
        assert abs(x.std() - 1) < 4 / np.sqrt(2 * n)
        for lag in (1, 2, 5, 10, 20):
            assert abs(np.mean(x[lag:] * x[:-lag])) < 4 / np.sqrt(n)


def test_noise_does_not_depend_on_the_integration_step() -> None:
    state = LAB.init(with_({}), np.random.default_rng(1))
    coarse = LAB._noise(with_({}, noise=0.01), state, tuple(range(10)))
    fine = LAB._noise(with_({}, noise=0.01, step=0.0001), state, tuple(range(0, 100, 10)))
    assert coarse is not None
    assert fine is not None
    np.testing.assert_array_equal(coarse, fine)


def test_trouble_keeps_the_last_sane_state() -> None:
    params = with_(EXPERIMENTS["A slow controller chatters"], torque_limits=False)
    *_, sane, stopped = states(params, 1.0)
    assert f"t = {stopped.t:.2f} s" in stopped.trouble
    assert same(sane, stopped)
    assert LAB.step(params, PUSHED, stopped) is stopped
    check_measure(params, stopped, sane)


def diverging(rng: np.random.Generator, steps: Sequence[float]) -> tuple[JointParams, JointState]:
    """A random setting that diverges within half a second, and how it ended."""

    def anything(low: float, high: float) -> float:
        return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")

    for _ in range(1000):
        params = with_(
            {},
            **{name: str(rng.choice(list(options))) for name, options in CHOICES.items()},
            amplitude=round(rng.uniform(0.0, 0.8), 2),
            frequency=round(rng.uniform(0.05, 1.0), 2),
            kp=anything(1.0, 2000.0),
            ki=anything(1.0, 2000.0) if rng.random() < 0.7 else 0.0,
            kd=anything(0.1, 200.0) if rng.random() < 0.9 else 0.0,
            payload=round(rng.uniform(0.0, 10.0), 1) if rng.random() < 0.3 else 0.0,
            friction=round(rng.uniform(0.0, 20.0), 1) if rng.random() < 0.3 else 0.0,
            torque_limits=bool(rng.random() < 0.3),
            control_period=float(rng.choice(list(MENU.periods))),
            step=float(rng.choice(list(steps))),
        )
        stopped = last(params, 0.5)
        if stopped.trouble:
            return params, stopped
    raise AssertionError("nothing diverges")


def check_advice(seed: int, count: int, seconds: float, steps: Sequence[float]) -> None:
    """Whatever is advised where a run diverged, the run with it does not diverge."""
    rng, advised = np.random.default_rng(seed), 0
    for _ in range(count):
        params, stopped = diverging(rng, steps)
        proposals = remedies(along_the_reference(params, stopped.q_ref), params.setting, MENU)
        advised += bool(proposals)
        for proposal in proposals:
            assert proposal.text in stopped.trouble
            for setting in proposal.settings:
                followed = params.change(
                    {name: getattr(setting, name) for name in SETTING} | asdict(setting.gains)
                )
                ended = last(followed, seconds)
                assert not ended.trouble, (proposal.text, params)
    assert advised > 0.6 * count


CHOICES: Mapping[str, Mapping[str, Any]] = {
    "robot": ROBOTS,
    "reference": REFERENCES,
    "controller": CONTROLLERS,
    "integrator": INTEGRATORS,
}
SETTING = ("controller", "control_period", "integrator", "step")


def test_advice_helps_where_it_is_given() -> None:
    check_advice(seed=0, count=3, seconds=1.0, steps=(0.005, 0.01))


@pytest.mark.study
def test_advice_helps_wherever_it_is_given() -> None:
    check_advice(seed=1, count=150, seconds=8.0, steps=(0.001, 0.002, 0.005, 0.01))


def test_too_much_damping_is_answered_by_an_interval() -> None:
    """At 10 ms, explicit Euler, too little is as bad: 60 and 1.5 diverge, what is named does
    not."""
    setting: dict[str, Value] = {
        "controller": "pid",
        "reference": "set-point",
        "kp": 330.0,
        "kd": 60.0,
        "step": 0.01,
        "control_period": 0.01,
        "integrator": "explicit-euler",
        "torque_limits": False,
    }
    stopped = last(with_(setting), 5.0)
    found = re.search(r"k_d from (\S+) to (\d[\d.]*\d)", stopped.trouble)
    assert found, stopped.trouble
    low, high = map(float, found.groups())
    assert last(with_(setting, kd=1.5), 20.0).trouble
    for kd in (low, 0.5 * (low + high), high):
        assert not last(with_(setting, kd=kd), 20.0).trouble


def ends() -> Iterator[Any]:
    """Every tunable at every option, or at both ends of its slider."""
    for name, tunable in JointParams.tunables.items():
        match tunable:
            case Knob(low=low, high=high):
                values: list[Value] = [low, high]
            case Choice(options=options):
                values = list(options)
            case Toggle():
                values = [True, False]
        for value in values:
            yield pytest.param({name: value}, id=f"{name}={value}")
    yield pytest.param({"kp": 2000.0, "ki": 2000.0, "kd": 200.0, "controller": "pid"}, id="gains")
    for integrator in ("explicit-euler", "rk4"):
        wild = {"integrator": integrator, "step": 0.01, "control_period": 0.05, "kd": 200.0}
        yield pytest.param({**wild, "torque_limits": False}, id=f"wild {integrator}")


def check_measure(params: JointParams, state: JointState, first: JointState) -> None:
    measure, begin = LAB.measure(params, state), LAB.measure(params, first)
    for name, value in measure.items():
        assert np.all(np.isfinite(value)), name
        assert np.shape(value) == np.shape(begin.get(name, value)), name


@pytest.mark.parametrize("robot", ["ur5", "panda", "double-pendulum"])
@pytest.mark.parametrize("changes", ends())
def test_both_ends_of_every_slider(changes: Mapping[str, Value], robot: str) -> None:
    params = with_({"robot": robot, **changes})
    path = list(states(params, 1.0, {50: PUSHED}))
    check_measure(params, path[-1], path[0])
    assert path[-1].trouble or path[-1].t == pytest.approx(1.0)
    fields = LAB.fields(params, path[-1])
    assert all(np.all(np.isfinite(value)) for value in fields.values())
    scene = NullScene()
    LAB.draw(scene, params, path[-1])
    assert {"camera", "robot", "reference", "pull"} <= set(scene.names)


def test_plots_name_real_channels() -> None:
    params = with_({}, reference="set-point", initial_error=0.1)
    rest = last(params, 5.0)
    measure, fields = LAB.measure(params, rest), LAB.fields(params, rest)
    for plot in LAB.plots:
        assert set(measured(plot)) <= set(measure)
        assert set(pictured(plot)) <= set(fields)


@pytest.mark.parametrize("name", LAB.presets)
def test_presets_run_well(name: str) -> None:
    path = list(states(with_(LAB.presets[name]), 3.0))
    assert not path[-1].trouble
    assert np.abs(error(path[-1])).max() < 0.06


def test_the_force_is_drawn_while_it_lasts() -> None:
    params = with_({})
    pushed = last(params, 0.1, {5: PUSHED})
    for state, drawn in ((pushed, True), (last(params, 0.1), False)):
        scene = NullScene()
        LAB.draw(scene, params, state)
        assert ("force" in scene.names) == drawn
        assert "trail" in scene.names
