"""What the article of the lab mpc claims, in numbers."""

import numpy as np
import pytest

from labs.models.mechanisms import mechanism
from tests.labs.experiments import ArticleExperiments
from tests.labs.optimal_control.mpc.simulation import Settings, run_for

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "mpc")
verify = EXPERIMENTS.verify


@verify("It does not do what it predicts")
def test_it_leaves_its_first_plan(setting: Settings) -> None:
    found = run_for(setting, 0.61)
    assert found.last("off_first") == pytest.approx(0.36, abs=0.01)
    assert found.last("promised") == pytest.approx(28.7, abs=0.05)
    assert found.last("over_horizon") == pytest.approx(35.6, abs=0.05)
    assert found.measured["paid"][-2] == pytest.approx(18.9, abs=0.05), "at the end of its horizon"
    assert found.state.history.latest is not None
    assert found.last("gap") < 1e-6, "solved to the end"
    assert EXPERIMENTS.answer("It does not do what it predicts") == "No, although it is."


@verify("Let the horizon shrink")
def test_a_shrinking_horizon_keeps_to_the_first_plan(setting: Settings) -> None:
    found = run_for(setting, 0.61)
    assert found.last("off_first") < 1e-5
    assert found.last("over_horizon") == pytest.approx(found.last("promised"), rel=1e-6)
    assert found.last("promised") == pytest.approx(28.7, abs=0.05)
    assert len(found.state.history.latest.X) == 31  # type: ignore[union-attr]


@verify("One iteration a period")
def test_one_iteration_is_as_good_as_many(setting: Settings) -> None:
    once, solved = run_for(setting, 0.5), run_for({**setting, "iterations": "all"}, 0.5)
    assert once.last("paid") == pytest.approx(1.447, abs=5e-4)
    assert once.last("paid") == pytest.approx(solved.last("paid"), rel=1e-4)
    np.testing.assert_allclose(once.measured["v"], solved.measured["v"], atol=0.01)
    assert (once.measured["iterations"] == 1.0).all()
    assert once.measured["gap"][1] > 0.1
    assert once.measured["gap"][2:].max() < 0.01, "nearly closed from the third period on"
    assert np.abs(once.measured["v"]).max() == pytest.approx(1.0, abs=1e-4), "at its limit"


@verify("Begin anew each time")
def test_a_cold_start_does_not_swing_up(setting: Settings) -> None:
    cold, warm = run_for(setting, 4.0), run_for({**setting, "start": "warm"}, 4.0)
    assert abs(cold.measured["q"][-1, 1]) < 1e-3, "it hangs"
    assert abs(cold.measured["q"][-1, 0]) > 0.5, "off to the side"
    assert cold.last("miss") > 1.0
    plans = [*cold.state.history.predictions, cold.state.history.latest]
    assert min(abs(plan.X[-1, 1]) for plan in plans if plan) > 2.0, "each means to have it up"
    assert warm.last("miss") < 1e-3
    assert warm.measured["miss"][200:].max() < 0.2, "up in two seconds"


@verify("One period late")
def test_a_known_delay_is_none(setting: Settings) -> None:
    late, known = run_for(setting, 5.0), run_for({**setting, "compensate": True}, 5.0)
    assert late.last("failures") > 100
    assert late.measured["miss"][-100:].max() > 0.5
    assert known.last("failures") == 0
    assert known.last("miss") < 1e-3
    assert EXPERIMENTS.answer("One period late") == "Yes."


@verify("A dead end")
def test_a_plan_that_can_stop_never_fails(setting: Settings) -> None:
    found, rest = run_for(setting, 1.5), run_for({**setting, "end": "rest"}, 1.5)
    assert found.last("failures") > 30
    assert "Infeasible" in found.state.controller.status
    assert "the brake acts" in found.state.controller.status
    assert np.abs(found.measured["q"][:, 0]).max() == pytest.approx(0.5 + 0.11, abs=5e-3)
    assert rest.last("failures") == 0
    assert np.abs(rest.measured["q"][:, 0]).max() < 0.1, "timid"
    assert run_for({**setting, "steps": 10.0}, 1.5).last("failures") == 0


@verify("Round the ball")
def test_the_tip_slides_along_the_ball(setting: Settings) -> None:
    found = run_for(setting, 1.5)
    body, ball = mechanism("ur5"), found.params.ball
    assert ball
    tips = np.array([body.tip(q) for q in found.measured["q"]])
    clearance = np.linalg.norm(tips - ball.center, axis=1) - ball.radius
    assert abs(clearance.min()) < 1e-3, "it touches"
    assert (clearance < 2e-3).sum() > 10, "and slides"
    assert found.measured["exceeded"].max() < 1e-3
    assert found.last("miss") < 1e-3
    free = run_for({**setting, "obstacle": False}, 1.5)
    tips = np.array([body.tip(q) for q in free.measured["q"]])
    assert np.linalg.norm(tips - ball.center, axis=1).min() < 0.9 * ball.radius, "it is in the way"


@verify("Behind a moving target")
def test_it_stays_behind_what_moves(setting: Settings) -> None:
    eager: Settings = {"w_v": 0.001, "w_vf": 0.01}
    behind = [
        run_for({**setting, **changes}, 2.0).measured["miss"][-75:].mean()
        for changes in ({}, {"turns": 0.5}, eager)
    ]
    assert behind[:2] == pytest.approx([0.02, 0.04], rel=0.1)
    assert behind[2] < 0.6 * behind[0]


@verify("A model that is wrong")
def test_an_unknown_load_leaves_an_offset(setting: Settings) -> None:
    found = run_for(setting, 2.0)
    assert found.last("miss") == pytest.approx(0.024, abs=5e-4)
    tip = mechanism("ur5").tip(found.measured["q"][-1])
    assert tip[2] < found.params.target[2] - 0.015, "below"
    assert run_for({**setting, "payload": 2.0}, 2.0).last("miss") == pytest.approx(0.010, abs=5e-4)
    assert run_for({**setting, "w_u": 0.01}, 2.0).last("miss") < 0.8 * found.last("miss")


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
