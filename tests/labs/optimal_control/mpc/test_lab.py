"""What the world of the lab mpc must obey."""

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.lab import Inputs
from labs.optimal_control.mpc.controller import cost_terms, mpc_problem
from labs.optimal_control.mpc.params import MpcParams
from labs.optimal_control.mpc.plots import time_note
from labs.optimal_control.mpc.systems import controlled_system, dynamics, goal_posture
from labs.scene import NullScene
from tests.labs.optimal_control.mpc.simulation import begun, run, run_for


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("ur5", [0.35, -0.35, 0.3]),
        ("double-pendulum", [0.0, 0.4, 1.7]),
        ("double-pendulum", [0.0, 0.0, 2.25]),
    ],
)
def test_the_goal_has_the_tip_at_the_ball(name: str, target: list[float]) -> None:
    q = goal_posture(name, np.array(target))
    np.testing.assert_allclose(controlled_system(name).mechanism.tip(q), target, atol=1e-4)


@pytest.mark.parametrize(
    ("target", "off"), [((0.9, 0.9, 1.0), 0.6152), ((-0.9, -0.9, 0.05), 0.3235)]
)
def test_a_target_out_of_reach_is_approached_and_the_arm_rests(
    target: tuple[float, float, float], off: float
) -> None:
    """As near as its posture and the limits of the joints let it come."""
    names = ("target_x", "target_y", "target_z")
    found = run_for(dict(zip(names, target, strict=True)), 3.0)
    assert off - 1e-3 < found.last("miss") < off + 0.02
    assert np.abs(found.state.x[6:]).max() < 0.02
    assert found.last("failures") == 0


def test_the_goal_is_where_nothing_costs() -> None:
    params = MpcParams()
    at = mpc_problem(params, params.target)
    np.testing.assert_allclose(at.dynamics.step(at.x_ref, at.u_ref), at.x_ref, atol=1e-12)
    assert at.cost(np.tile(at.x_ref, (3, 1)), np.tile(at.u_ref, (2, 1))) == 0.0


def test_the_terms_add_up_to_the_running_cost() -> None:
    params = MpcParams(system="double-pendulum")
    at, rng = mpc_problem(params, params.target), np.random.default_rng(0)
    x, u = rng.standard_normal(4), rng.standard_normal(2)
    whole = at.cost(np.stack([x, at.x_ref]), u[None])
    assert cost_terms(params, params.target, x, u).sum() == pytest.approx(whole, rel=1e-12)


def test_a_period_of_several_steps_is_one_step_of_the_model() -> None:
    """The plant goes by the plan's own map, whatever the world's clock does in between."""
    world = begun({"system": "double-pendulum", "h": 0.04})
    start = world.state
    run(world, 0.04)
    model = dynamics("double-pendulum", 0.04)
    u = world.state.controller.u
    expected = model.step(start.x, u)
    np.testing.assert_array_equal(world.state.x, expected)


def test_plan_only_waits_and_act_only_plays_the_last_plan() -> None:
    world = begun({"system": "double-pendulum", "h": 0.02, "mode": "plan", "v_limit": 8.0})
    waited = run(world, 0.4)
    np.testing.assert_array_equal(waited.measured["q"], 0.0)
    assert waited.last("gap") < 1e-3, "iterations have improved the plan"
    plan = waited.state.controller.plan
    assert plan is not None
    world.change({"mode": "act"})
    played = run(world, 0.6)
    model, x = dynamics("double-pendulum", 0.02), np.zeros(4)
    for u in plan.U:
        x = model.step(x, u)
    np.testing.assert_allclose(played.state.x, x, atol=1e-12)
    assert played.last("iterations") == 0


def test_a_push_strikes_once() -> None:
    world = begun({})
    run(world, 1.5)
    lab, params = world.lab, world.params
    pushed = lab.step(params, Inputs(actions=("push",)), world.state)
    assert np.abs(pushed.x[6:]).max() > 0.1
    names = NullScene()
    lab.draw(names, params, pushed)
    assert "push" in names.names
    for _ in range(150):
        pushed = lab.step(params, Inputs(), pushed)
    assert float(lab.measure(params, pushed)["miss"]) < 1e-3


def test_limits_that_are_reached_are_lit_and_named() -> None:
    found = run_for({"v_limit": 1.0}, 0.3)
    scene = NullScene()
    found.world.lab.draw(scene, found.params, found.state)
    assert any(name.startswith("limits of joint") for name in scene.names)
    assert any(name.startswith("before") for name in scene.names), "the fan"
    assert "at the end of the horizon" in scene.names
    fields = found.world.lab.fields(found.params, found.state)
    assert fields["active_steps"][6:12].max() > 10


def test_handles_set_the_target_of_what_there_is() -> None:
    lab = find_lab("mpc").lab
    point = (0.31, -0.22, 0.44)
    edit = {name: lab.edit(MpcParams(system=name), "target", point) for name in
            ("ur5", "cart-pole", "double-pendulum")}  # fmt: skip
    assert edit["ur5"] == {"target_x": 0.31, "target_y": -0.22, "target_z": 0.44}
    assert edit["cart-pole"] == {"cart": -0.22}
    assert edit["double-pendulum"] == {"tip_y": -0.22, "tip_z": 0.44}
    assert lab.edit(MpcParams(), "obstacle", point)["obstacle_z"] == 0.44


def test_times_are_told_and_missed_deadlines_counted() -> None:
    spent = {
        "derivatives": np.full(4, 1e-3),
        "QP": np.array([2e-3] * 3 + [2e-2]),
        "rest": np.zeros(4),
    }
    note = time_note(spent, 0.01)
    assert "3.00 ms" in note
    assert "30 % of the period" in note
    assert "Of the last 4, 1 missed the deadline." in note


def test_what_runs_away_is_said() -> None:
    found = run_for({"system": "cart-pole", "h": 0.04, "delay": 10.0, "compensate": False}, 0.1)
    wild = found.state
    wild.hold_start = wild.hold_start + np.array([0.0, 0.0, 500.0, 0.0])
    after = found.world.lab.step(found.params, Inputs(), wild)
    assert after.trouble.startswith("The robot went out of control at t = ")


def test_a_horizon_too_short_to_swing_up_the_pole_is_said() -> None:
    """As the menu leaves it; a period of 20 ms is enough."""
    swung = {}
    for h in (0.01, 0.02):
        found = run_for({"system": "cart-pole", "h": h}, 4.0)
        said = found.world.lab.notes(found.params, found.state)["said"]
        assert ("Plans look 0.30 s ahead, too short" in said) == (h == 0.01)
        swung[h] = found.last("miss")
    assert swung[0.01] > 1.0
    assert swung[0.02] < 0.01
