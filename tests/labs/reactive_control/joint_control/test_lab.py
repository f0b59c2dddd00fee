"""The lab joint-control: what its world must obey, and what it keeps and measures."""

import copy
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from labs.lab import Inputs
from labs.models.plant import plant
from labs.params import Choice, Knob, Toggle, Value
from labs.reactive_control.joint_control.lab import JointState
from labs.reactive_control.joint_control.params import JointParams
from labs.scene import NullScene
from tests.labs.reactive_control.joint_control.runs import (
    ARTICLE,
    LAB,
    PUSHED,
    error,
    final_state,
    parameters,
    states,
)

# The world's laws


def test_it_starts_as_asked() -> None:
    params = parameters({}, initial_error=-0.2, amplitude=0.4, frequency=0.5)
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
        params = parameters(free, robot=robot, payload=1.0)
        energies = totals(params)
        np.testing.assert_allclose(energies, energies[0], atol=1e-5)
        losing = parameters(free, robot=robot, friction=0.5)
        assert np.all(np.diff(totals(losing)) < 0.0)


@pytest.mark.parametrize("robot", ["ur5", "panda", "double-pendulum"])
def test_energy_changes_by_the_work_done(robot: str) -> None:
    """With the torque held over whole world steps its work is tau dq, and a push's is f dx."""
    params = parameters(
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


@pytest.mark.parametrize("robot", ["ur5", "panda", "double-pendulum"])
def test_torque_stays_within_its_limits(robot: str) -> None:
    setting: dict[str, Value] = {
        "robot": robot,
        "kp": 2000.0,
        "reference": "set-point",
        "initial_error": 0.5,
    }
    limit = plant(robot).arm.torque_limit
    limited = list(states(parameters(setting), 0.5))
    assert all(np.all(np.abs(s.torque) <= limit) for s in limited)
    assert limited[-1].peak_torque == limit.max()
    free = list(states(parameters(setting, torque_limits=False), 0.02))
    assert np.any(np.abs(free[1].torque) > limit)


def test_a_slow_controller_looks_across_world_steps() -> None:
    path = list(states(parameters({}, control_period=0.05), 0.5))
    changes = [k for k in range(1, 50) if np.any(path[k + 1].torque != path[k].torque)]
    assert changes == [5, 10, 15, 20, 25, 30, 35, 40, 45]


def test_the_reference_is_the_one_asked_for_at_its_time() -> None:
    home = plant("ur5").arm.home
    for k, state in enumerate(states(parameters({}, amplitude=0.25, frequency=0.7), 4.0)):
        sine = 0.25 * np.sin(2 * np.pi * 0.7 * k * LAB.period)
        np.testing.assert_allclose(state.q_ref, home + sine, atol=1e-12)
    for k, state in enumerate(states(parameters({}, reference="minimum-jerk", duration=0.5), 3.0)):
        if k * LAB.period % 1.5 in (0.5, 0.75):
            np.testing.assert_allclose(state.q_ref, home + 0.3, atol=1e-12)


def test_the_controller_sees_the_reference_of_its_own_tick() -> None:
    """At 5 ms the last tick of a world step is 5 ms before its end."""
    params = parameters({"controller": "open-loop", "control_period": 0.005}, frequency=1.0)
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


def test_changing_the_frequency_live_does_not_move_the_reference() -> None:
    slow, fast = parameters({}), parameters({}, frequency=2.0)
    state = final_state(slow, 1.23)
    after = LAB.step(fast, Inputs(), state)
    assert np.abs(after.q_ref - state.q_ref).max() < 0.3 * 2 * np.pi * 2.0 * LAB.period


def test_the_integral_is_empty_unless_used() -> None:
    filled = final_state(parameters({}, controller="pid", ki=100.0), 0.5)
    assert filled.integral.any()
    assert not LAB.step(parameters({}, controller="pid"), Inputs(), filled).integral.any()
    assert not LAB.step(parameters({}, ki=100.0), Inputs(), filled).integral.any()


def test_the_step_response_of_a_known_system() -> None:
    """Computed torque with zeta = 0.5, omega = 6: overshoot exp(-pi zeta / sqrt(1 - zeta^2))."""
    params = parameters(
        {"controller": "computed-torque", "kp": 36.0, "kd": 6.0, "reference": "set-point"},
        initial_error=0.2,
        torque_limits=False,
        integrator="rk4",
    )
    rest = final_state(params, 5.0)
    measure = LAB.measure(params, rest)
    assert measure["overshoot"] == pytest.approx(16.30, abs=0.3)
    assert measure["settling_time"] == pytest.approx(1.347, abs=0.02)
    assert "settling_time" not in LAB.measure(params, final_state(params, 0.5))
    moved = LAB.step(params.change({"amplitude": 0.5}), Inputs(), rest)
    assert moved.response is not None
    assert moved.response.size == pytest.approx(0.2)
    assert moved.response.time == pytest.approx(5.0)


def test_read_outs_are_what_they_say() -> None:
    params = parameters({}, initial_error=0.1, payload=3.0)
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


def same_state(one: JointState, other: JointState) -> bool:
    pairs = zip(arrays(one), arrays(other), strict=True)
    return one.t == other.t and all(np.array_equal(a, b) for a, b in pairs)


def test_the_same_seed_gives_the_same_bits() -> None:
    params = parameters({}, noise=0.003, controller="pid", ki=50.0)
    one, two = (list(states(params, 1.0, {20: PUSHED}, seed=3)) for _ in range(2))
    assert all(same_state(a, b) for a, b in zip(one, two, strict=True))
    other = list(states(params, 1.0, {20: PUSHED}, seed=4))
    assert not same_state(one[-1], other[-1])


def test_a_state_can_be_kept_and_rewound() -> None:
    params = parameters({}, noise=0.003, reference="set-point", initial_error=0.1)
    kept = final_state(params, 0.3)
    copied = copy.deepcopy(kept)
    after = LAB.step(params, PUSHED, kept)
    LAB.step(params.change({"payload": 4.0}), Inputs(), after)
    assert same_state(kept, copied)
    assert same_state(LAB.step(params, PUSHED, copied), after)
    for old in arrays(kept):
        assert not any(np.shares_memory(old, new) for new in arrays(after))


def test_trouble_keeps_the_last_sane_state() -> None:
    params = parameters(ARTICLE.settings["A slow controller chatters"], torque_limits=False)
    *_, sane, stopped = states(params, 1.0)
    assert f"t = {stopped.t:.2f} s" in stopped.trouble
    assert same_state(sane, stopped)
    assert LAB.step(params, PUSHED, stopped) is stopped
    check_measure(params, stopped, sane)


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
@pytest.mark.parametrize("changes", list(ends()))
def test_both_ends_of_every_slider(changes: Mapping[str, Value], robot: str) -> None:
    params = parameters({"robot": robot, **changes})
    path = list(states(params, 1.0, {50: PUSHED}))
    check_measure(params, path[-1], path[0])
    assert path[-1].trouble or path[-1].t == pytest.approx(1.0)
    fields = LAB.fields(params, path[-1])
    assert all(np.all(np.isfinite(value)) for value in fields.values())
    scene = NullScene()
    LAB.draw(scene, params, path[-1])
    assert {"camera", "robot", "reference", "pull"} <= set(scene.names)


@pytest.mark.parametrize("name", LAB.presets)
def test_presets_run_well(name: str) -> None:
    path = list(states(parameters(LAB.presets[name]), 3.0))
    assert not path[-1].trouble
    assert np.abs(error(path[-1])).max() < 0.06


def test_the_force_is_drawn_while_it_lasts() -> None:
    params = parameters({})
    pushed = final_state(params, 0.1, {5: PUSHED})
    for state, drawn in ((pushed, True), (final_state(params, 0.1), False)):
        scene = NullScene()
        LAB.draw(scene, params, state)
        assert ("force" in scene.names) == drawn
        assert "trail" in scene.names
