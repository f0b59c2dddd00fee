"""The lab of prediction: what its article claims, in numbers.

What a hundred learners do on average is a statistic: tolerances are about three standard errors."""

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.reinforcement_learning.prediction.lab import PredictionLab
from labs.reinforcement_learning.prediction.params import PredictionParams
from labs.reinforcement_learning.prediction.targets import sample_targets
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import Settings, readouts, solve, solved_world

EXPERIMENTS = ArticleExperiments("labs.reinforcement_learning", "prediction")
SQRT_LEARNERS = 10.0


def solved(setting: Settings, **changes: float | str | bool) -> World:
    return solved_world("prediction", {**setting, **changes})


def numbers(setting: Settings, **changes: float | str | bool) -> dict[str, float]:
    return dict(readouts(solved(setting, **changes)))


@EXPERIMENTS.verify("Before it is over")
def test_only_td_learns_before_the_end(setting: Settings) -> None:
    world, steps = World(find_lab("prediction"), setting), 0
    while world.state.live.episodes == 0:
        V = world.state.live.V
        assert not V[0].any()
        steps += int(V[1].any())
        world.advance()
    assert steps > 100  # periods during which TD(0) has learned already
    assert EXPERIMENTS.answer("Before it is over") == "TD(0)."
    live = world.state.live
    passed = np.unique(live.states[:-1])
    assert (live.V[0, passed] > 0.0).all()
    assert np.flatnonzero(live.V[0]).tolist() == passed.tolist()


@EXPERIMENTS.verify("It never ends")
def test_without_an_end_monte_carlo_learns_nothing(setting: Settings) -> None:
    world = solved(setting)
    found = readouts(world)
    assert not world.state.training["V"][0].any()
    assert found["error_mc"] == pytest.approx(11.05, abs=0.01)
    assert found["error_td"] == pytest.approx(1.2, abs=0.1)
    assert EXPERIMENTS.answer("It never ends") == "Nothing at all."
    ending = numbers(setting, ends=True, alpha_mc=0.1)
    assert ending["error_mc"] < 3.0


@EXPERIMENTS.verify("Honest or steady")
def test_targets_of_monte_carlo_are_unbiased_and_those_of_td_steady(setting: Settings) -> None:
    params = PredictionParams().change(dict(setting))
    world, V = params.prediction, np.where([1, *[0] * 5, 1], 0.0, params.v0)
    random = np.arange(1, 5, dtype=np.uint64)
    mc, td = sample_targets(world.task, params.looked_at, V, random, 10_000)
    assert set(mc) == {0.0, -1.0}
    assert mc.mean() == pytest.approx(world.truth[3], abs=3.0 * mc.std() / 100.0)
    answer = EXPERIMENTS.answer("Honest or steady")
    assert mc.std() == pytest.approx(answer, abs=0.005)
    assert (td == -1.0).all()
    learned = solved(setting).state.training["V"][1].mean(axis=0)
    _, later = sample_targets(world.task, params.looked_at, learned, random)
    assert abs(later.mean() + 0.5) < 0.15
    assert later.std() < 0.25


@EXPERIMENTS.verify("A hundred episodes")
def test_td_is_nearer_after_a_hundred_episodes(setting: Settings) -> None:
    found = numbers(setting)
    assert found["error_td"] == pytest.approx(0.06, abs=0.006)
    assert found["error_mc"] == pytest.approx(0.11, abs=0.012)
    for short in ("mc", "td"):
        assert found[f"error_{short}"] ** 2 == pytest.approx(
            found[f"bias_{short}"] ** 2 + found[f"spread_{short}"] ** 2, rel=1e-9
        )
        assert found[f"spread_{short}"] > 2.0 * found[f"bias_{short}"]
    assert EXPERIMENTS.answer("A hundred episodes") == "TD(0)."
    steps = (0.01, 0.02, 0.04, 0.08)
    assert min(numbers(setting, alpha_mc=a)["error_mc"] for a in steps) > found["error_td"]


@EXPERIMENTS.verify("A bad first guess")
def test_td_suffers_from_a_bad_guess(setting: Settings) -> None:
    found = numbers(setting)
    assert found["error_td"] == pytest.approx(2.5, abs=0.15)
    assert found["error_mc"] == numbers(setting, v0=-0.5)["error_mc"] < 0.08
    constant = numbers(setting, omega=0.0, alpha_td=0.1)
    assert constant["error_td"] == pytest.approx(0.46, abs=0.03)
    assert EXPERIMENTS.answer("A bad first guess") == "TD(0)."


@EXPERIMENTS.verify("Steps that shrink")
def test_shrinking_steps_converge(setting: Settings) -> None:
    found = numbers(setting)
    assert found["error_td"] == pytest.approx(EXPERIMENTS.answer("Steps that shrink"), abs=0.0015)
    constant = numbers(setting, omega=0.0, alpha_td=0.1)
    assert constant["error_td"] == pytest.approx(0.06, abs=0.006)
    mean = numbers(setting, omega=1.0)
    assert mean["error_td"] == pytest.approx(0.03, abs=0.005)
    assert mean["error_mc"] < min(found["error_mc"], numbers(setting, omega=0.8)["error_mc"])
    world = solved(setting)
    world.change({"omega": 0.0, "alpha_td": 0.1, "episodes": 100.0})
    solve(world)
    spoiled = readouts(world)
    assert spoiled["trained"] == 2100.0
    assert spoiled["error_td"] > 0.05


@EXPERIMENTS.verify("Met again")
def test_every_visit_is_biased_and_consistent(setting: Settings) -> None:
    every, first = numbers(setting), numbers(setting, visits="first")
    assert every["bias_mc"] == pytest.approx(2.0, abs=0.1)
    assert every["bias_mc"] > 2.0 * every["spread_mc"] / SQRT_LEARNERS
    assert first["bias_mc"] == pytest.approx(0.8, abs=0.1)
    assert first["bias_mc"] < 1.5 * first["spread_mc"] / SQRT_LEARNERS
    assert numbers(setting, episodes=1000.0)["bias_mc"] < 0.3
    assert EXPERIMENTS.answer("Met again") == "No, but it fades with more episodes."


@EXPERIMENTS.verify("You are the predictor")
def test_the_two_answers_of_the_eight_episodes(setting: Settings) -> None:
    """Example 6.4 of Sutton and Barto."""
    world = solved(setting)
    found = readouts(world)
    assert found["V_A_td"] == pytest.approx(EXPERIMENTS.answer("You are the predictor"), abs=1e-4)
    assert found["V_A_mc"] == pytest.approx(0.0, abs=1e-4)
    np.testing.assert_allclose(world.state.training["V"][:, 0, 2], -0.75, atol=1e-4)
    assert found["misfit_mc"] < 1e-4 < found["misfit_td"]
    assert found["residual_td"] < 1e-4 < found["residual_mc"]


@EXPERIMENTS.verify("Who fits, who predicts")
def test_batch_td_is_nearer_at_every_size(setting: Settings) -> None:
    """Figure 6.2 of Sutton and Barto."""
    world = solved(setting)
    mc, td = world.state.training["error"]
    assert (td[1:] < mc[1:]).all()
    assert td[9] == pytest.approx(0.11, abs=0.015)
    assert mc[9] == pytest.approx(0.18, abs=0.02)
    found = readouts(world)
    assert found["misfit_mc"] < 1e-4 < found["misfit_td"]
    assert found["residual_td"] < 1e-4 < found["residual_mc"]
    assert EXPERIMENTS.answer("Who fits, who predicts") == "No, TD(0) does."


@EXPERIMENTS.verify("What a transition tells")
def test_what_the_four_updates_need(setting: Settings) -> None:
    training = solved(setting).state.training
    looked, error = training["looked"], training["error"]
    needed = [x[e < 0.1].min(initial=np.inf) for x, e in zip(looked, error, strict=True)]
    assert needed[:2] == [5334.0, 110.0]
    assert needed[2] > looked[2, -1] == pytest.approx(900.0, abs=40.0)
    assert needed[3] == pytest.approx(600.0, abs=80.0)
    assert EXPERIMENTS.answer("What a transition tells") == "Dynamic programming."


def test_without_chance_one_sample_is_enough() -> None:
    params = PredictionParams(world="pendulum", gamma=0.95, noise=0.0, alpha_mc=1.0, episodes=500.0)
    world = solved(params.model_dump())
    V, met = world.state.training["V"][0], world.state.training["visits"][0] > 0
    assert met.mean() > 0.5
    truth = np.broadcast_to(params.prediction.truth, V.shape)
    np.testing.assert_allclose(V[met], truth[met], atol=1e-12)


def test_all_experiments_are_verified() -> None:
    EXPERIMENTS.check_all_are_verified()


def test_the_preset_of_the_pendulum_comes_near_the_truth() -> None:
    """By its steps both methods get rid of most of what they did not know, 6.05 at first."""
    world = solved_world("prediction", dict(PredictionLab.presets["Pendulum under PD"]))
    errors = world.state.training["error"]
    assert (errors[:, -1] < 2.0).all()
    assert (errors[:, -1] < 0.4 * errors[:, 0]).all()
