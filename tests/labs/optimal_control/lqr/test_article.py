"""What the article of the lab lqr claims, in numbers."""

from collections.abc import Mapping

import numpy as np
import pytest

from labs.optimal_control.lqr.linear_systems import linear_system
from labs.optimal_control.lqr.params import LqrParams
from labs.params import Value
from tests.labs.experiments import ArticleExperiments
from tests.labs.optimal_control.lqr.simulation import (
    LAB,
    closed_loop,
    deviations,
    initial_state,
    largest_control,
    lqr_params,
    predicted_and_paid_cost,
    settling_time,
    solved,
    states,
)

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "lqr")


@EXPERIMENTS.verify("What control costs")
def test_what_control_costs(setting: Mapping[str, Value]) -> None:
    dear, cheap = lqr_params(setting), lqr_params(setting, r=0.1)
    weak, strong = states(dear, 12.0), states(cheap, 12.0)
    assert largest_control(dear, weak) == pytest.approx(0.986, abs=0.01)
    assert largest_control(cheap, strong) == pytest.approx(9.47, abs=0.05)
    assert settling_time(deviations(dear, weak)[:, 0], 0.02) == pytest.approx(5.9, abs=0.05)
    assert settling_time(deviations(cheap, strong)[:, 0], 0.02) == pytest.approx(1.4, abs=0.05)
    assert closed_loop(cheap)[-1] == pytest.approx(0.947, abs=0.001)
    assert closed_loop(dear)[-1] == pytest.approx(0.986, abs=0.001)


@EXPERIMENTS.verify("The bill is known in advance")
def test_the_bill_is_known_in_advance(setting: Mapping[str, Value]) -> None:
    params = lqr_params(setting)
    run = states(params, 8.0)
    promised, paid = predicted_and_paid_cost(params, 8.0)
    assert promised == pytest.approx(278.95, abs=0.01)
    assert paid == pytest.approx(promised, rel=1e-9)
    totals = [s.past_cost + s.cost_to_go for s in run[1:]]
    np.testing.assert_allclose(totals, promised, rtol=1e-9)
    assert min(np.diff([s.past_cost for s in run])) >= 0.0
    pole = predicted_and_paid_cost(LqrParams(), 8.0)
    assert pole == pytest.approx((164.7, 178.7), abs=0.05)
    near = predicted_and_paid_cost(LqrParams(deviation=0.05), 8.0)
    assert near[1] / near[0] == pytest.approx(1.0022, abs=0.0003)
    assert EXPERIMENTS.answer("The bill is known in advance") == "279"


@EXPERIMENTS.verify("Constant, then not")
def test_constant_then_not(setting: Mapping[str, Value]) -> None:
    hundred, twice = lqr_params(setting), lqr_params(setting, horizon=200.0)
    assert hundred.regulator.constant_gain_count == 61
    assert twice.regulator.constant_gain_count == 161
    assert LAB.fields(twice, initial_state(twice))["k_mark"] == pytest.approx([160.0, 160.0])
    np.testing.assert_allclose(
        hundred.regulator.gains[61:], twice.regulator.gains[161:], rtol=1e-10
    )
    heavy = lqr_params(setting, alpha=100.0).regulator
    assert heavy.constant_gain_count == 61
    steady = heavy.steady
    assert steady is not None
    ends, rests = heavy.gains[-1, 0, 1], steady.gain[0, 1]
    assert ends / rests == pytest.approx(2.4, abs=0.05)
    assert (np.abs(hundred.regulator.gains[-1]) < np.abs(steady.gain)).all()
    assert EXPERIMENTS.answer("Constant, then not") == twice.regulator.constant_gain_count


@EXPERIMENTS.verify("A short horizon does not see the fall")
def test_a_short_horizon_does_not_see_the_fall(setting: Mapping[str, Value]) -> None:
    params = lqr_params(setting)
    run = states(params, 5.0)
    assert "ran off its rail" in run[-1].trouble
    dx = deviations(params, run)
    assert np.abs(dx[-1, 1]) < 0.3, "the pole stands up"
    assert np.abs(dx[:, 0]).max() > 1.4
    assert closed_loop(params)[-1] == pytest.approx(1.019, abs=0.001)
    assert closed_loop(lqr_params(setting, horizon=30.0))[-1] < 1.0
    assert not states(lqr_params(setting, horizon=30.0), 10.0)[-1].trouble
    one = lqr_params(setting, horizon=1.0, final="p", alpha=1.0)
    assert one.regulator.steady is not None
    np.testing.assert_allclose(one.regulator.gains[0], one.regulator.steady.gain, rtol=1e-8)
    assert not states(one, 5.0)[-1].trouble
    assert (
        EXPERIMENTS.answer("A short horizon does not see the fall")
        == "It stands, but the cart runs off."
    )


@EXPERIMENTS.verify("A place that costs nothing")
def test_a_place_that_costs_nothing(setting: Mapping[str, Value]) -> None:
    params = lqr_params(setting)
    dx = deviations(params, states(params, 10.0))
    assert np.abs(dx[-1, 0]) == pytest.approx(0.80, abs=0.005)
    assert np.abs(dx[-1, 1:]).max() < 1e-3
    assert closed_loop(params)[-1] == pytest.approx(1.0, abs=1e-9)
    refused = states(lqr_params(setting, policy="steady"), 1.0)
    assert len(refused) == 2
    assert "Q does not see the mode with eigenvalue 1," in refused[-1].trouble
    back = lqr_params(setting, policy="steady", q_slide=0.1)
    assert np.abs(deviations(back, states(back, 60.0))[-1, 0]) < 0.01


@EXPERIMENTS.verify("A weaker motor")
def test_a_weaker_motor(setting: Mapping[str, Value]) -> None:
    params = lqr_params(setting)
    for limit, lean in ((20.0, 0.76), (10.0, 0.54), (5.0, 0.299)):
        found = lqr_params(setting, limit=limit).closed_loop.largest_recoverable_deviation()
        assert found == pytest.approx(lean, abs=0.005 if limit > 5.0 else 0.001)
    run = states(params, 8.0)
    assert "ran off its rail" in run[-1].trouble
    assert largest_control(params, run) == 5.0
    saved = lqr_params(setting, deviation=0.29)
    assert np.abs(deviations(saved, states(saved, 8.0))[-1]).max() < 0.01
    assert (closed_loop(params) == closed_loop(lqr_params(setting, limit=20.0))).all()
    assert lqr_params(setting, r=1.0).closed_loop.largest_recoverable_deviation() == pytest.approx(
        0.34, abs=0.005
    )


@EXPERIMENTS.verify("Back from the bottom, not from half way")
def test_back_from_the_bottom_not_from_half_way(setting: Mapping[str, Value]) -> None:
    params = lqr_params(setting)
    heaviest = linear_system("pendulum").mechanism.f(np.array([np.pi / 2, 0.0]), np.zeros(1))[1]
    level = linear_system("pendulum").mechanism.f(np.array([np.pi / 2, 0.0]), np.array([4.905]))
    assert heaviest < -10.0
    assert level[1] == pytest.approx(0.0, abs=1e-9), "4.9 N m hold it level"
    assert params.closed_loop.largest_recoverable_deviation() == pytest.approx(0.95, abs=0.005)
    assert np.abs(deviations(params, states(params, 5.0))[-1]).max() < 1e-3
    half = lqr_params(setting, deviation=2.0)
    swings = deviations(half, states(half, 20.0))[:, 0]
    assert swings.min() > 1.9
    assert swings.max() < 2.4
    balance = np.pi - np.arcsin(4.0 / 4.905)
    assert swings.min() < balance < swings.max()
    assert EXPERIMENTS.answer("Back from the bottom, not from half way") == "It gets up."


@EXPERIMENTS.verify("One answer, two prices")
def test_one_answer_two_prices(setting: Mapping[str, Value]) -> None:
    params = lqr_params(setting)
    pole, mass = solved(params), solved(lqr_params(setting, system="mass"))
    assert (pole.differences[:3] < 1e-13).all()
    assert 1e-6 < pole.differences[-1] < 1e-3
    assert (mass.differences < 1e-12).all()
    a = params.regulator.problem.a
    assert 1e12 < np.linalg.norm(np.linalg.matrix_power(a, 260)) < 1e13
    for name in ("riccati", "at_once"):
        assert (np.asarray(pole.seconds[name]) > 0.0).all()
    assert EXPERIMENTS.answer("One answer, two prices") == "to about 4 digits"


@EXPERIMENTS.verify("The cheapest way to stability")
def test_the_cheapest_way_mirrors_eigenvalues(setting: Mapping[str, Value]) -> None:
    params = lqr_params(setting)
    p = params.regulator.problem
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(p.a)), [1.25, 2.0])
    np.testing.assert_allclose(np.sort(closed_loop(params)), [0.5, 0.8], atol=1e-5)
    assert params.regulator.spectral_radius == pytest.approx(0.8, abs=1e-5)
    run = states(params, 4.0)
    x = np.linalg.matrix_power(p.a + p.b @ params.regulator.gains[0], 20) @ [1.0, 1.0]
    np.testing.assert_allclose(run[-1].x, x, rtol=1e-9)
    # What is inside stays where it is.
    text = str(setting["matrices"]).replace("1.25", "0.7")
    inside = closed_loop(lqr_params(setting, matrices=text))
    np.testing.assert_allclose(np.sort(inside), [0.5, 0.7], atol=1e-5)


def test_every_experiment_of_the_article_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
