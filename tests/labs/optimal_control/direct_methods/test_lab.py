"""The race itself: its numbers against the algorithms run alone, and what is shown of it."""

import numpy as np
import pytest

from labs.algorithms import sqp
from labs.algorithms.single_shooting import SingleShooting
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.direct_methods.method_runs import outcome_message
from labs.optimal_control.direct_methods.methods import TRANSCRIPTIONS, transcribe
from labs.optimal_control.direct_methods.params import DirectMethodsParams
from labs.scene import NullScene
from labs.tasks.direct.guesses import first_guess
from tests.labs.optimal_control.direct_methods.simulation import (
    Settings,
    costs,
    entrants,
    iterations,
    solved,
    state,
)
from tests.labs.solving import solve, stop_reason


def test_the_race_changes_nothing_about_a_method() -> None:
    params = DirectMethodsParams()
    shooting = SingleShooting(params.problem, 20, 2)
    guess = first_guess(params, 20)
    alone = sqp.solve(shooting, shooting.pack(guess.U, guess.T), params.options)
    entrant = entrants({})["single"]
    assert entrant.history.iterations == alone.iteration
    assert entrant.history.cost[-1] == alone.values.f


@pytest.mark.parametrize("system", ["mass", "cart-pole", "ur5"])
def test_motions_agree_with_their_programmes(system: str) -> None:
    """Gaps of a motion are exactly what the dynamics constraints miss; its controls are y."""
    params = DirectMethodsParams(system=system, pieces=6.0, segments=3.0)
    guess = first_guess(params, params.N)
    for name, method in transcribe(params.problem, params.N, params.m, params.M).items():
        at = sqp.init(method.program, method.variables(guess), params.options)
        motion = method.motion(at)
        gaps = np.sort(np.abs(motion.gaps[np.abs(motion.gaps) > 0.0]))
        missed = np.abs(at.values.c)
        assert motion.gaps.any() == (name != "single")
        assert all(np.isclose(missed, gap, rtol=1e-9, atol=1e-12).any() for gap in gaps)
        held = motion.U[:: motion.pieces // params.N, 0]
        np.testing.assert_array_equal(held, at.y[method.controls])


def test_a_diverging_guess_leaves_the_others_in_the_race() -> None:
    setting: Settings = {
        "system": "double-pendulum",
        "guess": "controls",
        "guess_size": 1.0,
        "horizon": 4.0,
        "pieces": 4.0,
        "steps": 1.0,
        "iterations": 2.0,
    }
    found = entrants(setting)
    assert "first guess diverges" in found["single"].stopped
    assert found["collocation"].history.iterations == 2
    assert all(np.isfinite(at.history.cost).all() for at in found.values())


def test_verdicts_name_who_failed_and_who_arrived() -> None:
    found = entrants({"system": "upright", "segments": 10.0})
    said = outcome_message(found)
    assert "Single shooting: infeasible" in said
    assert "Collocation: converged after 2 iterations." in said
    assert outcome_message(entrants({"system": "mass"})).startswith("All three converged.")


@pytest.mark.parametrize(("system", "said"), [("cart-pole", "the pole's v"), ("ur5", "the tip's")])
def test_all_methods_call_what_is_missed_the_same(system: str, said: str) -> None:
    params = DirectMethodsParams(system=system, pieces=4.0)
    methods = transcribe(params.problem, params.N, params.m, params.M).values()
    found = set()
    for method in methods:
        equalities = len(method.program.values(method.variables(first_guess(params, params.N))).c)
        found.add(method.program.equality_name(equalities - 1))
    (name,) = found
    assert name.startswith(said)
    assert name.endswith("at the end")


@pytest.mark.parametrize("system", ["double-pendulum", "ur5"])
def test_the_greatest_final_speed_is_found_by_all(system: str) -> None:
    """By the settings that the choice of the system brings."""
    world = World(find_lab("direct-methods"), {"objective": "fastest-end"})
    world.change({"system": system})
    solve(world)
    assert stop_reason(world).startswith("All three converged")


def test_a_solve_that_failed_is_begun_anew_and_one_that_ran_out_of_iterations_goes_on() -> None:
    world = solved({"limited": True, "limit": 0.3, "horizon": 1.0})
    assert "infeasible" in outcome_message(state(world).race)
    world.change({"horizon": 2.0, "limited": False})
    solve(world)
    again, first = state(world).race, entrants({})
    assert iterations(again) == iterations(first)
    assert costs(again) == costs(first)
    world = solved({"iterations": 3.0})
    violation = state(world).race["collocation"].history.violation[-1]
    world.change({"iterations": 100.0})
    solve(world)
    history = state(world).race["collocation"].history
    assert history.violation[0] == pytest.approx(violation, rel=1e-6)
    assert outcome_message(state(world).race).startswith("All three converged")


def test_another_plan_is_played_without_solving_again() -> None:
    world = solved({})
    found = state(world).race
    world.change({"played": "single"})
    world.advance()
    assert not world.solving
    assert state(world).race is found
    assert state(world).motion is found["single"].motion


def test_a_warm_start_is_quicker() -> None:
    world = solved({})
    cold = state(world).race["single"].history.iterations
    world.change({"horizon": 2.1})
    solve(world)
    assert state(world).race["single"].converged
    assert state(world).race["single"].history.iterations < cold / 2


def test_the_scene_shows_three_plans_or_one_played() -> None:
    world = solved({"system": "upright", "segments": 10.0})
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert {f"robot of {name}" for name in TRANSCRIPTIONS} <= set(scene.names)
    assert "open loop" not in scene.names
    scene = NullScene()
    world.lab.draw(scene, world.params.change({"view": "played"}), world.state)
    assert {"robot", "open loop"} <= set(scene.names)
