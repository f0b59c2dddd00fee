"""What the article of the lab multiple-shooting claims, in numbers."""

import numpy as np
import pytest

from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.multiple_shooting.lab import MultipleShootingState
from labs.params import Value
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import Settings, solved_world, stop_reason

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "multiple_shooting")
verify = EXPERIMENTS.verify


def begun(setting: Settings, **more: Value) -> tuple[World, MultipleShootingState]:
    """At the first guess."""
    world = World(find_lab("multiple-shooting"), {**setting, **more})
    assert isinstance(world.state, MultipleShootingState)
    return world, world.state


def solved(setting: Settings, **more: Value) -> tuple[MultipleShootingState, str]:
    """At the end of the solver, and its last sentence."""
    world = solved_world("multiple-shooting", {**setting, **more})
    assert isinstance(world.state, MultipleShootingState)
    return world.state, stop_reason(world)


def cost(state: MultipleShootingState) -> float:
    return float(state.history.cost[-1])


@verify("The gaps close")
def test_gaps_fall_as_newtons_method_does(setting: Settings) -> None:
    state, done = solved(setting)
    assert done.startswith("Converged after 5 iterations")
    largest = state.history.gaps.max(axis=1)
    np.testing.assert_allclose(largest[:4], [5.8, 2.7, 0.09, 0.002], rtol=0.15)
    assert largest[4] == pytest.approx(6e-7, rel=0.1)
    assert largest[5] < 1e-12
    assert EXPERIMENTS.answer("The gaps close") == "It loses twice as many digits each time."


@verify("One segment cannot take it")
def test_one_segment_cannot_take_the_line(setting: Settings) -> None:
    one, done = solved(setting)
    assert one.history.iterations == 100
    assert not done.startswith("Converged")
    ten, twenty = (solved(setting, segments=m)[0] for m in (10.0, 20.0))
    assert [state.history.iterations for state in (ten, twenty)] == [9, 6]
    assert cost(ten) == pytest.approx(cost(twenty), rel=1e-6) == pytest.approx(0.834, abs=5e-4)
    assert cost(one) > cost(ten)
    assert EXPERIMENTS.answer("One segment cannot take it") == "More than 100."


@verify("Led by the guess")
def test_the_guess_leads(setting: Settings) -> None:
    def reversals(state: MultipleShootingState) -> int:
        v = state.motion.X[:, 1]
        return int((np.diff(np.sign(v[np.abs(v) > 0.1])) != 0).sum())

    twenty, five = solved(setting)[0], solved(setting, segments=5.0)[0]
    assert (round(cost(twenty), 3), round(cost(five), 3)) == (0.219, 0.186)
    assert cost(twenty) / cost(five) == pytest.approx(1.18, abs=5e-3)
    assert (reversals(twenty), reversals(five)) == (1, 2)
    for m in (5.0, 10.0, 20.0):
        still = solved(setting, segments=m, guess="still")[0]
        assert cost(still) == pytest.approx(cost(five), rel=1e-6)
    assert EXPERIMENTS.answer("Led by the guess") == "More than 0.186."


@verify("Upright for four seconds")
def test_segments_balance_what_one_cannot(setting: Settings) -> None:
    state, done = solved(setting)
    assert done.startswith("Converged after 2 iterations")
    at, m = state.anatomy, 20
    assert np.diff(at.cuts).max() * state.motion.T / len(at.growth) == pytest.approx(4.0 / m)
    assert at.growth.max() == pytest.approx(7.5, abs=0.05)
    assert at.growth_whole[-1] == pytest.approx(7e9, rel=0.05)
    assert at.condition == pytest.approx(290, rel=0.01)
    late = np.log(at.growth_whole[60] / at.growth_whole[40]) / (20 * state.motion.T / 80)
    assert late == pytest.approx(5.4, abs=0.05)


@verify("And in one segment")
def test_single_shooting_lets_it_fall(setting: Settings) -> None:
    state, done = solved(setting)
    assert done.startswith("Converged after 15 iterations")
    upright, _ = solved(setting, segments=20.0)
    assert 3.7 < cost(state) / cost(upright) < 4.0
    angle = state.motion.X[:, 0]
    assert angle.min() < -2.0, "it falls through"
    assert upright.motion.X[:, 0].min() > 3.0
    assert state.anatomy.growth_whole[-1] == pytest.approx(71, abs=1)
    answer = EXPERIMENTS.answer("And in one segment")
    assert answer == "A motion that lets it fall first."


@verify("More variables, fewer numbers")
def test_more_segments_are_sparser(setting: Settings) -> None:
    forty, one = solved(setting)[0].anatomy, solved(setting, segments=1.0)[0].anatomy
    assert (forty.variables, forty.nonzeros) == (120, 680)
    assert (one.variables, one.nonzeros) == (42, 1850)
    assert forty.density == pytest.approx(0.03, abs=0.005)
    assert one.density == pytest.approx(0.96, abs=0.005)
    counts = [begun(setting, segments=float(m))[1].anatomy.nonzeros for m in range(1, 41)]
    assert min(counts) == counts[12] == 494


@verify("How many segments?")
def test_a_medium_number_is_quickest(setting: Settings) -> None:
    study = solved(setting)[0].study
    np.testing.assert_array_equal(study.segments, [1, 2, 4, 5, 10, 20])
    assert study.converged[2:].all()
    assert study.iterations[4] == 9 == study.iterations[study.converged].min()
    assert study.iterations[3] == 10
    assert study.iterations[:2].min() >= 27
    np.testing.assert_allclose(study.cost[2:4], 0.134, atol=5e-4)
    np.testing.assert_allclose(study.cost[4:], 0.155, atol=5e-4)
    assert EXPERIMENTS.answer("How many segments?") == "10: the medium one."


@verify("No motion at all")
def test_what_cannot_be_is_seen_as_gaps(setting: Settings) -> None:
    state, done = solved(setting)
    assert done.startswith("Infeasible")
    assert state.failed
    assert state.history.gaps[-1].max() > 0.5
    assert np.abs(state.motion.U).max() <= 0.2 * 4.905 + 1e-9
    assert EXPERIMENTS.answer("No motion at all") == "Arcs that do not join."


def test_all_experiments_are_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
