"""The lab kinematics: what its article claims, in numbers, and what it shows and measures."""

import copy
from collections.abc import Iterator, Mapping

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from labs.algorithms.frame_chain import FrameChain
from labs.algorithms.orientation import (
    SEQUENCES,
    euler_rates,
    gimbal_lock_sine,
    matrix_to_euler,
    matrix_to_rpy,
)
from labs.lab import Inputs
from labs.models.arms import load_arm
from labs.params import Value
from labs.reactive_control.kinematics.lab import MAX_AMPLIFICATION, Kinematics, KinematicsState
from labs.reactive_control.kinematics.params import KinematicsParams
from labs.scene import NullScene
from tests.labs.experiments import ArticleExperiments
from tests.labs.recording import record

LAB = Kinematics()
ARTICLE = ArticleExperiments("labs.reactive_control", "kinematics")


def parameters(setting: Mapping[str, Value], **changes: Value) -> KinematicsParams:
    return KinematicsParams().change({**setting, **changes})


def states(params: KinematicsParams, seconds: float) -> Iterator[KinematicsState]:
    state = LAB.init(params, np.random.default_rng(0))
    yield state
    for _ in range(round(seconds / LAB.period)):
        state = LAB.step(params, Inputs(), state)
        yield state


def recorded(params: KinematicsParams, seconds: float = 4.0) -> Mapping[str, np.ndarray]:
    """Every channel over time; 4 s are a whole wobble at the experiments' 0.25 Hz."""
    return record(LAB, params, states(params, seconds))


def fields(params: KinematicsParams) -> Mapping[str, np.ndarray]:
    return LAB.fields(params, LAB.init(params, np.random.default_rng(0)))


# The chain ------------------------------------------------------------------------------------


def test_a_robot_stops_at_its_limits() -> None:
    model = load_arm("panda").model
    params = parameters({}, robot="panda", q4=3.0, q2=-3.0)
    assert params.q[3] == model.upperPositionLimit[3]
    assert params.q[1] == model.lowerPositionLimit[1]
    assert params.q[0] == params.q1


def test_the_slider_moved_last_chooses_the_factor() -> None:
    arm, params = load_arm("ur5"), parameters({})
    state = LAB.step(params, Inputs(), LAB.init(params, np.random.default_rng(0)))
    assert state.moved == 1
    for i in (4, 2, 7):
        params = params.change({f"q{i}": 0.33})
        state = LAB.step(params, Inputs(), state)
        state = LAB.step(params, Inputs(), state)  # it stays chosen
        assert state.moved == i
        shown = min(i, 6)  # the UR5's last
        assert LAB.measure(params, state)["shown"] == shown
        factor = FrameChain(arm.model, arm.tip).factors(params.q)[shown - 1]
        np.testing.assert_array_equal(LAB.fields(params, state)["factor"], factor)
    chosen = params.change({"factor": "3"})
    assert LAB.measure(chosen, state)["shown"] == 3


def test_the_shown_frame_is_labelled() -> None:
    for robot, frames in (("ur5", 7), ("panda", 8)):
        params = parameters({}, robot=robot)
        scene = NullScene()
        LAB.draw(scene, params, LAB.init(params, np.random.default_rng(0)))
        assert sum(name.startswith("frame ") for name in scene.names) == frames
        assert {"robot", "shown", "body", "lost"} <= set(scene.names)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_five_ways_say_the_same(sequence: str) -> None:
    """The orientation of the end-effector, by SciPy from each of them."""
    for q in np.random.default_rng(5).uniform(-3.0, 3.0, (10, 6)):
        sliders = {f"q{i}": float(a) for i, a in enumerate(q, start=1)}
        found = fields(parameters({}, sequence=sequence, **sliders))
        wanted = found["rotation"]
        np.testing.assert_array_equal(found["product"][:3, :3], wanted)
        angle, *axis = found["angle_axis"][0]
        for turn in (
            Rotation.from_euler(sequence.upper(), found["euler"][0]),
            Rotation.from_euler("xyz", found["rpy"][0]),
            Rotation.from_rotvec(angle * np.array(axis)),
            Rotation.from_quat(found["quaternion"][0][[1, 2, 3, 0]]),
        ):
            np.testing.assert_allclose(turn.as_matrix(), wanted, atol=1e-13)
    counts = {"rotation": 9, "euler": 3, "rpy": 3, "angle_axis": 4, "quaternion": 4}
    assert {name: found[name].size for name in counts} == counts


# The body in the gimbal -----------------------------------------------------------------------


@pytest.mark.parametrize("direction", ["lost", "first", "second"])
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_amplification_is_that_of_the_rates(sequence: str, direction: str) -> None:
    params = parameters({}, sequence=sequence, direction=direction, distance=0.3, size=0.2)
    for state in list(states(params, 4.0))[::37]:
        angles = matrix_to_euler(sequence, state.rotation)
        rates = euler_rates(sequence, angles, params.gimbal.axis)
        measure = LAB.measure(params, state)
        assert measure["amplification"] == pytest.approx(np.abs(rates).max(), rel=1e-5)
        assert measure["law"] == pytest.approx(
            1.0 / gimbal_lock_sine(sequence, angles[1]), rel=1e-12
        )
        assert measure["amplification"] <= measure["law"] * (1.0 + 1e-5)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_the_distance_is_that_from_the_lock(sequence: str) -> None:
    """All twelve meet the law's worst case at 1 / sin(delta)."""
    params = parameters({}, sequence=sequence, distance=0.02)
    measure = LAB.measure(params, LAB.init(params, np.random.default_rng(0)))
    assert measure["law"] == pytest.approx(1.0 / np.sin(0.02), rel=1e-9)
    assert measure["amplification"] == pytest.approx(1.0 / np.sin(0.02), rel=1e-4)


@pytest.mark.parametrize("sequence", ["zyx", "zxz"])
def test_the_quaternion_moves_half_as_fast_as_the_body(sequence: str) -> None:
    """Each step is the chord of half the turn, however close the lock."""
    channels = recorded(
        parameters({}, sequence=sequence, distance=0.0, size=0.5, frequency=1.0), 1.0
    )
    quaternions = np.column_stack([channels[name] for name in ("qw", "qx", "qy", "qz")])
    steps = np.linalg.norm(np.diff(quaternions, axis=0), axis=1)
    turned = np.diff(0.5 * np.sin(2.0 * np.pi * np.arange(101) * LAB.period))
    np.testing.assert_allclose(steps, 2.0 * np.sin(np.abs(turned) / 4.0), atol=1e-14)
    rates = steps / np.abs(turned)
    np.testing.assert_allclose(rates, channels["quaternion_gain"][1:], rtol=1e-3)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_the_quaternion_needs_no_change_of_sign(sequence: str) -> None:
    for direction in ("lost", "first", "second"):
        params = parameters({}, sequence=sequence, distance=0.0, size=0.5, direction=direction)
        assert recorded(params.change({"frequency": 2.0}), 0.5)["qw"].min() > 0.4
        far = params.change({"frequency": 2.0, "distance": 1.57})
        assert recorded(far, 0.5)["qw"].min() > 0.4


def test_peaks_start_anew_with_other_settings() -> None:
    params = parameters({}, distance=0.0035)
    *_, state = states(params, 4.0)
    assert state.peak_rate > 40.0
    calm = params.change({"distance": 1.0})
    after = LAB.step(calm, Inputs(), state)
    assert after.peak_rate < 1.0
    assert after.peak_speed <= 2.0 * np.pi * 0.25 * 0.1 + 1e-12
    moved = LAB.step(params.change({"q1": 0.0}), Inputs(), state)
    assert moved.peak_rate == pytest.approx(state.peak_rate, rel=1e-9)


def test_at_the_lock_itself_numbers_stay_finite() -> None:
    channels = recorded(parameters({}, distance=0.0))
    assert channels["law"].max() == MAX_AMPLIFICATION
    assert channels["amplification"].max() == MAX_AMPLIFICATION
    assert all(np.isfinite(values).all() for values in channels.values())


def test_a_step_leaves_its_state_alone() -> None:
    params = parameters({})
    state = LAB.init(params, np.random.default_rng(0))
    kept = copy.deepcopy(state)
    LAB.step(params.change({"q2": 0.1}), Inputs(), state)
    for name, value in vars(kept).items():
        np.testing.assert_array_equal(getattr(state, name), value)


# The experiments ------------------------------------------------------------------------------


def changed(setting: Mapping[str, Value], name: str) -> np.ndarray:
    """Which entries of a field the setting changes, from the defaults."""
    before = fields(parameters({}, factor=str(setting["factor"])))[name]
    difference: np.ndarray = np.abs(fields(parameters(setting))[name] - before) > 1e-6
    return difference


@ARTICLE.verify("One slider, one factor")
def test_one_slider(setting: Mapping[str, Value]) -> None:
    assert KinematicsParams().q3 == 1.3
    factor = changed(setting, "factor")
    assert factor.sum() == 4
    assert not factor[:, 3].any()
    product = changed(setting, "product")
    assert product[:3].all()
    assert not product[3].any()
    entries = fields(parameters(setting))["factor"][factor]
    sine, cosine = np.sin(0.5), np.cos(0.5)
    np.testing.assert_allclose(sorted(entries), [-sine, sine, cosine, cosine], atol=1e-12)
    assert ARTICLE.answer("One slider, one factor") == 4


@ARTICLE.verify("The last joint")
def test_the_last_joint(setting: Mapping[str, Value]) -> None:
    assert KinematicsParams().q6 == 0.5
    product = changed(setting, "product")
    assert product[:3, :2].all()
    assert not product[:, 2:].any()
    row = fields(parameters(setting))["dependence"][-1]
    assert row[-1] == pytest.approx(np.sqrt(2.0), rel=1e-8)
    assert row[:-1].min() > np.sqrt(2.0) + 1e-4
    assert ARTICLE.answer("The last joint") == "$z_6^0$ and $p_6^0$"


@ARTICLE.verify("Is it still a rotation?")
def test_still_a_rotation(setting: Mapping[str, Value]) -> None:
    measure = LAB.measure(
        parameters(setting), LAB.init(parameters(setting), np.random.default_rng(0))
    )
    assert measure["orthogonality"] < 1e-15
    assert measure["determinant"] == pytest.approx(1.0, abs=1e-15)
    assert ARTICLE.answer("Is it still a rotation?") == "a few times $10^{-16}$"


@ARTICLE.verify("Two degrees from the lock")
def test_two_degrees(setting: Mapping[str, Value]) -> None:
    channels = recorded(parameters(setting))
    swing = np.arctan2(np.sin(0.1), np.tan(0.035))
    assert swing == pytest.approx(1.23, abs=0.005)
    assert channels["phi"].max() == pytest.approx(swing, rel=1e-12)
    assert channels["phi"].min() == pytest.approx(-swing, rel=1e-12)
    assert channels["amplification"].max() == pytest.approx(28.6, abs=0.05)
    assert channels["amplification"].argmax() in (0, 200, 400)
    for name in ("qw", "qx", "qy", "qz"):
        assert np.abs(channels[name] - channels[name][0]).max() < 0.037


@ARTICLE.verify("Ten times closer")
def test_ten_times_closer(setting: Mapping[str, Value]) -> None:
    channels = recorded(parameters(setting))
    assert channels["phi"].max() == pytest.approx(1.54, abs=0.005)
    speed = 2.0 * np.pi * 0.25 * 0.1
    assert channels["peak_speed"][-1] == pytest.approx(0.157, abs=0.0005)
    assert channels["peak_speed"][-1] < speed
    assert channels["peak_rate"][-1] == pytest.approx(42.0, abs=0.5)
    assert channels["law"].max() == pytest.approx(286.0, abs=0.5)
    assert channels["law"].max() * speed == pytest.approx(45.0, abs=0.2)


@ARTICLE.verify("Directions that are left")
def test_directions_that_are_left(setting: Mapping[str, Value]) -> None:
    channels = recorded(parameters(setting))
    assert channels["law"].min() > 285.0
    np.testing.assert_allclose(channels["amplification"], 1.0, rtol=1e-5)
    assert channels["peak_rate"][-1] == pytest.approx(channels["peak_speed"][-1], rel=1e-6)
    assert np.ptp(channels["theta"]) < 1e-12
    assert np.ptp(channels["psi"]) < 1e-12
    assert np.ptp(channels["phi"]) == pytest.approx(0.2, rel=1e-9)


@ARTICLE.verify("Through the lock")
def test_through_the_lock(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    channels = recorded(params)
    assert channels["theta"].max() <= np.pi / 2
    assert channels["theta"].max() > np.pi / 2 - 0.002
    jumps = [np.flatnonzero(np.abs(np.diff(channels[name])) > 1e-9) for name in ("phi", "psi")]
    assert len(jumps[0]) == 2
    np.testing.assert_array_equal(jumps[0], jumps[1])
    for name in ("phi", "psi"):
        sizes = np.abs(np.diff(channels[name]))[jumps[0]]
        np.testing.assert_allclose(sizes, np.pi, rtol=1e-12)
    np.testing.assert_allclose(channels["amplification"], 1.0, rtol=1e-5)
    assert channels["peak_speed"][-1] * LAB.period < 0.002
    quaternions = np.column_stack([channels[name] for name in ("qw", "qx", "qy", "qz")])
    assert np.abs(np.diff(quaternions, axis=0)).max() < 0.001
    assert ARTICLE.answer("Through the lock") == "It turns back at 90 degrees."


@ARTICLE.verify("An arm at its own lock")
def test_an_arm_at_its_lock(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    measure = LAB.measure(params, LAB.init(params, np.random.default_rng(0)))
    assert measure["tool_law"] == pytest.approx(34.0, abs=0.5)
    angles = {
        q6: matrix_to_rpy(fields(params.change({"q6": q6}))["rotation"])
        for q6 in (-0.10, -0.09, -0.08, -0.07, -0.06, -0.05, -0.04)
    }
    assert angles[-0.10][1] == pytest.approx(1.54, abs=0.005)
    values = np.array(list(angles.values()))
    for column in (values[:, 0], values[:, 2]):
        steps = np.abs(np.diff(column))
        assert steps.argmax() == 2
        assert steps[2] == pytest.approx(np.pi, abs=1e-4)
        assert np.delete(steps, 2).max() < 1e-3
    assert ARTICLE.answer("An arm at its own lock") == "They jump by $\\pi$."


@ARTICLE.verify("Another sequence")
def test_another_sequence(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    assert params.q.tolist() == parameters(ARTICLE.settings["An arm at its own lock"]).q.tolist()
    measure = LAB.measure(params, LAB.init(params, np.random.default_rng(0)))
    assert measure["tool_law"] == pytest.approx(1.0, abs=0.005)
    assert fields(params)["euler"][0, 1] == pytest.approx(np.pi / 2, abs=0.1)
    # Its own lock: the z axis vertical.
    upright = matrix_to_euler("zyz", Rotation.from_euler("z", 0.4).as_matrix())
    assert gimbal_lock_sine("zyz", upright[1]) == 0.0
    assert ARTICLE.answer("Another sequence") == "No."


def test_every_experiment_is_verified() -> None:
    ARTICLE.check_all_are_verified()
