"""The world of the lab lqr, its study, and what its plots show."""

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.lab import Inputs
from labs.optimal_control.lqr.comparison import HORIZON_COUNT
from labs.optimal_control.lqr.lab import PUSH_STEPS, Lqr
from labs.optimal_control.lqr.linear_systems import linear_system
from labs.optimal_control.lqr.params import LqrParams
from labs.optimal_control.lqr.region_of_attraction import GRID_POINTS, SYSTEM_CODES
from labs.plots import channel_names, field_names
from labs.scene import NullScene
from tests.labs.optimal_control.lqr.simulation import (
    LAB,
    deviations,
    largest_control,
    solved,
    states,
)
from tests.labs.solving import solve

# The world ------------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [0.01, 0.05, 0.2])
def test_the_policy_looks_once_in_a_step_and_holds(period: float) -> None:
    run = states(LqrParams(period=period), 1.0)
    controls = np.array([s.u[0] for s in run[1:]])
    looks = round(period / LAB.period)
    held = controls[: len(controls) // looks * looks].reshape(-1, looks)
    assert (held == held[:, :1]).all()
    assert (np.diff(held[:, 0]) != 0.0).all()


def test_a_window_uses_its_gains_in_turn_and_starts_over() -> None:
    params = LqrParams(policy="window", horizon=7.0, limits=False)
    run = states(params, 0.4)
    law, system = params.regulator, params.linear_system
    for look in range(20):
        before, after = run[2 * look], run[2 * look + 1]
        assert after.index == look % 7
        expected = law.gains[look % 7] @ (before.x - system.x_eq)
        np.testing.assert_allclose(after.u - system.u_eq, expected, rtol=1e-12)
        to_end = LAB.measure(params, after)["to_end"]
        assert to_end == pytest.approx((7 - look % 7) * 0.02)


def test_weights_are_dragged_while_it_runs() -> None:
    """The control of the very next look is that of the new weights; a new account is opened."""
    old, new = LqrParams(), LqrParams(r=1.0)
    state = states(old, 0.4)[-1]
    after = LAB.step(new, Inputs(), state)
    expected = new.regulator.gains[0] @ (state.x - new.linear_system.x_eq)
    np.testing.assert_allclose(after.u, expected, rtol=1e-12)
    assert after.past_cost == 0.0
    assert after.predicted_cost == pytest.approx(after.cost_to_go)


@pytest.mark.parametrize("system", ["cart-pole", "pendulum", "mass", "ur5"])
def test_a_push_is_answered(system: str) -> None:
    """From rest, pushed for 0.2 s: it moves, the force is drawn, and it comes back."""
    force = {"cart-pole": 2.0, "pendulum": 5.0, "mass": 5.0, "ur5": 60.0}[system]
    params = LqrParams(system=system, deviation=0.0, q_turn=100.0, r=0.01, push_force=force)
    run = states(params, 6.0, {10: Inputs(actions=("push",))})
    assert not run[-1].trouble
    dx = deviations(params, run)
    assert np.abs(dx[:10]).max() < 1e-9
    assert np.abs(dx).max() > 0.01
    assert np.abs(dx[-1]).max() < 0.1 * np.abs(dx).max()
    pushed = [k for k, s in enumerate(run) if s.force.any()]
    assert pushed == list(range(11, 11 + PUSH_STEPS))
    scene = NullScene()
    LAB.draw(scene, params, run[12])
    assert "force" in scene.names


def test_the_hand_pulls_the_tip_towards_the_ball() -> None:
    params = LqrParams(system="mass", deviation=0.0)
    pulled = Inputs(handles={"pull": (0.0, 0.3, 0.6)})
    run = states(params, 3.0, dict.fromkeys(range(300), pulled))
    stiffness = linear_system("mass").pull_stiffness
    assert run[1].force == pytest.approx([0.0, 0.3 * stiffness, 0.0], rel=0.01)
    dx = deviations(params, run)[-1]
    gain = params.regulator.gains[0][0]
    assert -gain[0] * dx[0] == pytest.approx(stiffness * (0.3 - dx[0]), rel=1e-3), "in balance"


def test_limits_cut_the_control_and_can_be_taken_away() -> None:
    cut, free = LqrParams(limit=3.0), LqrParams(limit=3.0, limits=False)
    assert largest_control(cut, states(cut, 0.5)) == 3.0
    assert largest_control(free, states(free, 0.5)) > 10.0
    ur5 = LqrParams(system="ur5", q_turn=10_000.0, r=1e-4)
    limit = linear_system("ur5").mechanism.control_limit
    run = states(ur5, 0.1)
    assert (np.abs(run[1].u) <= limit).all()
    assert (np.abs(run[1].u) == limit).any()


def test_off_its_rail_the_world_stops_and_says_so() -> None:
    run = states(LqrParams(deviation=1.5), 10.0)
    assert run[-1].trouble.startswith("At t = ")
    assert np.isfinite(run[-1].x).all()
    assert run[-1].steps == run[-2].steps, "the last sane state stays"


# What the plots show --------------------------------------------------------------------------


def test_every_channel_is_plotted_or_read_out() -> None:
    params = LqrParams()
    state = solved(params)
    shown = {name for plot in Lqr.plots for name in (*channel_names(plot), *field_names(plot))}
    given = {**LAB.measure(params, state), **LAB.fields(params, state)}
    assert shown - {"to_end"} == set(given)
    assert "to_end" in LAB.measure(params.change({"policy": "window"}), state)


@pytest.mark.parametrize("system", SYSTEM_CODES)
def test_the_region_holds_the_rest_and_is_found_row_by_row(system: str) -> None:
    params = LqrParams(system=system)
    state = LAB.init(params, np.random.default_rng(0))
    snapshots = list(LAB.solve(params, state))
    assert [s.progress for s in snapshots] == sorted(s.progress or 0.0 for s in snapshots)
    assert snapshots[-1].progress == 1.0
    assert snapshots[-1].done.startswith("Studied. Recursion and SciPy differ by ")
    for snapshot in snapshots[:GRID_POINTS]:
        state = LAB.accept(params, state, snapshot)
    assert set(np.unique(state.region)) <= {0, 1}
    middle = GRID_POINTS // 2
    assert state.region[middle, middle] == 1
    mirrored = state.region[::-1, ::-1]
    assert (state.region == mirrored).mean() > 0.99, "left is as right"
    found = LAB.fields(params, state)
    assert len(found["region_x"]) == (state.region == 1).sum()


def test_the_present_place_is_a_point_of_the_plane() -> None:
    params = LqrParams(deviation=0.2)
    run = states(params, 0.5)
    found = LAB.fields(params, run[-1])
    dx = deviations(params, run)
    np.testing.assert_allclose(found["path_x"], dx[:, 1])
    np.testing.assert_allclose(found["path_y"], dx[:, 3])
    assert found["now_x"] == pytest.approx([dx[-1, 1]])


def test_durations_are_kept_apart_and_the_shortest_counts() -> None:
    params = LqrParams()
    state = solved(params)
    assert set(state.seconds) == {"riccati", "at_once"}
    assert not {"riccati", "at_once"} & set(LAB.measure(params, state))
    every = [s.data for s in LAB.solve(params, state)]
    for name in ("riccati", "at_once"):
        known = np.array([data[name] for data in every])
        assert (known[-1] > 0.0).all()
        later = known[-2 * HORIZON_COUNT - 1 :]
        assert (np.diff(later, axis=0) <= 0.0).all(), "later rounds only shorten"


def test_the_study_is_the_same_every_time() -> None:
    for system in ("cart-pole", "ur5"):
        one, other = (World(find_lab("lqr"), {"system": system}) for _ in range(2))
        for world in (one, other):
            solve(world)
        np.testing.assert_array_equal(one.state.differences, other.state.differences)
        np.testing.assert_array_equal(one.state.region, other.state.region)


def test_without_a_policy_the_page_still_draws() -> None:
    params = LqrParams(q_slide=0.0)
    state = LAB.init(params, np.random.default_rng(0))
    assert state.trouble
    (only,) = LAB.solve(params, state)
    assert only.done == state.trouble
    state = LAB.accept(params, state, only)
    assert np.isfinite(LAB.fields(params, state)["gain"]).all()
    scene = NullScene()
    LAB.draw(scene, params, state)
    assert "system" in scene.names


def test_a_pendulum_pushed_past_a_full_turn_is_wound_back() -> None:
    """As the article says: a linear policy knows q, not q modulo 2 pi."""
    params = LqrParams(system="pendulum", deviation=0.0, limit=4.0, push_force=200.0)
    state = LAB.init(params, np.random.default_rng(0))
    turned = []
    for k in range(800):
        pushed = Inputs(("push",)) if k == 0 else Inputs()
        state = LAB.step(params, pushed, state)
        turned.append(float((state.x - params.linear_system.x_eq)[0]))
    assert not state.trouble
    assert 1.8 * 2 * np.pi < max(turned) < 2 * 2 * np.pi
    assert abs(turned[-1]) < 1e-3
