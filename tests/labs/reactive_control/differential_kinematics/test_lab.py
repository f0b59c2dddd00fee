"""The lab differential-kinematics: what its article claims, in numbers, and how the arm moves."""

import copy
from collections.abc import Mapping

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from labs.algorithms.inverse_kinematics import INVERSE_KINEMATICS_METHODS
from labs.algorithms.jacobian import ForwardKinematics
from labs.lab import Inputs
from labs.models.arms import load_arm
from labs.params import Value
from tests.labs.reactive_control.differential_kinematics.runs import (
    ARTICLE,
    LAB,
    Arrows,
    channel,
    fields,
    parameters,
    sigma_min,
    start,
    states,
)

# The experiments


@ARTICLE.verify("A lever from the base")
def test_only_the_horizontal_part_of_the_lever_counts(setting: Mapping[str, Value]) -> None:
    assert parameters(setting).rates.tolist() == [0.5, 0, 0, 0, 0, 0]
    arm = load_arm("ur5")
    chain = ForwardKinematics(arm.model, arm.tip).at(arm.home)
    lever = chain.placement.translation - chain.points[0]
    assert np.linalg.norm(lever) == pytest.approx(0.61, abs=0.005)
    assert np.hypot(*lever[:2]) == pytest.approx(0.53, abs=0.005)
    speed = np.linalg.norm(fields(setting)["twist"][:3, 0])
    assert speed == pytest.approx(0.26, abs=0.005)
    assert speed == pytest.approx(0.5 * np.hypot(*lever[:2]), rel=1e-12)
    lengths = [
        np.linalg.norm(fields(setting, **{joint: 0.5})["geometric"][:3, 0])
        for joint in ("q1", "q2")
    ]
    assert lengths[0] == pytest.approx(2 * speed, rel=1e-12)
    assert abs(lengths[1] - 2 * speed) > 0.05
    tip_speed = LAB.measure(parameters(setting), start(parameters(setting)))["tip_speed"]
    assert tip_speed == pytest.approx(speed, rel=1e-12)


@ARTICLE.verify("A joint that slides")
def test_the_column_of_a_slide_never_changes(setting: Mapping[str, Value]) -> None:
    before = fields(setting)
    np.testing.assert_array_equal(before["twist"][:, 0], [0, 0, 0.2, 0, 0, 0])
    for changes in ({"q2": 0.6}, {"q1": -1.0}, {"lift": 0.1}):
        after = fields(setting, **changes)["geometric"]
        np.testing.assert_array_equal(after[:, 2], [0, 0, 1, 0, 0, 0])
        assert np.any(after != before["geometric"]) == ("lift" not in changes)
    assert ARTICLE.answer("A joint that slides") == "It is the same in every posture."


@ARTICLE.verify("A calm turn, racing angles")
def test_the_angles_race(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    omega, rpy = (channel(params, name, 3.1) for name in ("omega", "rpy"))
    np.testing.assert_allclose(omega, 1.0, rtol=1e-12)
    assert rpy.max() == pytest.approx(7.0, abs=0.05)
    assert rpy.argmax() * LAB.period == pytest.approx(1.57, abs=0.02)
    steepest = list(states(params, 1.57))[-1]
    placement = ForwardKinematics(params.arm.model, params.arm.tip).at(steepest.q).placement
    pitch = Rotation.from_matrix(placement.rotation).as_euler("ZYX")[1]
    assert np.pi / 2 - abs(pitch) == pytest.approx(0.2, abs=0.002)
    assert rpy.max() <= 1 / np.sqrt(1 - abs(np.sin(pitch)))
    nearer = channel(parameters(setting, q4=0.05), "rpy", 3.1)
    assert nearer.max() / rpy.max() == pytest.approx(4.0, abs=0.05)
    difference = LAB.fields(params, steepest)["difference"]
    assert not difference[:3].any()
    assert np.abs(difference[3:]).max() > 4.0


@ARTICLE.verify("When the two agree")
def test_about_one_axis_they_agree(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    for state in list(states(params, 2.0))[::20]:
        found = LAB.fields(params, state)
        np.testing.assert_allclose(found["difference"], 0.0, atol=1e-14)
        assert found["twist"][5, 0] == pytest.approx(0.3 - 0.5 + 0.8, rel=1e-12)
    assert np.abs(fields({})["difference"]).max() > 0.9
    assert ARTICLE.answer("When the two agree") == "Zero."


@ARTICLE.verify("Fast or strong")
def test_what_is_slow_is_strong(setting: Mapping[str, Value]) -> None:
    assert sigma_min(setting) == pytest.approx(0.013, abs=5e-4)
    drawn = Arrows(setting)
    assert {"warning", "singular"} <= set(drawn.names)
    slow, strong = drawn.axes["velocities"], drawn.axes["forces"]
    weakest = np.linalg.norm(slow, axis=0).argmin()
    assert weakest == np.linalg.norm(strong, axis=0).argmax()
    params = parameters(setting)
    chain = ForwardKinematics(params.arm.model, params.arm.tip).at(start(params).q)
    along = chain.placement.translation - chain.points[1]
    direction = strong[:, weakest] / np.linalg.norm(strong[:, weakest])
    assert abs(direction @ along) / np.linalg.norm(along) == pytest.approx(0.99, abs=0.002)
    bent = Arrows(setting, q3=-0.6)
    assert "warning" not in bent.names
    for name in ("velocities", "forces"):
        thinness = [np.linalg.cond(which.axes[name]) for which in (drawn, bent)]
        assert thinness[1] < 0.75 * thinness[0]
    assert ARTICLE.answer("Fast or strong") == "Along the arm, both."


@ARTICLE.verify("The base does not matter")
def test_turning_the_base_turns_all_columns(setting: Mapping[str, Value]) -> None:
    assert sigma_min(setting) == pytest.approx(0.298, abs=5e-4)
    turned, home = fields(setting), fields({})
    np.testing.assert_allclose(turned["sigma"], home["sigma"], rtol=1e-13)
    turn = Rotation.from_rotvec([0.0, 0.0, 1.2]).as_matrix()
    for rows in (slice(0, 3), slice(3, 6)):
        expected = turn @ home["geometric"][rows]
        np.testing.assert_allclose(turned["geometric"][rows], expected, atol=1e-14)
    assert abs(sigma_min(setting, q3=-1.0) - 0.298) > 0.05
    assert ARTICLE.answer("The base does not matter") == "Neither."


@ARTICLE.verify("Out of reach with the pseudo-inverse")
def test_the_pseudo_inverse_blows_up(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    speed, given = channel(params, "speed", 8.0), channel(params, "rates", 8.0)
    error, sigma = channel(params, "error", 8.0), channel(params, "sigma_min", 8.0)
    assert speed.max() > 100.0
    assert np.abs(given).max() > params.fastest
    assert sigma.min() < 0.002
    moved = np.abs(np.diff(channel(params, "q", 8.0), axis=0)).max() / LAB.period
    assert moved == pytest.approx(params.fastest, rel=1e-9)
    assert speed[:250].max() < 2.0
    assert (speed[300:500] > 10.0).mean() > 0.5, "it trembles"
    assert max(error[:250].max(), error[700:].max()) < 0.001


@ARTICLE.verify("Damping tames it")
def test_damping_tames_it(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    speed, error = channel(params, "speed", 8.0), channel(params, "error", 8.0)
    assert speed.max() == pytest.approx(2.1, abs=0.05)
    assert speed.max() < 2.2
    assert np.all(speed <= channel(params, "bound", 8.0) * (1 + 1e-12))
    assert speed[350:450].max() < 0.25, "it rests"
    exact = channel(parameters(setting, method="pseudo-inverse"), "error", 8.0)
    assert error.max() == pytest.approx(0.09, abs=0.005)
    assert error.max() <= exact.max() < 0.12
    assert 1e3 * error[250] == pytest.approx(12, abs=0.5)
    assert 1e3 * exact[250] == pytest.approx(0.2, abs=0.02)
    heavy = channel(parameters(setting, damping=0.5), "error", 8.0)
    assert heavy[-1] == pytest.approx(0.18, abs=0.005)


@ARTICLE.verify("The transpose never inverts")
def test_the_transpose_lags_but_arrives(setting: Mapping[str, Value]) -> None:
    params = parameters(setting)
    assert channel(params, "error", 8.0).max() == pytest.approx(0.31, abs=0.006)
    assert channel(params, "speed", 8.0).max() < 0.25
    assert channel(params, "sigma_min", 8.0).max() ** 2 < 0.1
    *_, behind = states(params, 4.0)
    resting, errors = parameters(setting, reach=0.0, gain=50.0), []
    state = behind
    kinematics = ForwardKinematics(params.arm.model, params.arm.tip)
    for _ in range(2000):
        state = LAB.step(resting, Inputs(), state)
        tip = kinematics.at(state.q).placement.translation
        errors.append(float(np.linalg.norm(state.anchor - tip)))
    assert errors[0] > 0.1
    assert max(np.diff(errors)) < 1e-12
    assert errors[-1] < 1e-6


def test_every_experiment_is_verified_here() -> None:
    ARTICLE.check_all_are_verified(at_least=6)


# The world's laws


@pytest.mark.parametrize("robot", ["ur5", "panda", "scara"])
@pytest.mark.parametrize("method", INVERSE_KINEMATICS_METHODS)
def test_a_dragged_target_is_reached(robot: str, method: str) -> None:
    params = parameters({"mode": "follow"}, robot=robot, method=method, gain=50.0)
    begin = start(params)
    at = begin.anchor + np.array([-0.05, 0.08, 0.03])
    *_, end = states(params, 10.0, Inputs(handles={"target": tuple(at)}))
    tip = ForwardKinematics(params.arm.model, params.arm.tip).at(end.q).placement.translation
    np.testing.assert_allclose(tip, at, atol=1e-6)
    released = LAB.step(params, Inputs(), end)
    np.testing.assert_array_equal(released.anchor, at)


def test_the_pose_task_keeps_the_orientation() -> None:
    for task, kept in (("pose", True), ("position", False)):
        params = parameters({"mode": "follow", "reach": 0.2}, task=task, robot="panda")
        path = list(states(params, 4.0))
        kinematics = ForwardKinematics(params.arm.model, params.arm.tip)
        turns = [kinematics.at(s.q).placement.rotation @ path[0].orientation.T for s in path]
        largest = max(Rotation.from_matrix(turn).magnitude() for turn in turns)
        assert (largest < 0.02) == kept


@pytest.mark.parametrize("robot", ["ur5", "panda", "scara"])
def test_the_twist_is_how_the_arm_moves(robot: str) -> None:
    """Central differences of the pose over two steps at constant joint velocities, and of the
    velocity for what is left of the acceleration."""
    params = parameters({"mode": "velocity"}, robot=robot, dq1=0.6, dq2=-0.4, dq3=0.05, dq4=0.7)
    before, now, after = list(states(params, 0.02))
    kinematics, h = ForwardKinematics(params.arm.model, params.arm.tip), LAB.period
    p, q = (kinematics.at(s.q).placement for s in (before, after))
    twist = LAB.fields(params, now)["twist"][:, 0]
    np.testing.assert_allclose(twist[:3], (q.translation - p.translation) / (2 * h), atol=5e-5)
    turn = Rotation.from_matrix(q.rotation @ p.rotation.T).as_rotvec() / (2 * h)
    np.testing.assert_allclose(twist[3:], turn, atol=5e-5)
    speeds = [LAB.fields(params, s)["twist"][:3, 0] for s in (before, after)]
    bias = np.linalg.norm(speeds[1] - speeds[0]) / (2 * h)
    assert LAB.measure(params, now)["bias"] == pytest.approx(bias, rel=1e-4)


def test_a_slider_moves_the_arm_at_once_and_takes_the_target_along() -> None:
    params = parameters({"mode": "follow", "reach": 0.3})
    *_, state = states(params, 1.0)
    moved = params.change({"q1": 0.4})
    np.testing.assert_array_equal(LAB.measure(moved, state)["q"], moved.posture)
    after = LAB.step(moved, Inputs(), state)
    tip = (
        ForwardKinematics(params.arm.model, params.arm.tip).at(moved.posture).placement.translation
    )
    np.testing.assert_array_equal(after.anchor, tip)
    assert np.abs(after.q - moved.posture).max() < 1e-3
    stays = LAB.step(params.change({"mode": "posture"}), Inputs(), state)
    np.testing.assert_array_equal(stays.q, state.q)


def test_joints_stay_within_their_limits() -> None:
    params = parameters({"mode": "velocity", "robot": "scara", "dq1": 2.0, "dq2": -2.0, "dq3": 2.0})
    *_, end = states(params, 4.0)
    limits = params.arm.model.lowerPositionLimit, params.arm.model.upperPositionLimit
    np.testing.assert_array_equal(end.q[:3], [limits[1][0], limits[0][1], limits[1][2]])
    assert not LAB.fields(params, end)["twist"].any(), "at its end stops it stands still"
    back = LAB.fields(params.change({"dq3": -0.5}), end)["twist"][:, 0]
    np.testing.assert_array_equal(back, [0, 0, -0.5, 0, 0, 0])
    posed = parameters({"robot": "scara"}, lift=0.05, q3=2.0, q2=3.14).posture
    np.testing.assert_allclose(posed, [-0.4, 2.6, 0.05, -0.8])


def test_what_a_step_takes_in_is_left_alone() -> None:
    params = parameters(ARTICLE.settings["Damping tames it"])
    *_, state = states(params, 1.0)
    kept = copy.deepcopy(state)
    LAB.step(params, Inputs(handles={"target": (0.4, 0.2, 0.3)}), state)
    for name, value in vars(state).items():
        np.testing.assert_array_equal(value, getattr(kept, name))


@pytest.mark.parametrize("robot", ["ur5", "panda", "scara"])
def test_a_target_out_of_reach_is_said_to_be_and_how_near_one_gets(robot: str) -> None:
    """2 m away: the arm stretches towards it and rests at the distance that was named."""
    params = parameters({"mode": "follow", "damping": 0.02}, robot=robot)
    state = LAB.init(params, np.random.default_rng(0))
    assert "short" not in LAB.measure(params, state)
    for _ in range(1500):
        state = LAB.step(params, Inputs(handles={"target": (2.0, 0.0, 0.4)}), state)
    measured = LAB.measure(params, state)
    assert measured["short"] == pytest.approx(measured["error"], abs=2e-3)
    note = LAB.notes(params, state)["within_reach"]
    assert note.startswith("The target is out of reach")
    assert f"{measured['short']:.3f} m" in note
    for _ in range(20):  # and when it is brought back
        state = LAB.step(params, Inputs(handles={"target": (0.4, 0.1, 0.3)}), state)
    assert "short" not in LAB.measure(params, state)
    assert "out of reach" not in LAB.notes(params, state)["within_reach"]


def test_a_target_that_leaves_for_a_place_out_of_reach_says_so_at_once() -> None:
    params = parameters(ARTICLE.settings["Damping tames it"])
    state = LAB.init(params, np.random.default_rng(0))
    for _ in range(20):
        state = LAB.step(params, Inputs(), state)
    measured = LAB.measure(params, state)
    assert measured["error"] < 0.01
    assert measured["short"] == pytest.approx(0.09, abs=0.005)
    assert LAB.notes(params, state)["within_reach"].startswith("At the far end of its way")
    nearer = params.change({"reach": 0.1})
    for _ in range(20):
        state = LAB.step(nearer, Inputs(), state)
    assert "short" not in LAB.measure(nearer, state)
