"""What the article of the lab collocation claims, in numbers."""

import numpy as np
import pytest

from tests.labs.experiments import ArticleExperiments
from tests.labs.optimal_control.collocation.simulation import (
    Settings,
    params,
    readouts,
    solved,
    state,
    stop_reason,
)

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "collocation")
verify = EXPERIMENTS.verify


@verify("Gaps that close")
def test_gaps_close_quadratically(setting: Settings) -> None:
    history = state(solved(setting)).history
    largest = history.gaps.max(axis=1)
    assert history.iterations == 7
    assert largest[0] == pytest.approx(2.0, abs=0.05)
    assert largest[4:7] == pytest.approx([0.018, 0.0015, 0.00002], rel=0.1)
    assert largest[7] == pytest.approx(3e-9, rel=0.2)
    np.testing.assert_array_equal(history.alpha, 1.0)


@verify("Nearly empty")
def test_matrices_are_bands(setting: Settings) -> None:
    structure = state(solved(setting)).structure
    assert (structure.variables, structure.constraints) == (92, 64)
    assert structure.variables * structure.constraints == 5888
    assert structure.nonzeros == 304 == 10 * 30 + 4
    assert 100 * structure.density == pytest.approx(5.2, abs=0.05)
    assert 100 * structure.hessian_density == pytest.approx(7.5, abs=0.05)
    assert (structure.jacobian > 0.0).sum() == structure.nonzeros
    finer = state(solved({**setting, "steps": 60.0})).structure
    assert 100 * finer.density == pytest.approx(2.7, abs=0.05)
    assert 100 * finer.hessian_density == pytest.approx(3.8, abs=0.05)


@verify("Full and sparse")
def test_entries_grow_with_n_squared_and_nonzeros_with_n(setting: Settings) -> None:
    world = solved(setting)
    fields = world.lab.fields(world.params, world.state)
    np.testing.assert_allclose(fields["entry_slopes"], [2.0, 1.0], atol=0.05)
    assert fields["solve_times"].shape == (6, 2)
    assert (fields["solve_times"] > 0.0).all()
    assert "twice" in str(EXPERIMENTS.answer("Full and sparse"))


@verify("Twice as many steps")
def test_orders_are_two_two_and_four(setting: Settings) -> None:
    world = solved(setting)
    study = state(world).study
    np.testing.assert_array_equal(study.steps, [10, 20, 40, 80])
    gained = study.errors[1] / study.errors[2]
    np.testing.assert_allclose(gained, [4.0, 4.0, 16.0], rtol=0.12)
    np.testing.assert_allclose(study.orders, [2.0, 2.0, 4.0], atol=0.1)
    assert study.errors[1, 2] < study.errors[3, :2].min(), "20 steps against 80"
    assert world.lab.measure(world.params, world.state)["order"] == study.orders[2]
    assert EXPERIMENTS.answer("Twice as many steps") == "By a factor of 16."


@verify("No gaps, and yet wrong")
def test_a_coarse_plan_has_no_gaps_and_fails(setting: Settings) -> None:
    coarse = readouts(setting, 2.4)
    assert coarse["largest_gap"] < 1e-6
    assert coarse["missed_open"] == pytest.approx(0.37, abs=5e-3)
    assert coarse["missed"] < 0.004
    fine = readouts({**setting, "steps": 60.0}, 2.4)
    assert fine["missed_open"] == pytest.approx(0.18, abs=5e-3)
    better = readouts({**setting, "steps": 30.0, "scheme": "hermite-simpson"}, 2.4)
    assert better["missed_open"] == pytest.approx(0.02, abs=5e-3)


@verify("Multipliers are costates")
def test_multipliers_are_costates(setting: Settings) -> None:
    world = solved(setting)
    found, motion = state(world).costates, state(world).motion
    off = [_costate_error(setting, N) for N in (60.0, 30.0)]
    assert off == pytest.approx([0.008, 0.033], abs=5e-4)
    assert np.log2(off[1] / off[0]) == pytest.approx(2.0, abs=0.1)
    body, u_0 = params(world).task.mechanism, params(world).task.u_0[0]
    f_u = body.derivatives(motion.X[:-1], motion.U[:, 0])[2][:, 1, 0]
    u = -0.5 * u_0**2 * f_u * found.multipliers[:, 1]
    np.testing.assert_allclose(motion.U[:, 0, 0], u, atol=1e-8)
    assert EXPERIMENTS.answer("Multipliers are costates") == "All along."


def _costate_error(setting: Settings, N: float) -> float:
    found = state(solved({**setting, "steps": N})).costates
    p = np.array([np.interp(found.times, found.grid, along) for along in found.costate.T]).T
    off = np.abs(found.multipliers - p).max(axis=0) / np.abs(p).max(axis=0)
    return float(off.max())


@verify("As fast as possible")
def test_the_least_time_is_the_closed_form(setting: Settings) -> None:
    world = solved(setting)
    motion = state(world).motion
    assert pytest.approx(2.0, abs=1e-6) == motion.T
    np.testing.assert_allclose(motion.U[:15], 1.0, atol=1e-6)
    np.testing.assert_allclose(motion.U[15:], -1.0, atol=1e-6)
    assert params(world).task.goal == 1.0


@verify("Around a ball")
def test_the_tip_touches_the_ball(setting: Settings) -> None:
    clear = _depths(setting)
    assert np.abs(clear).min() < 1e-8
    assert (clear < 1e-6).sum() == 2
    assert clear.min() > -1e-6
    assert _depths({**setting, "obstacle": False}).min() == pytest.approx(-0.04, abs=5e-3)
    assert EXPERIMENTS.answer("Around a ball") == "It touches the ball."


def _depths(setting: Settings) -> np.ndarray:
    """The tip's distance from the surface at the grid points [m]."""
    world = solved(setting)
    ball = params(world).change({"obstacle": True}).ball
    tip = params(world).task.mechanism.tip
    places = [tip(x[:6]) for x in state(world).motion.X]
    assert ball
    return np.array([np.linalg.norm(place - ball.center) - ball.radius for place in places])


@verify("Too little time")
def test_what_cannot_be_done_is_infeasible(setting: Settings) -> None:
    world = solved(setting)
    assert stop_reason(world).startswith("Infeasible")
    assert state(world).failed
    assert state(world).history.violation[-1] > 0.5
    enough = solved({**setting, "horizon": 0.8})
    assert stop_reason(enough).startswith("Converged after 4 iterations")
    assert "infeasible" in str(EXPERIMENTS.answer("Too little time"))


def test_all_are_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
