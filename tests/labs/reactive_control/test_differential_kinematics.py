"""The lab differential-kinematics: what its article claims, in numbers, and what it draws."""

import copy
import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib.resources import files

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from labs.algorithms.inverse_kinematics import METHODS
from labs.algorithms.jacobian import Kinematics
from labs.lab import Inputs
from labs.models.arms import load
from labs.params import Value
from labs.reactive_control.differential_kinematics import (
    COLUMN,
    FORCE_BALL,
    NEAR,
    VELOCITY_BALL,
    DifferentialKinematics,
    DifferentialParams,
    DifferentialState,
)
from labs.scene import Color, NullScene

LAB = DifferentialKinematics()
ARTICLE = files("labs.reactive_control").joinpath("differential_kinematics.md").read_text("utf-8")
EXPERIMENTS: Mapping[str, Mapping[str, Value]] = {
    block["title"]: block["set"]
    for block in map(tomllib.loads, re.findall(r"```experiment\n(.*?)```", ARTICLE, re.DOTALL))
}
VERIFIED: set[str] = set()


def experiment(title: str) -> pytest.MarkDecorator:
    """Marks the test that verifies this experiment and gives it the experiment's settings."""
    VERIFIED.add(title)
    return pytest.mark.parametrize("setting", [EXPERIMENTS[title]], ids=[title])


def with_(setting: Mapping[str, Value], **changes: Value) -> DifferentialParams:
    return DifferentialParams().change({**setting, **changes})


def start(params: DifferentialParams) -> DifferentialState:
    return LAB.init(params, np.random.default_rng(0))


def states(
    params: DifferentialParams, seconds: float, inputs: Inputs | None = None
) -> Iterator[DifferentialState]:
    state = start(params)
    yield state
    for _ in range(round(seconds / LAB.period)):
        state = LAB.step(params, inputs or Inputs(), state)
        yield state


@lru_cache
def recorded(params: DifferentialParams, seconds: float) -> Mapping[str, np.ndarray]:
    """All measured channels at every step from t = 0 on."""
    rows = [LAB.measure(params, state) for state in states(params, seconds)]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def channel(params: DifferentialParams, name: str, seconds: float) -> np.ndarray:
    """One of them."""
    return recorded(params, seconds)[name]


def fields(setting: Mapping[str, Value], **changes: Value) -> Mapping[str, np.ndarray]:
    params = with_(setting, **changes)
    return LAB.fields(params, start(params))


def sigma_min(setting: Mapping[str, Value], **changes: Value) -> float:
    return float(fields(setting, **changes)["sigma"][-1])


class Arrows(NullScene):
    """Remembers what an arrow, an arc or an ellipsoid was drawn with."""

    def __init__(self, setting: Mapping[str, Value], **changes: Value) -> None:
        super().__init__()
        self.vectors: dict[str, np.ndarray] = {}
        self.axes: dict[str, np.ndarray] = {}
        params = with_(setting, **changes)
        LAB.draw(self, params, start(params))

    def arrow(self, name: str, start: ArrayLike, end: ArrayLike, color: Color = "force") -> None:
        super().arrow(name, start, end, color)
        self.vectors[name] = np.array([start, end])

    def ellipsoid(
        self, name: str, center: ArrayLike, axes: np.ndarray, color: Color = "actual"
    ) -> None:
        super().ellipsoid(name, center, axes, color)
        self.axes[name] = axes


# The experiments


@experiment("A lever from the base")
def test_only_the_horizontal_part_of_the_lever_counts(setting: Mapping[str, Value]) -> None:
    assert with_(setting).rates.tolist() == [0.5, 0, 0, 0, 0, 0]
    arm = load("ur5")
    chain = Kinematics(arm.model, arm.tip).at(arm.home)
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


@experiment("A joint that slides")
def test_the_column_of_a_slide_never_changes(setting: Mapping[str, Value]) -> None:
    before = fields(setting)
    np.testing.assert_array_equal(before["twist"][:, 0], [0, 0, 0.2, 0, 0, 0])
    for changes in ({"q2": 0.6}, {"q1": -1.0}, {"lift": 0.1}):
        after = fields(setting, **changes)["geometric"]
        np.testing.assert_array_equal(after[:, 2], [0, 0, 1, 0, 0, 0])
        assert np.any(after != before["geometric"]) == ("lift" not in changes)


@experiment("A calm turn, racing angles")
def test_the_angles_race(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    omega, rpy = (channel(params, name, 3.1) for name in ("omega", "rpy"))
    np.testing.assert_allclose(omega, 1.0, rtol=1e-12)
    assert rpy.max() == pytest.approx(7.0, abs=0.05)
    assert rpy.argmax() * LAB.period == pytest.approx(1.57, abs=0.02)
    steepest = list(states(params, 1.57))[-1]
    placement = Kinematics(params.arm.model, params.arm.tip).at(steepest.q).placement
    pitch = Rotation.from_matrix(placement.rotation).as_euler("ZYX")[1]
    assert np.pi / 2 - abs(pitch) == pytest.approx(0.2, abs=0.002)
    assert rpy.max() <= 1 / np.sqrt(1 - abs(np.sin(pitch)))
    nearer = channel(with_(setting, q4=0.05), "rpy", 3.1)
    assert nearer.max() / rpy.max() == pytest.approx(4.0, abs=0.05)
    difference = LAB.fields(params, steepest)["difference"]
    assert not difference[:3].any()
    assert np.abs(difference[3:]).max() > 4.0


@experiment("When the two agree")
def test_about_one_axis_they_agree(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    for state in list(states(params, 2.0))[::20]:
        found = LAB.fields(params, state)
        np.testing.assert_allclose(found["difference"], 0.0, atol=1e-14)
        assert found["twist"][5, 0] == pytest.approx(0.3 - 0.5 + 0.8, rel=1e-12)
    assert np.abs(fields({})["difference"]).max() > 0.9


@experiment("Fast or strong")
def test_what_is_slow_is_strong(setting: Mapping[str, Value]) -> None:
    assert sigma_min(setting) == pytest.approx(0.013, abs=5e-4)
    drawn = Arrows(setting)
    assert {"warning", "singular"} <= set(drawn.names)
    slow, strong = drawn.axes["velocities"], drawn.axes["forces"]
    weakest = np.linalg.norm(slow, axis=0).argmin()
    assert weakest == np.linalg.norm(strong, axis=0).argmax()
    params = with_(setting)
    chain = Kinematics(params.arm.model, params.arm.tip).at(start(params).q)
    along = chain.placement.translation - chain.points[1]
    direction = strong[:, weakest] / np.linalg.norm(strong[:, weakest])
    assert abs(direction @ along) / np.linalg.norm(along) == pytest.approx(0.99, abs=0.002)
    bent = Arrows(setting, q3=-0.6)
    assert "warning" not in bent.names
    for name in ("velocities", "forces"):
        thinness = [np.linalg.cond(which.axes[name]) for which in (drawn, bent)]
        assert thinness[1] < 0.75 * thinness[0]


@experiment("The base does not matter")
def test_turning_the_base_turns_all_columns(setting: Mapping[str, Value]) -> None:
    assert sigma_min(setting) == pytest.approx(0.298, abs=5e-4)
    turned, home = fields(setting), fields({})
    np.testing.assert_allclose(turned["sigma"], home["sigma"], rtol=1e-13)
    turn = Rotation.from_rotvec([0.0, 0.0, 1.2]).as_matrix()
    for rows in (slice(0, 3), slice(3, 6)):
        expected = turn @ home["geometric"][rows]
        np.testing.assert_allclose(turned["geometric"][rows], expected, atol=1e-14)
    assert abs(sigma_min(setting, q3=-1.0) - 0.298) > 0.05


@experiment("Out of reach with the pseudo-inverse")
def test_the_pseudo_inverse_blows_up(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
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


@experiment("Damping tames it")
def test_damping_tames_it(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    speed, error = channel(params, "speed", 8.0), channel(params, "error", 8.0)
    assert speed.max() == pytest.approx(2.1, abs=0.05)
    assert speed.max() < 2.2
    assert np.all(speed <= channel(params, "bound", 8.0) * (1 + 1e-12))
    assert speed[350:450].max() < 0.25, "it rests"
    exact = channel(with_(setting, method="pseudo-inverse"), "error", 8.0)
    assert error.max() == pytest.approx(0.09, abs=0.005)
    assert error.max() <= exact.max() < 0.12
    assert 1e3 * error[250] == pytest.approx(12, abs=0.5)
    assert 1e3 * exact[250] == pytest.approx(0.2, abs=0.02)
    heavy = channel(with_(setting, damping=0.5), "error", 8.0)
    assert heavy[-1] == pytest.approx(0.18, abs=0.005)


@experiment("The transpose never inverts")
def test_the_transpose_lags_but_arrives(setting: Mapping[str, Value]) -> None:
    params = with_(setting)
    assert channel(params, "error", 8.0).max() == pytest.approx(0.31, abs=0.006)
    assert channel(params, "speed", 8.0).max() < 0.25
    assert channel(params, "sigma_min", 8.0).max() ** 2 < 0.1
    *_, behind = states(params, 4.0)
    resting, errors = with_(setting, reach=0.0, gain=50.0), []
    state = behind
    kinematics = Kinematics(params.arm.model, params.arm.tip)
    for _ in range(2000):
        state = LAB.step(resting, Inputs(), state)
        tip = kinematics.at(state.q).placement.translation
        errors.append(float(np.linalg.norm(state.anchor - tip)))
    assert errors[0] > 0.1
    assert max(np.diff(errors)) < 1e-12
    assert errors[-1] < 1e-6


def test_every_experiment_is_verified_here() -> None:
    assert set(EXPERIMENTS) == VERIFIED
    assert len(EXPERIMENTS) >= 6


# The world's laws


@pytest.mark.parametrize("robot", ["ur5", "panda", "scara"])
@pytest.mark.parametrize("method", METHODS)
def test_a_dragged_target_is_reached(robot: str, method: str) -> None:
    params = with_({"mode": "follow"}, robot=robot, method=method, gain=50.0)
    begin = start(params)
    at = begin.anchor + np.array([-0.05, 0.08, 0.03])
    *_, end = states(params, 10.0, Inputs(handles={"target": tuple(at)}))
    tip = Kinematics(params.arm.model, params.arm.tip).at(end.q).placement.translation
    np.testing.assert_allclose(tip, at, atol=1e-6)
    released = LAB.step(params, Inputs(), end)
    np.testing.assert_array_equal(released.anchor, at)


def test_the_pose_task_keeps_the_orientation() -> None:
    for task, kept in (("pose", True), ("position", False)):
        params = with_({"mode": "follow", "reach": 0.2}, task=task, robot="panda")
        path = list(states(params, 4.0))
        kinematics = Kinematics(params.arm.model, params.arm.tip)
        turns = [kinematics.at(s.q).placement.rotation @ path[0].facing.T for s in path]
        largest = max(Rotation.from_matrix(turn).magnitude() for turn in turns)
        assert (largest < 0.02) == kept


@pytest.mark.parametrize("robot", ["ur5", "panda", "scara"])
def test_the_twist_is_how_the_arm_moves(robot: str) -> None:
    """Central differences of the pose over two steps at constant joint velocities, and of the
    velocity for what is left of the acceleration."""
    params = with_({"mode": "velocity"}, robot=robot, dq1=0.6, dq2=-0.4, dq3=0.05, dq4=0.7)
    before, now, after = list(states(params, 0.02))
    kinematics, h = Kinematics(params.arm.model, params.arm.tip), LAB.period
    p, q = (kinematics.at(s.q).placement for s in (before, after))
    twist = LAB.fields(params, now)["twist"][:, 0]
    np.testing.assert_allclose(twist[:3], (q.translation - p.translation) / (2 * h), atol=5e-5)
    turn = Rotation.from_matrix(q.rotation @ p.rotation.T).as_rotvec() / (2 * h)
    np.testing.assert_allclose(twist[3:], turn, atol=5e-5)
    speeds = [LAB.fields(params, s)["twist"][:3, 0] for s in (before, after)]
    bias = np.linalg.norm(speeds[1] - speeds[0]) / (2 * h)
    assert LAB.measure(params, now)["bias"] == pytest.approx(bias, rel=1e-4)


def test_a_slider_moves_the_arm_at_once_and_takes_the_target_along() -> None:
    params = with_({"mode": "follow", "reach": 0.3})
    *_, state = states(params, 1.0)
    moved = params.change({"q1": 0.4})
    np.testing.assert_array_equal(LAB.measure(moved, state)["q"], moved.posture)
    after = LAB.step(moved, Inputs(), state)
    tip = Kinematics(params.arm.model, params.arm.tip).at(moved.posture).placement.translation
    np.testing.assert_array_equal(after.anchor, tip)
    assert np.abs(after.q - moved.posture).max() < 1e-3
    stays = LAB.step(params.change({"mode": "posture"}), Inputs(), state)
    np.testing.assert_array_equal(stays.q, state.q)


def test_joints_stay_within_their_limits() -> None:
    params = with_({"mode": "velocity", "robot": "scara", "dq1": 2.0, "dq2": -2.0, "dq3": 2.0})
    *_, end = states(params, 4.0)
    limits = params.arm.model.lowerPositionLimit, params.arm.model.upperPositionLimit
    np.testing.assert_array_equal(end.q[:3], [limits[1][0], limits[0][1], limits[1][2]])
    assert not LAB.fields(params, end)["twist"].any(), "at its end stops it stands still"
    back = LAB.fields(params.change({"dq3": -0.5}), end)["twist"][:, 0]
    np.testing.assert_array_equal(back, [0, 0, -0.5, 0, 0, 0])
    posed = with_({"robot": "scara"}, lift=0.05, q3=2.0, q2=3.14).posture
    np.testing.assert_allclose(posed, [-0.4, 2.6, 0.05, -0.8])


def test_what_a_step_takes_in_is_left_alone() -> None:
    params = with_(EXPERIMENTS["Damping tames it"])
    *_, state = states(params, 1.0)
    kept = copy.deepcopy(state)
    LAB.step(params, Inputs(handles={"target": (0.4, 0.2, 0.3)}), state)
    for name, value in vars(state).items():
        np.testing.assert_array_equal(value, getattr(kept, name))


# Drawings


def test_columns_are_drawn_as_they_are() -> None:
    for robot, n in (("ur5", 6), ("panda", 7), ("scara", 4)):
        drawn, found = Arrows({}, robot=robot), fields({}, robot=robot)["geometric"]
        assert sum(name.startswith("axis") for name in drawn.vectors) == n
        for name, (tail, head) in drawn.vectors.items():
            if name.startswith("column"):
                column = found[:3, int(name.split()[1]) - 1]
                np.testing.assert_allclose(head - tail, COLUMN * column, atol=1e-14)
    single = Arrows({}, columns="2")
    assert {"axis 2", "column 2", "lever"} <= set(single.names)
    assert "axis 1" not in single.names
    of_elbow = Arrows({}, frame="joint-3")
    assert {"axis 1", "axis 2", "axis 3"} <= set(of_elbow.names)
    assert "axis 4" not in of_elbow.names


def test_ellipsoids_hold_all_velocities_and_forces_of_unit_effort() -> None:
    drawn, linear = Arrows({}, ellipsoid="both"), fields({})["geometric"][:3]
    rng = np.random.default_rng(4)
    for _ in range(100):
        rates = rng.normal(size=6)
        velocity = VELOCITY_BALL * linear @ (rates / np.linalg.norm(rates))
        assert np.linalg.norm(np.linalg.solve(drawn.axes["velocities"], velocity)) <= 1 + 1e-12
        force = rng.normal(size=3)
        force *= FORCE_BALL / np.linalg.norm(linear.T @ force)
        on = np.linalg.norm(np.linalg.solve(drawn.axes["forces"], force))
        assert on == pytest.approx(1.0, rel=1e-12)


def test_the_warning_stands_where_the_distance_is_small() -> None:
    for q4 in np.linspace(-2.0, 1.0, 16):
        setting: dict[str, Value] = {"q2": 0.7, "q3": -1.55, "q4": round(float(q4), 2)}
        near = sigma_min(setting) < NEAR
        assert ("warning" in Arrows(setting).names) == near


def test_a_wrist_aligned_is_singular_for_poses_only() -> None:
    preset = LAB.presets["Wrist of the UR5 aligned"]
    assert sigma_min(preset) < 1e-3
    assert sigma_min(preset, task="position") > 0.2


@pytest.mark.parametrize("robot", ["ur5", "panda", "scara"])
def test_a_target_out_of_reach_is_said_to_be_and_how_near_one_gets(robot: str) -> None:
    """2 m away: the arm stretches towards it and rests at the distance that was named."""
    params = with_({"mode": "follow", "damping": 0.02}, robot=robot)
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
    params = with_(EXPERIMENTS["Damping tames it"])
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
