"""The lab statics: what its article claims, in numbers, and what its world must obey."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
import pytest

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.lab import Inputs
from labs.models.plant import plant
from labs.params import Value
from labs.reactive_control.statics.lab import FORCE_ARROW, Statics, StaticsState
from labs.reactive_control.statics.params import StaticsParams
from labs.scene import NullScene
from labs.tasks.arm.postures import POSED_ARMS, POSTURES
from tests.labs.experiments import ArticleExperiments

LAB = Statics()
ARTICLE = ArticleExperiments("labs.reactive_control", "statics")
EVERY = [(robot, name) for robot in POSED_ARMS for name in POSTURES]
Row = dict[str, np.ndarray]


def make_params(setting: Mapping[str, Value] = {}, **changes: Value) -> StaticsParams:
    return StaticsParams().change({**setting, **changes})


def start(params: StaticsParams) -> StaticsState:
    return LAB.init(params, np.random.default_rng(0))


def measured_at_start(setting: Mapping[str, Value], **changes: Value) -> Row:
    """All that is measured at the start."""
    params = make_params(setting, **changes)
    return {k: np.asarray(v) for k, v in LAB.measure(params, start(params)).items()}


# The experiments


@ARTICLE.verify("Thirty kilograms on a bent arm")
def test_a_load_on_a_bent_arm(setting: Mapping[str, Value]) -> None:
    tau = measured_at_start(setting)["tau"]
    assert tau[[0, 5]] == pytest.approx(0.0, abs=1e-9)
    assert tau[1:4] == pytest.approx([154, 145, 28.4], abs=0.5)
    limit = plant("ur5").arm.torque_limit
    assert limit[[1, 3]] == pytest.approx([150, 28])
    np.testing.assert_array_equal(np.abs(tau) > limit, [False, True, False, True, False, False])
    assert ARTICLE.answer("Thirty kilograms on a bent arm") == "The first and the last."


@ARTICLE.verify("Moving without power")
def test_moving_without_power(setting: Mapping[str, Value]) -> None:
    row = measured_at_start(setting)
    assert row["force"] == 300.0
    assert np.linalg.norm(row["twist"][:3]) > 1.0
    assert abs(row["joint_power"]) < 1e-8
    assert abs(row["tip_power"]) < 1e-8
    for k in range(1, 7):
        assert abs(measured_at_start(setting, **{f"dq{k}": -1.7})["tip_power"]) < 1e-7
    bent = measured_at_start(setting, q3=0.1)
    assert abs(bent["joint_power"]) > 1.0
    assert bent["joint_power"] == pytest.approx(bent["tip_power"], rel=1e-13)


@ARTICLE.verify("The same load on a straight arm")
def test_a_straight_arm_carries_for_nothing(setting: Mapping[str, Value]) -> None:
    row = measured_at_start(setting)
    assert row["force"] == 300.0
    np.testing.assert_allclose(row["tau"], 0.0, atol=1e-8)
    assert measured_at_start(setting, q3=0.3)["tau"][1:3] == pytest.approx([43, 43], abs=0.5)
    assert ARTICLE.answer("The same load on a straight arm") == "None."


@ARTICLE.verify("Across instead of along")
def test_across_instead_of_along(setting: Mapping[str, Value]) -> None:
    params = make_params(setting)
    tau = measured_at_start(setting)["tau"]
    assert np.abs(tau[1:3]) == pytest.approx([27, 14.6], abs=0.5)
    assert abs(tau[1]) / 30.0 == pytest.approx(0.91, abs=0.005)
    along = measured_at_start(setting, fx=300.0, fz=0.0)["effort"]
    assert along < 1e-8
    dearest, *_, cheapest = LAB.fields(params, start(params))["per_force"]
    assert (dearest, cheapest) == (pytest.approx(1.04, abs=0.005), pytest.approx(0.0, abs=1e-9))
    assert measured_at_start(setting)["arm_length"] == pytest.approx(dearest, rel=1e-3)
    assert ARTICLE.answer("Across instead of along") == "Far more."


@ARTICLE.verify("A moment looks the same from everywhere")
def test_a_moment_is_felt_along_each_axis(setting: Mapping[str, Value]) -> None:
    for changes in ({}, {"q2": 0.5}, {"q3": -0.7}):
        tau = measured_at_start(setting, **changes)["tau"]
        assert tau[0] == pytest.approx(25.0, abs=1e-9)
        assert tau[1:4] == pytest.approx([0.0] * 3, abs=1e-9)
    assert measured_at_start(setting)["tau"][5] == pytest.approx(-25.0, abs=0.01)
    assert abs(measured_at_start(setting, q2=0.5)["tau"][5] + 25.0) > 1.0
    assert ARTICLE.answer("A moment looks the same from everywhere") == "25 and −25 N·m"


def test_every_experiment_is_verified_here() -> None:
    ARTICLE.check_all_are_verified()


# tau = J^T w


@pytest.mark.parametrize(("robot", "posture"), EVERY)
def test_torque_is_what_virtual_work_says(robot: str, posture: str) -> None:
    """tau_i = f . dp/dq_i + m . (rotation per dq_i), by finite differences of the placement."""
    params = make_params(
        {"robot": robot, "posture": posture, "q1": 0.4, "q2": -0.3, "q4": 0.2, "q5": 0.9},
        **{"fx": 31.0, "fy": -47.0, "fz": 11.0, "mx": 3.0, "my": -7.0, "mz": 5.0},
    )
    world = plant(robot)
    data = world.model.createData()

    def placement(q: np.ndarray) -> pin.SE3:
        pin.framesForwardKinematics(world.model, data, q)
        return data.oMf[world.arm.tip].copy()

    d, expected = 1e-5, []
    for e in np.eye(world.model.nq):
        ahead, behind = placement(params.q + d * e), placement(params.q - d * e)
        moved = (ahead.translation - behind.translation) / (2 * d)
        turned = pin.log3(ahead.rotation @ behind.rotation.T) / (2 * d)
        expected.append(params.force @ moved + params.moment @ turned)
    found = LAB.measure(params, start(params))["tau"]
    np.testing.assert_allclose(found, expected, atol=1e-7)


@pytest.mark.parametrize("robot", POSED_ARMS)
def test_torque_holds_against_the_wrench(robot: str) -> None:
    """With -tau + g(q) at the joints and w at the end-effector nothing accelerates: Pinocchio
    takes w as a force on the last body, in its own frame, without any Jacobian."""
    params = make_params({"robot": robot, "fx": 20.0, "fy": 30.0, "mz": 4.0, "mx": -2.0, "q2": 0.3})
    world = plant(robot)
    model, data = world.model, world.model.createData()
    pin.framesForwardKinematics(model, data, params.q)
    frame = model.frames[world.arm.tip]
    tip = data.oMf[world.arm.tip]
    own = pin.Force(tip.rotation.T @ params.force, tip.rotation.T @ params.moment)
    forces = [pin.Force.Zero() for _ in range(model.njoints)]
    forces[frame.parentJoint] = frame.placement.act(own)
    tau = LAB.measure(params, start(params))["tau"]
    hold = pin.computeGeneralizedGravity(model, data, params.q) - tau
    a = pin.aba(model, data, params.q, np.zeros(model.nv), hold, forces)
    np.testing.assert_allclose(a, 0.0, atol=1e-9)


@pytest.mark.parametrize(("robot", "posture"), EVERY)
def test_the_two_powers_are_one(robot: str, posture: str) -> None:
    rng = np.random.default_rng(2)
    for _ in range(5):
        drawn = {f"dq{k}": float(rng.uniform(-2, 2)) for k in range(1, 8)}
        drawn |= {f"q{k}": float(rng.uniform(-1, 1)) for k in range(1, 8)}
        drawn |= {axis: float(rng.uniform(-300, 300)) for axis in ("fx", "fy", "fz")}
        drawn |= {axis: float(rng.uniform(-40, 40)) for axis in ("mx", "my", "mz")}
        row = measured_at_start({"robot": robot, "posture": posture}, **drawn)
        size = row["effort"] * np.sqrt(7 * 4.0)
        assert row["power_gap"] <= 1e-14 * size
        assert row["wrench"] @ row["twist"] == row["tip_power"]
        params = make_params({"robot": robot, "posture": posture, **drawn})
        assert row["tau"] @ params.dq == row["joint_power"]


@pytest.mark.parametrize("robot", POSED_ARMS)
def test_singular_values_bound_the_torque_of_a_force(robot: str) -> None:
    rng = np.random.default_rng(4)
    params = make_params({"robot": robot, "q2": 0.3})
    sigma = LAB.fields(params, start(params))["per_force"]
    assert (np.diff(sigma) <= 0.0).all()
    for _ in range(20):
        f = rng.uniform(-100, 100, 3)
        if robot == "double-pendulum":
            f[0] = 0.0  # across its plane the hinges' bearings carry everything
        row = measured_at_start({"robot": robot, "q2": 0.3, "fx": f[0], "fy": f[1], "fz": f[2]})
        assert sigma[-1] - 1e-12 <= row["arm_length"] <= sigma[0] + 1e-12


# The hand


def test_the_force_and_its_knobs_follow_the_handle() -> None:
    world = World(find_lab("statics"))
    world.change({"q2": 0.4})
    tip = plant("ur5").tip(world.params.q)  # type: ignore[attr-defined]
    x, y, z = map(float, tip + FORCE_ARROW * np.array([12.0, 90.4, -120.0]))
    world.hold("pull", (x, y, z))
    world.hold("pull", None)
    world.advance()
    assert [getattr(world.params, name) for name in ("fx", "fy", "fz")] == [12.0, 90.0, -120.0]
    wrench = world.lab.measure(world.params, world.state)["wrench"]
    np.testing.assert_allclose(np.asarray(wrench)[:3], [12.0, 90.0, -120.0])


def test_dragging_pulls_no_harder_than_the_sliders() -> None:
    assert LAB.edit(make_params(), "pull", (9.0, -9.0, 9.0)) == {
        "fx": 300.0,
        "fy": -300.0,
        "fz": 300.0,
    }
    assert LAB.edit(make_params(), "other", (9.0, 9.0, 9.0)) == {}


def test_the_handle_is_at_the_arrows_tip() -> None:
    class Places(NullScene):
        def arrow(self, name, start, end, color="force"):  # type: ignore[no-untyped-def]
            if name == "force":
                self.end = end

        def handle(self, name, position, radius=0.05):  # type: ignore[no-untyped-def]
            self.ball = position

    scene, params = Places(), make_params()
    LAB.draw(scene, params, start(params))
    np.testing.assert_array_equal(scene.end, scene.ball)
    tip = plant("ur5").tip(params.q)
    np.testing.assert_allclose(scene.ball - tip, FORCE_ARROW * params.force, atol=1e-15)


def test_time_passes_and_nothing_else() -> None:
    params = make_params()
    state = start(params)
    after = LAB.step(params, Inputs(), state)
    assert after.t == pytest.approx(LAB.period)
    assert state.t == 0.0
    before, now = LAB.measure(params, state), LAB.measure(params, after)
    assert all(np.array_equal(before[name], now[name]) for name in before)


def test_arcs_turn_the_way_the_torques_do() -> None:
    """A joint's arc is about its axis, positive with its torque, and red beyond the limit."""

    class Arcs(NullScene):
        def arc(self, name, center, axis, angle, radius, color="force"):  # type: ignore[no-untyped-def]
            arcs[name] = (np.asarray(center), np.asarray(axis), angle, color)

    params = make_params(ARTICLE.settings["Thirty kilograms on a bent arm"])
    arcs: dict[str, tuple[np.ndarray, np.ndarray, float, str]] = {}
    LAB.draw(Arcs(), params, start(params))
    assert set(arcs) == {"torque 2", "torque 3", "torque 4"}
    tip = plant("ur5").tip(params.q)
    for center, axis, angle, color in arcs.values():
        lever = np.cross(tip - center, params.force) @ axis
        assert np.sign(lever) == np.sign(angle)
        assert np.linalg.norm(axis) == pytest.approx(1.0)
        limit = 150.0 if center[2] < 0.6 and abs(lever) > 100 else 28.0
        assert color == ("warning" if abs(lever) > limit else "force")
