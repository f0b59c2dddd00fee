"""What the two clocks of the lab single-shooting must obey, and what its scene offers."""

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.single_shooting.lab import SingleShootingLab
from labs.optimal_control.single_shooting.params import SingleShootingParams
from labs.optimal_control.single_shooting.picture import STRIP_POSITIONS
from labs.optimal_control.single_shooting.plan import hold_after_divergence, interpolate_state
from labs.scene import NullScene
from labs.tasks.motion.player import REST_STEPS
from tests.labs.optimal_control.single_shooting.simulation import (
    Settings,
    fields,
    params,
    readouts,
    solve,
    solved,
    state,
    stop_reason,
)

# The solver's clock ---------------------------------------------------------------------------


def test_looking_back_shows_that_iteration() -> None:
    world = solved({})
    last = state(world).plan
    world.show(2)
    early = state(world)
    assert len(early.history.alpha) == 2
    assert np.abs(early.plan.U - last.U).max() > 1e-3
    assert early.clock == 0


def test_a_solve_that_stops_short_goes_on_warm() -> None:
    world = solved({"iterations": 5.0})
    assert stop_reason(world).startswith("Stopped short after 5 iterations")
    assert state(world).failed
    cost = state(world).history.cost[-1]
    world.change({"iterations": 100.0})
    solve(world)
    assert stop_reason(world).startswith("Converged")
    assert state(world).history.cost[0] == pytest.approx(cost, rel=1e-12)


def test_a_solve_that_failed_is_begun_anew() -> None:
    world = solved({"limited": True, "limit": 0.2})
    assert stop_reason(world).startswith("Infeasible")
    world.change({"limited": False})
    solve(world)
    assert stop_reason(world) == stop_reason(solved({}))


@pytest.mark.parametrize("objective", ["least-time", "least-energy", "fastest-end"])
@pytest.mark.parametrize("system", ["double-pendulum", "ur5"])
def test_a_system_that_is_chosen_brings_a_horizon_and_a_guess_that_work(
    system: str, objective: str
) -> None:
    world = World(find_lab("single-shooting"), {"objective": objective})
    world.change({"system": system})
    solve(world)
    assert stop_reason(world).startswith("Converged")
    world.change({"system": "mass"})
    assert world.params == SingleShootingParams(system="mass", objective=objective)
    world.change({"system": system, "horizon": 3.0})
    assert params(world).horizon == 3.0


@pytest.mark.parametrize("changes", [{"pieces": 30.0}, {"horizon": 2.1}, {"limited": True}])
def test_a_warm_start_fits_another_problem(changes: Settings) -> None:
    world = solved({})
    before = state(world)
    world.change(changes)
    solve(world)
    assert stop_reason(world).startswith("Converged")
    assert state(world).plan.N == params(world).N
    if "limited" in changes:
        assert state(world).history.cost[0] == pytest.approx(before.history.cost[-1], rel=1e-9)


def test_a_diverging_guess_keeps_the_plan_and_says_where() -> None:
    wild: Settings = {"system": "double-pendulum", "integrator": "explicit-euler", "horizon": 4.0}
    world = solved({**wild, "pieces": 10.0, "steps": 1.0, "guess": 0.0, "iterations": 1.0})
    plan = state(world).plan
    world.change({"start": "cold", "guess": 1.0})
    solve(world)
    assert stop_reason(world).startswith("The first guess diverges in step ")
    assert state(world).plan is plan
    assert state(world).failed
    world.advance()
    assert not world.trouble


@pytest.mark.parametrize("preset", ["Cart-pole", "Double pendulum"])
def test_the_larger_swing_ups_arrive(preset: str) -> None:
    world = solved(SingleShootingLab.presets[preset])
    assert stop_reason(world).startswith("Converged")
    assert readouts(world)["missed"] < 0.1


@pytest.mark.parametrize("changes", [{}, {"obstacle": True}, {"objective": "least-time"}])
def test_the_ur5_reaches_where_its_target_is_dragged(changes: Settings) -> None:
    world = solved({**SingleShootingLab.presets["UR5 reach"], **changes})
    assert stop_reason(world).startswith("Converged")
    assert readouts(world)["missed"] < 1e-3
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert "target" in scene.names
    assert ("obstacle" in scene.names) == ("obstacle" in changes)
    assert np.isfinite(fields(world)["changed"]).all()
    world.change(world.lab.edit(world.params, "target", (0.35, -0.25, 0.3)))
    solve(world)
    assert stop_reason(world).startswith("Converged")
    assert readouts(world)["missed"] < 1e-3


# The world's clock ----------------------------------------------------------------------------


def test_the_motion_is_played_rests_and_starts_over() -> None:
    world = solved({"horizon": 0.5, "system": "mass"})
    T = state(world).plan.T
    for _ in range(25):
        world.advance()
    q = world.lab.measure(world.params, world.state)["q"]
    np.testing.assert_allclose(q, interpolate_state(state(world).plan.simulated, T, 0.25)[:1])
    for _ in range(25 + REST_STEPS):
        world.advance()
    at_rest = world.lab.measure(world.params, world.state)["q"]
    np.testing.assert_allclose(at_rest, 1.0, atol=1e-6)
    world.advance()
    assert state(world).clock == 0


def test_the_map_grows_with_the_first_motion_and_stays() -> None:
    world = solved({"horizon": 0.5, "system": "mass"})
    rows = []
    for _ in range(60):
        world.advance()
        rows.append(int(np.isfinite(fields(world)["influence"]).any(axis=1).sum()))
    assert rows[0] == 0
    assert rows == sorted(rows)
    assert rows[25] == 10
    assert rows[-1] == 20
    world.change({"limit": 1.0})
    solve(world)
    assert np.isfinite(fields(world)["influence"]).any(axis=1).sum() == 20


def test_a_regulator_keeps_the_robot_to_a_plan_that_is_a_little_wrong() -> None:
    world = solved({"steps": 1.0})
    alone = readouts(world)["missed"]
    world.change({"feedback": True})
    plan = state(world).plan
    assert readouts(world)["missed"] < 0.2 * alone
    assert np.abs(plan.tracked_U - plan.U).max() > 1e-3
    u = world.lab.measure(world.params, world.state)["u"]
    np.testing.assert_array_equal(u, plan.tracked_U[0])
    exact = solved({"system": "mass", "feedback": True})
    plan = state(exact).plan
    np.testing.assert_allclose(plan.tracked, plan.simulated, atol=1e-9)


# What one control does ------------------------------------------------------------------------


def test_the_ball_chooses_a_control_and_its_change() -> None:
    world = solved({"delta": 0.25, "piece": 8.0})
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert {"robot", "ghost", "plan", "changed", "fan 1", "control"} <= set(scene.names)
    lab, at = SingleShootingLab(), SingleShootingParams()
    _, y, z = STRIP_POSITIONS[at.task.motion]
    assert lab.edit(at, "control", (0.0, y + 0.01, z + 0.12)) == {"piece": 1.0, "delta": 1.0}
    assert lab.edit(at, "control", (0.0, y + 0.79, z - 0.06)) == {"piece": 20.0, "delta": -0.5}
    assert lab.edit(at, "control", (0.0, 9.0, 9.0)) == {"piece": 20.0, "delta": 2.0}
    assert lab.edit(at, "other", (0.0, 0.0, 0.0)) == {}


def test_a_change_leaves_what_came_before_it_and_sensitivities_forecast_small_ones() -> None:
    world = solved({"delta": 0.01, "piece": 8.0})
    found, plan = fields(world), state(world).plan
    begin = 7 * plan.M
    np.testing.assert_array_equal(found["changed"][: begin + 1], found["planned"][: begin + 1])
    np.testing.assert_allclose(found["changed"], found["forecast"], atol=2e-3)
    assert np.abs(found["changed"] - found["planned"]).max() > 0.05
    slope = (found["end_forecast"][-1] - found["end_forecast"][0]) / 4.0
    assert abs(slope) <= plan.influence[-1, 7]


def test_without_a_change_the_iterations_before_are_drawn() -> None:
    world = solved({"delta": 0.0})
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert any(name.startswith("before") for name in scene.names)
    assert "changed" not in scene.names


def test_what_diverges_rests_where_it_was_last() -> None:
    X = np.array([[0.0, 1.0], [2.0, 3.0], [np.inf, 0.0], [np.nan, np.nan]])
    np.testing.assert_array_equal(hold_after_divergence(X), X[[0, 1, 1, 1]])
    np.testing.assert_array_equal(hold_after_divergence(X[:2]), X[:2])
