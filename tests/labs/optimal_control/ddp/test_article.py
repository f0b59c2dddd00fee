"""What the article of the lab ddp claims, in numbers."""

import numpy as np
import pytest

from labs.models.mechanisms import mechanism
from labs.scene import NullScene
from tests.labs.experiments import ArticleExperiments
from tests.labs.optimal_control.ddp.simulation import (
    Settings,
    readouts,
    solve,
    solved,
    state,
    stop_reason,
)

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "ddp")
verify = EXPERIMENTS.verify


@verify("Watch it think")
def test_two_iterations_do_most(setting: Settings) -> None:
    history = state(solved(setting)).history
    assert history.cost[0] == pytest.approx(2963, abs=1)
    assert history.cost[1] == pytest.approx(45, abs=1)
    assert history.cost[2] == pytest.approx(2.4, abs=0.1)
    assert history.cost[-1] == pytest.approx(0.843, abs=5e-4)
    assert len(history.alpha) == 25
    np.testing.assert_array_equal(history.alpha[:-1], 1.0)
    ratio = history.actual[:-1] / history.expected[:-1]
    np.testing.assert_allclose(ratio[-3:], 1.4, atol=0.01)
    exact = state(solved({**setting, "method": "ddp"})).history
    assert exact.actual[-2] / exact.expected[-2] == pytest.approx(1.0, abs=0.01)
    assert EXPERIMENTS.answer("Watch it think") == np.flatnonzero(history.cost < 3.0)[0]


@verify("Second derivatives")
def test_ddp_takes_fewer_iterations_to_the_same_motion(setting: Settings) -> None:
    ddp, ilqr = solved(setting), solved({**setting, "method": "ilqr"})
    costs = [state(world).history.cost for world in (ddp, ilqr)]
    assert costs[0][-1] == pytest.approx(costs[1][-1], rel=1e-6)
    assert [len(cost) - 1 for cost in costs] == [36, 124]
    gradients = [state(world).history.gradient for world in (ddp, ilqr)]
    assert gradients[0][-1] < 1e-2 * gradients[0][-2], "quadratically"
    assert gradients[1][-1] > 0.2 * gradients[1][-2], "by a constant factor"
    v = state(ddp).plan.X[:, 1]
    signs = np.sign(v[np.abs(v) > 0.1])
    assert (np.diff(signs) != 0).sum() == 1, "it swings back once"


@verify("Too much caution")
def test_a_large_mu_is_slow(setting: Settings) -> None:
    history = state(solved(setting)).history
    assert len(history.alpha) == 181
    np.testing.assert_array_equal(history.alpha[:100], 1.0)
    assert (history.actual[:100] / history.expected[:100] > 0.25).all(), "all of them good"
    assert (np.diff(history.mu[:100]) < 0.0).all()
    assert len(state(solved({**setting, "mu_factor": 10.0})).history.alpha) < 40
    assert EXPERIMENTS.answer("Too much caution") == "Small steps, all of them good."


@verify("Cheap control")
def test_cheap_control_is_violent(setting: Settings) -> None:
    plan = state(solved(setting)).plan
    size = np.abs(plan.U[:, 0]) / 4.905
    assert size[0] == size.max() > 7.0
    assert len(state(solved(setting)).history.alpha) == 5
    assert size[5] < 0.1 * size[0], "a tenth of a second later"


@verify("A weak motor")
def test_a_weak_motor_swings(setting: Settings) -> None:
    world = solved(setting)
    plan = state(world).plan
    at_limit = np.abs(plan.U[:, 0]) > 0.3 * 4.905 - 1e-9
    assert np.abs(plan.U).max() <= 0.3 * 4.905
    assert at_limit.mean() == pytest.approx(0.7, abs=0.02)
    assert not plan.K[at_limit].any()
    v = plan.X[:, 1]
    assert (np.diff(np.sign(v[np.abs(v) > 0.1])) != 0).sum() == 2, "reversing twice"
    assert plan.X[-1, 0] == pytest.approx(np.pi, abs=1e-3)
    assert np.degrees(np.arcsin(0.3)) == pytest.approx(17, abs=0.5)
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert "robot" in scene.names
    assert EXPERIMENTS.answer("A weak motor") == "By swinging."


@verify("Another guess, another minimum")
def test_the_ur5_stays_wound_up(setting: Settings) -> None:
    wound, still = solved(setting), solved({**setting, "guess": 0.0})
    assert state(wound).history.cost[-1] == pytest.approx(0.78, abs=0.005)
    assert state(still).history.cost[-1] == pytest.approx(0.037, abs=5e-4)
    for world in (wound, still):
        assert stop_reason(world).startswith("Converged")
        assert state(world).history.gradient[-1] < 1e-3
    ends = [state(world).plan.X[-1, :6] for world in (wound, still)]
    assert np.abs(ends[0] - ends[1]).max() > 1.0, "[rad] it is another posture"
    assert EXPERIMENTS.answer("Another guess, another minimum") == "Yes: it ends in a dearer one."


@verify("Warm start")
def test_a_warm_start_is_shorter(setting: Settings) -> None:
    world = solved(setting)
    assert world.latest is not None
    assert world.latest.iteration == 45
    J = state(world).history.cost[-1]
    for changes in ({"start": "warm"}, {"control": 1.0}, {"control": 2.0}):
        world.change(changes)
        count = solve(world)
    assert count == 11
    assert state(world).history.cost[-1] == pytest.approx(J, rel=1e-6)
    assert EXPERIMENTS.answer("Warm start") == count


@verify("Right model, wrong plan")
def test_the_ghost_falls_in_the_end(setting: Settings) -> None:
    shown = readouts(setting, 3.5)
    assert shown["cost"] == pytest.approx(0.843, abs=1e-3)
    assert shown["paid"] == pytest.approx(0.843, abs=1e-3)
    assert shown["paid_open"] > 100.0
    assert shown["missed_open"] > 0.3
    up = readouts({**setting, "horizon": 2.0}, 2.5)
    assert up["missed_open"] < 0.01, "it comes up"
    growth = np.linalg.eigvals(
        mechanism("pendulum").derivatives(np.array([[np.pi, 0.0]]), np.zeros((1, 1)))[1][0]
    ).real.max()
    assert np.exp(growth) == pytest.approx(227, abs=1)
    assert EXPERIMENTS.answer("Right model, wrong plan") == "It comes up and falls over."


@verify("An unknown payload")
def test_feedback_carries_the_payload(setting: Settings) -> None:
    shown = readouts(setting, 2.5)
    assert shown["paid"] == pytest.approx(0.947, abs=1e-3)
    assert shown["missed"] < 1e-3
    assert shown["missed_open"] > 0.5
    heavy = readouts({**setting, "payload": 0.5}, 2.5)
    assert heavy["paid"] == pytest.approx(1.5, abs=0.01)
    assert heavy["missed"] < 1e-2
    assert EXPERIMENTS.answer("An unknown payload") == "The robot with feedback alone."


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
