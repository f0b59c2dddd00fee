"""What the article of the lab mpc-uncertainty claims, in numbers."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import norm

from labs.engine.run import World
from labs.optimal_control.mpc_uncertainty.controllers import (
    NOMINAL,
    ROBUST,
    STOCHASTIC,
    controllers,
)
from labs.optimal_control.mpc_uncertainty.lab import UncertaintyState
from labs.optimal_control.mpc_uncertainty.params import UncertaintyParams
from labs.optimal_control.mpc_uncertainty.statistics import (
    ARRIVAL_STEP,
    Counts,
    confidence_interval,
)
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import Settings, readouts, solved_world, stop_reason

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "mpc_uncertainty")
verify = EXPERIMENTS.verify


@cache
def _solved(*setting: tuple[str, float | str | bool]) -> World:
    return solved_world("mpc-uncertainty", dict(setting))


def solved(setting: Settings) -> World:
    """With what is only shown left as it is: each simulation is done once."""
    return _solved(*sorted((k, v) for k, v in setting.items() if k not in ("shown", "zoom")))


def state(setting: Settings) -> UncertaintyState:
    found = solved(setting).state
    assert isinstance(found, UncertaintyState)
    return found


def counts(setting: Settings) -> Counts:
    return state(setting).counts


def closest(setting: Settings, controller: int) -> float:
    """[m] how far from the wall the farthest run stays, once arrived; negative behind it."""
    wall = float(setting.get("wall", UncertaintyParams().wall))
    return float(wall - state(setting).runs.X[controller, ARRIVAL_STEP:, :, 0].max())


@verify("A hundred carts")
def test_nominal_mpc_at_the_wall(setting: Settings) -> None:
    found = counts(setting)
    assert found.held[NOMINAL] == pytest.approx(0.36, abs=0.005)
    assert found.ever[NOMINAL] == 0.98
    assert found.unplanned[NOMINAL] == pytest.approx(0.37, abs=0.005)
    assert EXPERIMENTS.answer("A hundred carts") == "About a third."


@verify("In its tube")
def test_robust_mpc_never_breaks_it(setting: Settings) -> None:
    found = counts(setting)
    assert found.ever[ROBUST] == 0.0 == EXPERIMENTS.answer("In its tube")
    assert found.distance[ROBUST] == pytest.approx(0.21, abs=0.005)
    assert found.distance[NOMINAL] == pytest.approx(0.014, abs=5e-4)
    assert found.cost[[NOMINAL, ROBUST]] == pytest.approx([124.9, 143.5], abs=0.05)
    assert closest(setting, ROBUST) == pytest.approx(0.11, abs=0.005)


@verify("The worst that W allows")
def test_the_worst_disturbance_reaches_the_wall(setting: Settings) -> None:
    found = counts(setting)
    assert closest(setting, ROBUST) == pytest.approx(4e-4, abs=5e-5)
    assert found.ever[ROBUST] == 0.0
    assert found.held[STOCHASTIC] == pytest.approx(0.35, abs=0.005)
    assert found.ever[STOCHASTIC] == 1.0
    assert EXPERIMENTS.answer("The worst that W allows") == "To within a millimetre."


@verify("A stiff gain")
def test_a_stiff_gain_makes_a_narrow_tube(setting: Settings) -> None:
    distances = [counts(s).distance[ROBUST] for s in (setting, {}, {"r_K": 3.0})]
    assert distances == pytest.approx([0.10, 0.21, 0.48], abs=0.005)
    designs = [controllers(UncertaintyParams(r_K=r_K)) for r_K in (0.01, 0.3)]
    force = [design.problems[ROBUST].control_set.h[0] for design in designs]
    assert force == pytest.approx([0.72, 1.0], abs=0.01)
    assert (np.abs(designs[0].K) > 1.7 * np.abs(designs[1].K)).all()
    assert counts(setting).cost[ROBUST] == pytest.approx(137.0, abs=0.05)
    assert EXPERIMENTS.answer("A stiff gain") == "It halves."


@verify("So careful that nothing is left")
def test_large_disturbances_leave_nothing(setting: Settings) -> None:
    design = controllers(UncertaintyParams(w_v=0.25))
    assert [len(corners) > 2 for corners in design.feasible] == [True, True, False]
    assert 2.0 - design.problems[ROBUST].control_set.h[0] == pytest.approx(2.03, abs=0.005)
    assert list(counts(setting).unplanned[[STOCHASTIC, ROBUST]]) == [0.0, 1.0]
    world = solved(setting)
    assert "Robust MPC finds no plan" in stop_reason(world)
    assert "nothing is left of U" in world.lab.notes(world.params, world.state)["promise"]
    assert len(controllers(UncertaintyParams(w_v=0.2)).feasible[ROBUST]) > 2
    assert EXPERIMENTS.answer("So careful that nothing is left") == "From nowhere."


@verify("Nine times in ten")
def test_each_step_keeps_its_promise_and_all_of_them_do_not(setting: Settings) -> None:
    found = counts(setting)
    assert found.ever[STOCHASTIC] == 0.65
    assert found.held[STOCHASTIC] == pytest.approx(0.095, abs=5e-4)
    assert found.beyond[STOCHASTIC, -1] == 0.09
    assert confidence_interval(UncertaintyParams()) == (0.05, 0.16)
    assert found.cost[STOCHASTIC] == pytest.approx(135.6, abs=0.05)
    quantiles = norm.ppf([0.5, 0.9, 0.999])
    assert quantiles == pytest.approx([0.0, 1.28, 3.09], abs=0.005)
    careful = counts({"probability": 99.0})
    assert careful.ever[STOCHASTIC] == 0.06
    assert careful.cost[STOCHASTIC] == pytest.approx(144.5, abs=0.05)
    assert EXPERIMENTS.answer("Nine times in ten") == "About two thirds."


@verify("Planned from what is measured")
def test_planning_from_the_measured_state(setting: Settings) -> None:
    found = counts(setting)
    assert found.held[STOCHASTIC] == pytest.approx(0.02, abs=0.005)
    assert found.cost[STOCHASTIC] == pytest.approx(130.8, abs=0.05)
    assert found.unplanned[STOCHASTIC] == pytest.approx(0.06, abs=0.005)
    assert counts({}).unplanned[STOCHASTIC] == 0.0
    assert EXPERIMENTS.answer("Planned from what is measured") == "Fewer than 10 %."


@verify("A bound that is none")
def test_gaussian_noise_leaves_the_tube(setting: Settings) -> None:
    found = counts(setting)
    assert found.ever[ROBUST] == 1 / 400
    assert found.unplanned[ROBUST] == pytest.approx(0.04, abs=0.005)
    assert found.held[STOCHASTIC] == pytest.approx(0.10, abs=0.005)
    margins = controllers(UncertaintyParams(kind="gaussian", width=1.0)).margins()[:, -1]
    assert margins[[STOCHASTIC, ROBUST]] == pytest.approx([0.08, 0.21], abs=0.005)
    assert (2.0 * norm.cdf(1.0) - 1.0) ** 2 < 0.5, "w is outside W more often than inside"
    assert EXPERIMENTS.answer("A bound that is none") == "One or none."


def test_the_tiles_say_what_was_counted() -> None:
    shown, found = readouts(solved({})), counts({})
    assert shown["risk"] == pytest.approx(10.0)
    assert shown["held_stochastic"] == pytest.approx(100.0 * found.held[STOCHASTIC])
    assert shown["unplanned_nominal"] == pytest.approx(100.0 * found.unplanned[NOMINAL])


def test_the_note_says_what_was_promised() -> None:
    world = solved({})
    said = world.lab.notes(world.params, world.state)["promise"]
    assert "98 of 100 have been beyond" in said
    assert "At the end 9 are beyond; 5 to 16 would be usual. At some step 65 have been" in said
    assert said.endswith("0 have been beyond.")


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
