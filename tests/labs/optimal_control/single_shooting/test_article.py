"""What the article of the lab single-shooting claims, in numbers."""

import numpy as np
import pytest

from labs.models.mechanisms import mechanism
from labs.resumable import run_to_completion
from tests.labs.experiments import ArticleExperiments
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

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "single_shooting")
verify = EXPERIMENTS.verify


@verify("Change one control")
def test_the_first_control_swings_the_end_about(setting: Settings) -> None:
    world = solved(setting)
    assert stop_reason(world).startswith("Converged")
    plan = state(world).plan
    assert plan.N == 20
    assert pytest.approx(0.1) == plan.T / plan.N
    off = fields(world)["chosen_end"][0] - np.pi
    assert off == pytest.approx(2.5, abs=0.05)
    assert off > np.pi / 2
    world.change({"piece": 20.0})
    assert fields(world)["chosen_end"][0] - np.pi == pytest.approx(0.075, abs=1e-3)
    at_the_end = plan.influence[-1]
    assert np.argmin(at_the_end) == 3, "the fourth"
    assert at_the_end[3] < 0.01 * at_the_end[0]
    v = plan.X[:: plan.M, 1]
    assert (np.diff(np.sign(v[3:6])) != 0).any(), "it is being turned round"
    assert EXPERIMENTS.answer("Change one control") == "More than a quarter turn from it."


@verify("Upright, they explode")
def test_upright_every_second_counts_220_fold(setting: Settings) -> None:
    plan = state(solved(setting)).plan
    effect = plan.influence[:, 0]
    assert effect[-1] == pytest.approx(148, abs=1)
    assert effect[-1] / effect[10] == pytest.approx(15, abs=0.1)
    assert EXPERIMENTS.answer("Upright, they explode") == 15
    at_rest = np.array([[np.pi, 0.0]])
    rate = np.linalg.eigvals(mechanism("pendulum").derivatives(at_rest, np.zeros((1, 1)))[1][0])
    assert rate.real.max() == pytest.approx(5.4, abs=0.03)
    assert np.exp(rate.real.max()) == pytest.approx(220, rel=0.05)
    assert plan.X[0, 0] == pytest.approx(np.pi - 0.1)


@verify("A tangent is short-lived")
def test_the_tangent_promises_too_much(setting: Settings) -> None:
    world = solved(setting)
    plan, found = state(world).plan, fields(world)
    assert found["chosen_end"][0] - plan.X[-1, 0] == pytest.approx(5.2, abs=0.05)
    assert found["forecast"][-1] - plan.X[-1, 0] == pytest.approx(13, abs=0.5)
    assert EXPERIMENTS.answer("A tangent is short-lived") == 5.2
    for delta, least, most in ((0.1, 0.1, 0.2), (0.3, 0.3, 1.0)):
        world.change({"delta": delta})
        found = fields(world)
        truth, forecast = found["changed"][-1] - np.pi, found["forecast"][-1] - np.pi
        assert least < 1.0 - truth / forecast < most, "how far the tangent is off"


@verify("One second more")
def test_two_seconds_of_balance_are_too_much(setting: Settings) -> None:
    one, more, two = (solved({**setting, "horizon": T}) for T in (1.0, 1.5, 2.0))
    counts = [readouts(world)["iteration"] for world in (one, more)]
    assert counts[0] == pytest.approx(10, abs=3)
    assert counts[1] > 2 * counts[0]
    for world, condition in ((one, 2300), (more, 28_000)):
        assert stop_reason(world).startswith("Converged")
        assert readouts(world)["condition"] == pytest.approx(condition, rel=0.02)
    assert state(two).failed
    assert not stop_reason(two).startswith("Converged")
    assert state(two).history.violation[-1] > 1.0, "nowhere near"
    assert EXPERIMENTS.answer("One second more") == "However many: it does not find it."


@verify("Three gradients")
def test_differences_reach_half_the_digits(setting: Settings) -> None:
    world = solved(setting)
    forward, central = state(world).study.gradient_errors.T
    assert 5e-9 < forward.min() < 5e-8
    assert 2e-11 < central.min() < 5e-10
    assert 3 < np.argmin(forward) < np.argmin(central) < 9, "with one eps, and not the same"
    assert state(world).study.sensitivities_error < 2e-15
    assert EXPERIMENTS.answer("Three gradients") == "To eight digits."
    times = fields(world)["gradient_times"]
    assert times.shape == (4, 3)
    assert (times > 0.0).all()


def test_differences_simulate_once_for_each_variable_and_once_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = solved({"pieces": 40.0, "iterations": 1.0})
    shooting = params(world).shooting
    count = 0

    def counted(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        return f(x, u)

    f = shooting.problem.dynamics.f
    monkeypatch.setattr(type(shooting.problem.dynamics), "f", lambda self, x, u: counted(x, u))
    y = np.zeros(40)
    shooting.rollout(y + 1.0)
    one, count = count, 0
    run_to_completion(shooting.gradient_by_differences(y, 1e-6, "forward"))
    assert count == 41 * one
    count = 0
    shooting.gradient_by_adjoint(y + 2.0, shooting.linearize(y + 2.0))
    assert count == one, "and one sweep back"


@verify("A plan for another pendulum")
def test_eulers_pendulum_is_another_one(setting: Settings) -> None:
    world = solved(setting)
    assert stop_reason(world).startswith("Converged")
    assert state(world).history.violation[-1] < 1e-8
    shown = readouts(world)
    assert shown["missed"] == pytest.approx(3.7, abs=0.05)
    assert shown["cost"] == pytest.approx(0.024, abs=5e-4)
    assert shown["iteration"] == pytest.approx(10, abs=3)
    assert state(world).plan.T / 20 == 0.1
    plan = state(world).plan
    assert np.abs(plan.tracked_U).max() == pytest.approx(3 * np.abs(plan.U).max(), rel=0.1)
    world.change({"feedback": True})
    assert readouts(world)["missed"] < 0.12
    one = readouts(solved({**setting, "integrator": "rk4"}))
    assert one["missed"] == pytest.approx(0.035, abs=1e-3)
    assert readouts(solved({**setting, "integrator": "rk4", "steps": 2.0}))["missed"] < 2e-3
    assert shown["cost"] < 0.2 * one["cost"], "Euler feeds energy to its pendulum"


@verify("Twice the steps")
def test_errors_fall_by_the_order(setting: Settings) -> None:
    world = solved(setting)
    assert stop_reason(world).startswith("Converged")
    study = state(world).study
    euler, midpoint, rk4 = (study.state_errors[:-1] / study.state_errors[1:]).T
    assert euler[-1] == pytest.approx(2, abs=0.1)
    assert midpoint[-1] == pytest.approx(4, abs=0.2)
    np.testing.assert_allclose(rk4[:3], 16, rtol=0.1)
    assert EXPERIMENTS.answer("Twice the steps") == 16
    augmented, euler_sum = (study.cost_errors[:-1] / study.cost_errors[1:]).T
    np.testing.assert_allclose(augmented[:3], 16, rtol=0.15)
    np.testing.assert_allclose(euler_sum, 2, rtol=0.05)


@verify("Linear, and done in one")
def test_a_linear_system_takes_one_iteration(setting: Settings) -> None:
    world = solved(setting)
    assert readouts(world)["iteration"] == 1
    assert readouts(world)["cost"] == pytest.approx(1.5 / (1.0 - 1.0 / 20**2), rel=1e-9)
    U = state(world).plan.U[:, 0]
    np.testing.assert_allclose(np.diff(U, 2), 0.0, atol=1e-9)
    assert U[0] == pytest.approx(-U[-1])
    assert U[0] == pytest.approx(6.0 / 2.0**2, rel=0.06), "at the middle of the first piece"
    found = fields(world)
    np.testing.assert_allclose(found["end"], found["end_forecast"], atol=1e-9)
    world.change({"start": "cold", "guess": 0.7})
    assert solve(world) == 1, "from any guess"


@verify("As fast as it can")
def test_the_least_time_switches_once(setting: Settings) -> None:
    world = solved(setting)
    assert readouts(world)["T"] == pytest.approx(2.0, abs=1e-6)
    U = state(world).plan.U[:, 0]
    np.testing.assert_allclose(U, np.repeat([1.0, -1.0], 10), atol=1e-6)
    odd = solved({**setting, "pieces": 21.0})
    assert state(odd).plan.U[10, 0] == pytest.approx(0.0, abs=1e-6)
    assert readouts(odd)["T"] == pytest.approx(2.002, abs=5e-4)


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
