"""The tracking lab: what its article claims, and what a user can do to it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from labs.algorithms.periodic_lqr import PeriodicRegulator
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.lqr_tracking.lab import LARGEST_DEVIATION, LqrTracking
from labs.optimal_control.lqr_tracking.params import TrackingParams
from labs.optimal_control.lqr_tracking.tracking import full_preview, limited_preview
from labs.params import Value
from labs.scene import NullScene
from tests.labs.experiments import ArticleExperiments

ENTRY = find_lab("lqr-tracking")
ARTICLE = ArticleExperiments("labs.optimal_control", "lqr_tracking")
Channels = Mapping[str, np.ndarray]


def recorded(
    seconds: float, setting: Mapping[str, Value], **changes: Value
) -> tuple[World, Channels]:
    """A world with what it recorded."""
    world = World(ENTRY, {**setting, **changes}, capacity=10_000)
    for _ in range(round(seconds / world.lab.period)):
        world.advance()
    assert not world.trouble
    return world, world.recording().channels


def params_of(world: World) -> TrackingParams:
    """The parameters of a world of this lab."""
    assert isinstance(world.params, TrackingParams)
    return world.params


def measured(world: World, channel: str) -> float:
    """What is measured now."""
    value = world.lab.measure(world.params, world.state)[channel]
    assert isinstance(value, float)
    return value


def lap_cost(setting: Mapping[str, Value], **changes: Value) -> float:
    """Of the robot, once settled."""
    world, channels = recorded(12.0, setting, **changes)
    assert world.t >= 2 * params_of(world).lap_time
    return float(channels["lap_cost"][-1])


def linear_plant_lap_cost(lasting: PeriodicRegulator) -> float:
    """What a lap costs there once settled, step by step."""
    problem, x = lasting.problem, np.zeros(lasting.problem.n)
    for _ in range(20):
        xs, us = problem.rollout(lasting.policy, x)
        x = xs[-1]
    free_end = replace(problem, q_final=np.zeros_like(problem.q_final))
    return free_end.cost(xs, us)


# What the article claims ----------------------------------------------------------------------


@ARTICLE.verify("The affine term carries the arm")
def test_the_affine_term_carries_the_arm(setting: Mapping[str, Value]) -> None:
    world, channels = recorded(9.0, setting)
    last = slice(-params_of(world).samples, None)
    error, ghost = channels["error"][last], channels["ghost_error"][last]
    assert error.max() < 0.008
    assert (ghost.min(), ghost.max()) == pytest.approx((0.056, 0.0735), abs=5e-4)
    k = channels["affine"][last, 1]
    assert (k.min(), k.max()) == pytest.approx((-27.1, -18.7), abs=0.1)
    torque = channels["u"][last, 1]
    assert np.abs(torque).max() == pytest.approx(24.5, abs=0.1)
    assert np.abs(channels["feedback"][last, 1]).max() < 0.15 * np.abs(torque).max()
    gain = world.lab.fields(world.params, world.state)["K_position"]
    assert gain[1, 1] == pytest.approx(-300.0, rel=0.1)
    _, cheaper = recorded(9.0, setting, effort_weight=0.1)
    assert cheaper["error"][last].max() < 1e-4
    assert ARTICLE.answer("The affine term carries the arm") == "The affine term $k_t$."


@ARTICLE.verify("A motion of the robot has no defect")
def test_a_motion_has_no_defect(setting: Mapping[str, Value]) -> None:
    _, channels = recorded(6.0, setting)
    assert np.abs(channels["affine"]).max() < 0.4
    assert 28.0 < np.abs(channels["u"]).max() < 29.0
    assert channels["error"].max() < 1e-3
    assert channels["ghost_error"].max() < 1e-3
    assert (
        ARTICLE.answer("A motion of the robot has no defect")
        == "It comes within 1 mm of the circle."
    )


@ARTICLE.verify("It moves before its reference does")
def test_it_moves_before_its_reference_does(setting: Mapping[str, Value]) -> None:
    world, channels = recorded(12.0, setting)
    p, ghost, p_ref = (channels[name] for name in ("p", "p_ghost", "p_ref"))
    jump = 500
    assert (p_ref[jump - 1], p_ref[jump]) == pytest.approx((0.4, -0.4))
    assert abs(p[jump]) < 0.01, "half way"
    assert 0.40 < ghost[jump] < 0.42, "still there"
    assert ghost[jump:].max() == pytest.approx(0.508, abs=2e-3)
    lean = np.degrees(channels["q"][:, 1]) - 180.0
    assert lean[jump - 25] == pytest.approx(6.1, abs=0.1)
    assert np.abs(channels["u"]).max() < 3.0
    blind, of_blind = recorded(12.0, setting, preview=0.0)
    assert np.abs(of_blind["u"]).max() == pytest.approx(27.8, abs=0.1)
    np.testing.assert_array_equal(blind.state.x, blind.state.ghost)
    now = world.lab.measure(world.params, world.state)
    assert now["lap_paid"] == pytest.approx(705, abs=0.5)
    assert now["ghost_lap_paid"] == pytest.approx(4671, abs=0.5)
    assert now["optimum"] == pytest.approx(703, abs=0.5)
    assert ARTICLE.answer("It moves before its reference does") == "half a second before."


@ARTICLE.verify("How far ahead is far enough")
def test_how_far_ahead_is_far_enough(setting: Mapping[str, Value]) -> None:
    costs = [lap_cost(setting, preview=n) for n in (0.0, 10.0, 20.0, 40.0, 60.0, 100.0)]
    np.testing.assert_allclose(costs, [4671, 3153, 1764, 802, 705, 702], atol=0.6)
    assert lap_cost(setting) == costs[2]
    along = TrackingParams.model_validate(setting).settings
    steps_ahead = {10: 31.3, 40: 9.3, 58: 2.2}
    for ahead, force in steps_ahead.items():
        np.testing.assert_allclose(limited_preview(along, 99 - ahead, 60).k, force, atol=0.1)


@ARTICLE.verify("A linear cost is another reference")
def test_a_linear_cost_is_another_reference(setting: Mapping[str, Value]) -> None:
    world, channels = recorded(12.0, setting)
    assert channels["p"][-1] == pytest.approx(-0.1, abs=2e-3)
    assert abs(channels["p_ghost"][-1]) < 1e-9
    assert channels["lap_cost"][-1] == pytest.approx(-150.0, abs=0.1)
    assert full_preview(params_of(world).settings).lap_cost == pytest.approx(-150.0, rel=1e-6)
    _, priced = recorded(12.0, setting, lean=0.0, price=10.0)
    assert 1e-5 < abs(priced["p"][-1]) < 1e-3
    assert ARTICLE.answer("A linear cost is another reference") == "It stops a little to the left."


@ARTICLE.verify("A wind it knows, a wind it does not")
def test_winds_known_and_unknown(setting: Mapping[str, Value]) -> None:
    world, channels = recorded(12.0, setting)
    gain = world.lab.fields(world.params, world.state)["K_position"]
    assert gain[0, 0] == pytest.approx(34.8, abs=0.05)
    assert channels["p"][-1] == pytest.approx(-5.0 / gain[0, 0], rel=1e-4)
    assert channels["p"][-1] == pytest.approx(-0.1436, abs=1e-4)
    world.change({"wind_known": True})
    for _ in range(600):
        world.advance()
    assert abs(measured(world, "p")) < 1e-3
    assert measured(world, "p_ghost") == pytest.approx(-0.1436, abs=1e-4)
    now = world.lab.measure(world.params, world.state)
    np.testing.assert_allclose(now["affine"], -5.0, atol=0.02)


@ARTICLE.verify("The bill is as foretold")
def test_the_bill_is_as_foretold(setting: Mapping[str, Value]) -> None:
    world, channels = recorded(9.0, setting)
    lasting = full_preview(params_of(world).settings)
    foretold = lasting.lap_cost
    assert foretold == pytest.approx(10.72, abs=5e-3)
    assert linear_plant_lap_cost(lasting) == pytest.approx(foretold, rel=1e-7)
    assert channels["lap_cost"][-1] == pytest.approx(foretold, rel=5e-4)
    assert channels["ghost_lap_cost"][-1] == pytest.approx(108.0, abs=0.5)
    wide, wider = recorded(9.0, setting, stroke=0.4)
    share = wider["lap_cost"][-1] / full_preview(params_of(wide).settings).lap_cost
    assert share == pytest.approx(1.0 - 0.007, abs=5e-4)
    _, laden = recorded(9.0, setting, payload=0.1)
    assert laden["lap_cost"][-1] == pytest.approx(10.44, abs=0.01)
    assert f"{foretold:.4g}" == f"{channels['lap_cost'][-1]:.4g}"
    assert ARTICLE.answer("The bill is as foretold") == 4


def test_every_experiment_is_verified() -> None:
    ARTICLE.check_all_are_verified()


# What a user can do ---------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["ur5", "cart-pole"])
def test_the_control_is_the_sum_of_its_parts(robot: str) -> None:
    _, channels = recorded(1.0, {"robot": robot, "path": "square", "feed_forward": "gravity"})
    parts = channels["feedback"] + channels["u_ref"] + channels["affine"]
    np.testing.assert_allclose(channels["u"], parts, atol=1e-12)
    assert np.abs(channels["affine"]).max() > 0.1


def test_a_push_moves_both_and_both_come_back() -> None:
    world, channels = recorded(3.0, {"feed_forward": "inverse-dynamics"})
    world.press("push")
    for _ in range(10):
        world.advance()
    hit = {name: measured(world, name) for name in ("error", "ghost_error")}
    for _ in range(290):
        world.advance()
    for name, error in hit.items():
        calm = channels[name][-1]
        assert error > 100.0 * calm
        assert measured(world, name) == pytest.approx(calm, rel=0.05), "two laps later"


def test_costs_are_counted_anew_for_new_weights() -> None:
    world, _ = recorded(4.0, {})
    assert "lap_paid" in world.lab.measure(world.params, world.state)
    world.change({"payload": 0.5})
    world.advance()
    assert "lap_paid" in world.lab.measure(world.params, world.state), "the policies are the same"
    world.change({"effort_weight": 30.0})
    world.advance()
    assert world.state.costs.shape == (2, 1)
    assert "lap_paid" not in world.lab.measure(world.params, world.state)


def test_a_new_period_keeps_the_phase() -> None:
    world, _ = recorded(1.0, {})
    before = world.lab.measure(world.params, world.state)
    world.change({"lap_time": 5.0})
    changed = world.lab.measure(world.params, world.state)
    np.testing.assert_allclose(changed["q_ref"], before["q_ref"], atol=0.02)
    for _ in range(round(2 / 3 * 250)):
        world.advance()
    assert world.state.phase == pytest.approx(0.0, abs=1 / 250)


def test_the_reference_stays_put_between_sizes_dragged() -> None:
    """Dragging the ball and the slider say the same, within its ends."""
    lab = LqrTracking()
    arm, cart = TrackingParams(), TrackingParams(robot="cart-pole")
    y, z = 0.10921554, 0.39155939
    assert lab.edit(arm, "size", (0.515, y + 0.1, z))["radius"] == pytest.approx(0.1, abs=1e-3)
    assert lab.edit(arm, "size", (3.0, 0.0, 0.0)) == {"radius": 0.2}
    assert lab.edit(cart, "size", (-0.1, -0.333, 0.75)) == {"stroke": 0.33}
    assert lab.edit(cart, "other", (0.0, 0.0, 0.0)) == {}


def test_who_is_lost_says_so_and_stops() -> None:
    world = World(ENTRY, {"robot": "cart-pole", "payload": 2.0})
    for _ in range(400):
        world.advance()
    assert world.trouble.startswith("Lost at t = ")
    assert "of the robot" in world.trouble
    q_ref = np.asarray(world.lab.measure(world.params, world.state)["q_ref"])
    assert np.abs(world.state.x[:2] - q_ref).max() < LARGEST_DEVIATION
    world.reset()
    assert not world.trouble


@pytest.mark.parametrize("robot", ["ur5", "cart-pole"])
@pytest.mark.parametrize("steps", [0.0, 60.0])
def test_what_is_in_view_is_drawn(robot: str, steps: float) -> None:
    world, _ = recorded(0.2, {"robot": robot, "preview": steps, "wind": 3.0})
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    always = {"robot", "ghost", "reference", "past", "ghost's past", "goal", "size", "force"}
    assert always <= set(scene.names)
    assert ("preview" in scene.names, "plan" in scene.names) == (steps > 0, steps > 0)
