"""What the article of the lab mpc-stability claims, in numbers."""

import numpy as np
import pytest

from labs.optimal_control.mpc_stability.params import MpcStabilityParams
from tests.labs.experiments import ArticleExperiments
from tests.labs.optimal_control.mpc_stability.simulation import Settings, simulate, value_changes

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "mpc_stability")
verify = EXPERIMENTS.verify
HOLDS, FAILS = "✓", "✗"


@verify("Optimal, and it falls")
def test_optimal_plans_that_fall(setting: Settings) -> None:
    found = simulate(setting, 3.6)
    assert found.notes["run"] == "37 plans, each solved to optimality."
    assert found.run.V[0] == pytest.approx(0.01, abs=5e-4)
    assert (value_changes(found) > 0.0).all()
    assert EXPERIMENTS.answer("Optimal, and it falls") == "It rises."
    assert "After 3.70 s it is far out" in simulate(setting, 3.8).notes["run"]
    assert found.tiles["rises"] > 50.0
    assert "Not all hold" in found.notes["assumptions"]


@verify("Look farther")
def test_the_least_horizon(setting: Settings) -> None:
    least = next(N for N in range(1, 20) if keeps_running({**setting, "N": float(N)}))
    assert least == EXPERIMENTS.answer("Look farther") == setting["N"]
    found = simulate(setting, 3.0)
    assert (value_changes(found) < 0.0).all()
    assert (found.run.decrease_excess > 0.0).all(), "by less than l"
    assert found.tiles["falls"] < 1.0
    assert not keeps_running({**setting, "r": 10.0})


def keeps_running(setting: Settings) -> bool:
    return not simulate(setting, 5.0).run.end_reason


@verify("The tail as a price")
def test_riccatis_price_makes_one_step_enough(setting: Settings) -> None:
    found = simulate(setting, 5.0)
    assert EXPERIMENTS.answer("The tail as a price") == setting["N"] == 1.0
    assert np.abs(found.run.x).max() < 1e-6
    K = MpcStabilityParams(**setting).formulation.K  # type: ignore[arg-type]
    np.testing.assert_allclose(found.run.controller.u, K @ found.run.path[-1], atol=1e-9)
    longer = simulate({**setting, "N": 10.0}, 5.0)
    np.testing.assert_allclose(longer.run.path, found.run.path, atol=1e-9)
    assert found.tiles["rises"] > 40.0
    assert not keeps_running({**setting, "q0": 0.42})
    assert keeps_running({**setting, "q0": 0.4})


@verify("Where the promise holds")
def test_the_promise_holds_on_all_of_the_feasible_states(setting: Settings) -> None:
    found = simulate(setting, 5.0)
    assert found.tiles["falls"] == pytest.approx(100.0)
    assert found.notes["assumptions"].count(HOLDS) == 4
    assert "All hold" in found.notes["assumptions"]
    assert found.run.decrease_excess.max() < 1e-9


@verify("Only the origin")
def test_ending_at_the_origin_takes_a_small_basin(setting: Settings) -> None:
    found = simulate(setting, 3.0)
    assert found.tiles["area"] == pytest.approx(1.98, abs=5e-3)
    assert found.tiles["falls"] == pytest.approx(100.0)
    assert found.notes["assumptions"].count(HOLDS) == 4
    whole = simulate({"N": 3.0}, 0.0)
    assert whole.tiles["area"] == pytest.approx(3.53, abs=5e-3)
    areas = [simulate({**setting, "N": N}, 0.0).tiles["area"] for N in (1.0, 2.0, 4.0)]
    np.testing.assert_allclose(areas[:2], [0.0, 0.62], atol=5e-3)
    assert areas[2] > found.tiles["area"]


@verify("Any gain will do")
def test_a_lazy_gain_keeps_the_promise_on_a_larger_set(setting: Settings) -> None:
    lazy, best = simulate(setting, 5.0), simulate({**setting, "rho": 1.0}, 1.0)
    assert "larger" in str(EXPERIMENTS.answer("Any gain will do"))
    for found, numbers in ((lazy, (3.53, 3.45, 1.50)), (best, (1.85, 1.36, 1.15))):
        assert found.tiles["falls"] == pytest.approx(100.0)
        assert found.notes["assumptions"].count(HOLDS) == 4
        said = (found.tiles["area"], found.tiles["terminal_area"], found.run.V[0])
        np.testing.assert_allclose(said, numbers, atol=6e-3)


@verify("Follow a motion")
def test_a_motion_is_followed_without_error(setting: Settings) -> None:
    found = simulate(setting, 10.0)
    assert found.run.decrease_excess.max() < 1e-9
    assert (value_changes(found)[:20] < 0.0).all()
    assert found.run.V[-1] < 1e-6
    assert found.tiles["q"] == pytest.approx(found.tiles["q_ref"], abs=1e-3)
    assert found.tiles["terminal_area"] == pytest.approx(0.46, abs=5e-3)
    slower = simulate({**setting, "amplitude": 0.1}, 0.0)
    assert slower.tiles["terminal_area"] == pytest.approx(1.02, abs=5e-3)


@verify("A cost that is no distance")
def test_an_economic_cost_has_no_lyapunov_function(setting: Settings) -> None:
    found = simulate(setting, 15.0)
    assert EXPERIMENTS.answer("A cost that is no distance") == "It rests, and V* rises."
    assert (value_changes(found)[:22] > 0.0).all()
    assert found.run.V[0] == pytest.approx(-7.5, abs=0.05)
    assert found.run.V[22] == pytest.approx(-4.5, abs=0.05)
    assert found.run.x[0] == pytest.approx(0.13, abs=5e-3)
    assert abs(found.run.x[1]) < 1e-6
    assert f"{FAILS} 3b" in found.notes["assumptions"]
    longer = simulate({**setting, "N": 40.0}, 15.0)
    assert abs(longer.run.x[0]) < 2e-3


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
