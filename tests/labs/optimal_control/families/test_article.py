"""What the article of the lab families claims, in numbers."""

import numpy as np
import pytest

from labs.optimal_control.families.motion import MethodMotion
from labs.optimal_control.families.systems import PENDULUM
from tests.labs.experiments import ArticleExperiments
from tests.labs.optimal_control.families.simulation import (
    Settings,
    costs,
    measured,
    results,
    solve,
    solved,
    stop_reason,
)

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "families")
verify = EXPERIMENTS.verify


@verify("Four answers")
def test_three_agree_and_the_rounded_problem_does_not(setting: Settings) -> None:
    world = solved(setting)
    found = costs(world)
    for name in ("hjb", "pontryagin", "direct"):
        assert found[name] == pytest.approx(6.04, abs=5e-3), name
    assert found["dp"] == pytest.approx(6.16, abs=5e-3)
    assert all(motion.converged for motion in results(world).motions.values())
    assert stop_reason(world).startswith("All four have ended")


@verify("A coarse grid")
def test_a_policy_is_better_than_its_values(setting: Settings) -> None:
    motions = results(solved(setting)).motions
    assert motions["hjb"].promised == pytest.approx(7.24, abs=5e-3)
    assert motions["hjb"].cost == pytest.approx(6.04, abs=5e-3)
    assert motions["dp"].promised == pytest.approx(5.75, abs=5e-3)
    assert motions["dp"].cost == pytest.approx(6.23, abs=5e-3)
    early = np.abs(motions["pontryagin"].U[:50])
    np.testing.assert_allclose(early, 4.0, atol=1e-9)
    assert EXPERIMENTS.answer("A coarse grid") == "6.04, as before."


@verify("More nodes")
def test_one_error_falls_and_the_other_wanders(setting: Settings) -> None:
    world = solved(setting)
    study = results(world).study
    nodes = study.x[study.found[:, 0]]
    hjb, dp = study.y[: len(nodes)].T
    np.testing.assert_array_equal(nodes, [21, 31, 41, 61, 81, 121, 161])
    assert hjb[2] == pytest.approx(1.2, abs=0.05)
    assert hjb[5] == pytest.approx(5e-4, abs=5e-5)
    assert (np.diff(hjb) < 0.0).all()
    assert (np.diff(dp) > 0.0).any()
    world.change({"study": "none", "nodes": 41.0, "hjb_steps": 100.0})
    solve(world)
    assert results(world).motions["hjb"].promised == pytest.approx(7.38, abs=5e-3)
    assert EXPERIMENTS.answer("More nodes") == "HJB's steadily, DP's not."


@verify("Another guess")
def test_pontryagin_ends_in_another_extremal(setting: Settings) -> None:
    world = solved(setting)
    motions, study = results(world).motions, results(world).study
    assert motions["direct"].cost == pytest.approx(6.04, abs=5e-3)
    assert motions["pontryagin"].cost == pytest.approx(25.1, abs=5e-3)
    assert motions["pontryagin"].converged
    assert motions["pontryagin"].X[:, 0].min() < -np.pi, "once round"
    assert abs(motions["pontryagin"].X[-1, 0]) < 1.0
    ends = study.y[study.found[:, 0], 0]
    assert np.isclose(ends, 6.036, atol=1e-3).sum() == 8
    assert np.isclose(ends, 25.10, atol=5e-3).sum() == 4
    assert len(study.x) - len(ends) == 5
    assert EXPERIMENTS.answer("Another guess") == "Pontryagin at a dearer motion."


@verify("Too dear to try")
def test_the_tables_find_what_is_far_from_the_guess(setting: Settings) -> None:
    motions = results(solved(setting)).motions
    assert motions["direct"].converged
    assert motions["direct"].cost == pytest.approx(60.6, abs=0.05)
    assert motions["hjb"].cost == pytest.approx(40.3, abs=0.05)
    assert motions["dp"].cost == pytest.approx(41.3, abs=0.05)
    assert not motions["pontryagin"].known
    for name in ("hjb", "dp"):
        assert motions[name].X[-1, 0] == pytest.approx(np.pi / 2, abs=0.1), "half way"
        assert motions[name].X[:, 0].max() < 3.5
    assert motions["direct"].X[:, 0].max() > 3.7, "it swings back"
    assert EXPERIMENTS.answer("Too dear to try") == "Yes, one that the tables find."


@verify("Shooting too far")
def test_shooting_needs_a_good_start(setting: Settings) -> None:
    world = solved({**setting, "nodes": 41.0})
    assert not results(world).motions["pontryagin"].known
    assert "The line search ends" in stop_reason(world)
    world.change({"horizon": 0.7})
    solve(world)
    short = results(world).motions["pontryagin"]
    assert short.converged
    assert short.iterations == 7
    assert np.exp(np.sqrt(PENDULUM.stiffness)) == pytest.approx(226, abs=0.5)
    for changes in (
        {"horizon": 1.5, "pontryagin": "collocation"},
        {"start": "warm"},
        {"pontryagin": "shooting"},
    ):
        world.change(changes)
        solve(world)
        assert results(world).motions["pontryagin"].converged, changes
    assert EXPERIMENTS.answer("Shooting too far") == "No."


@verify("Three names")
def test_costate_gradient_and_multipliers_are_one_curve(setting: Settings) -> None:
    world = solved(setting)
    assert measured(world)["gradient_gap"] == pytest.approx(3.0, abs=0.5)
    assert measured(world)["multiplier_gap"] == pytest.approx(1.0, abs=0.05)
    fine = solved({**setting, "intervals": 120.0, "nodes": 201.0, "hjb_steps": 100.0})
    assert measured(fine)["gradient_gap"] == pytest.approx(1.2, abs=0.05)
    assert measured(fine)["multiplier_gap"] == pytest.approx(0.2, abs=0.05)
    best: MethodMotion = results(world).motions["pontryagin"]
    u = np.clip(-best.P[:, 1] / (2.0 * 0.2 * PENDULUM.inertia), -4.0, 4.0)
    np.testing.assert_allclose(best.U, u, atol=1e-9)
    rough = results(world).gradients["dp"] - best.P
    assert np.abs(rough.mean(axis=0)).max() < 0.2 * np.abs(best.P).max()
    assert EXPERIMENTS.answer("Three names") == "They are the same curve."


@verify("A closed form")
def test_the_mass_is_known_exactly(setting: Settings) -> None:
    world = solved(setting)
    assert measured(world)["multiplier_gap"] == pytest.approx(0.032, abs=5e-4)
    assert measured(world)["gradient_gap"] == pytest.approx(0.24, abs=5e-3)
    assert results(world).motions["direct"].iterations == 1
    exact = world.lab.fields(world.params, world.state)["exact_p_v"]
    found = results(world).motions["pontryagin"].P[:, 1]
    np.testing.assert_allclose(found, exact, atol=1e-8 * np.abs(exact).max())
    half = solved({**setting, "intervals": 60.0})
    assert measured(half)["multiplier_gap"] == pytest.approx(0.125, abs=5e-4)


@verify("From the middle")
def test_tails_are_optimal(setting: Settings) -> None:
    shown = measured(solved(setting))
    assert shown["tail_gap"] == pytest.approx(0.02, abs=2e-3)
    assert shown["tail_cost_gap"] < 1e-6
    assert EXPERIMENTS.answer("From the middle") == "Yes, the same tail."


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
