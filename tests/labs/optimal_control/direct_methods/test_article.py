"""Every experiment of the article, in numbers, with its own settings."""

import numpy as np
import pytest

from tests.labs.experiments import ArticleExperiments
from tests.labs.optimal_control.direct_methods.simulation import (
    NAMES,
    Settings,
    costs,
    entrants,
    goal_errors,
    iterations,
)

ARTICLE = ArticleExperiments("labs.optimal_control", "direct_methods")


def test_every_experiment_is_verified() -> None:
    ARTICLE.check_all_are_verified()


@ARTICLE.verify("Three at the start")
def test_the_largest_problem_takes_no_more_iterations(setting: Settings) -> None:
    found = entrants(setting)
    sizes = [(found[n].structure.variables, found[n].structure.constraints) for n in NAMES]
    assert sizes == [(20, 2), (30, 12), (62, 44)]
    assert sizes[2][0] == ARTICLE.answer("Three at the start")
    assert all(entrant.converged for entrant in found.values())
    assert iterations(found) == [16, 7, 7]
    np.testing.assert_allclose(costs(found), [0.186, 0.186, 0.227], atol=5e-4)


@ARTICLE.verify("Twice as fine")
def test_full_matrices_grow_fourfold(setting: Settings) -> None:
    fine = {n: at.structure for n, at in entrants(setting).items()}
    coarse = {n: at.structure for n, at in entrants({}).items()}
    assert [fine[n].nonzeros for n in NAMES] == [1680, 500, 1248]
    assert [coarse[n].nonzeros for n in NAMES] == [440, 250, 628]
    assert [fine[n].variables for n in NAMES] == [40, 60, 122]
    np.testing.assert_allclose([fine[n].density for n in NAMES], [1.0, 0.10, 0.05], atol=5e-3)
    assert ARTICLE.answer("Twice as fine") == "Single shooting's."


@ARTICLE.verify("A straight line")
def test_single_shooting_cannot_be_told_where_to_go(setting: Settings) -> None:
    found = entrants(setting)
    assert [found[n].converged for n in NAMES] == [False, True, True]
    assert max(iterations(found)[1:]) <= 20
    assert 0.5 < found["single"].history.violation[-1] < 1.2
    assert found["single"].stopped.startswith("Infeasible")
    still = entrants({**setting, "guess": "still"})
    assert iterations(still)[2] > 3 * iterations(found)[2]
    assert ARTICLE.answer("A straight line") == "All but single shooting."


@ARTICLE.verify("How long is a tangent true?")
def test_tangents_of_single_shooting_are_false(setting: Settings) -> None:
    found = entrants(setting)
    missed = [found[n].structure.nonlinearity for n in NAMES]
    np.testing.assert_allclose(missed, [0.99, 1e-4, 0.0], rtol=0.2, atol=0.0)
    assert iterations(found) == [31, 2, 2]
    assert ARTICLE.answer("How long is a tangent true?") == "By about 100 %."


@ARTICLE.verify("Half a second more")
def test_single_shooting_fails_upright(setting: Settings) -> None:
    found = entrants(setting)
    assert [found[n].converged for n in NAMES] == [False, True, True]
    assert found["single"].stopped.startswith("Infeasible")
    assert iterations(found)[1:] == [2, 2]
    condition = [found[n].structure.condition for n in NAMES]
    np.testing.assert_allclose(condition, [9.2e5, 280, 190], rtol=0.05)
    gravity, length = 9.81, 0.5
    rate = np.sqrt(gravity * length / 2 / (length**2 / 3))
    assert np.exp(0.5 * rate) == pytest.approx(15, abs=0.5)


@ARTICLE.verify("The grid is what it is")
def test_a_coarse_grid_plans_another_motion(setting: Settings) -> None:
    feedback, open_loop = goal_errors(setting)
    assert open_loop == pytest.approx(0.59, abs=5e-3)
    assert feedback < 0.002
    assert goal_errors({**setting, "played": "single"})[1] < 0.001
    assert entrants(setting)["collocation"].history.violation[-1] < 1e-8


@ARTICLE.verify("An unknown payload")
def test_feedback_carries_an_unknown_payload(setting: Settings) -> None:
    feedback, open_loop = goal_errors(setting)
    assert feedback == pytest.approx(0.003, abs=5e-4)
    assert open_loop == pytest.approx(0.82, abs=5e-3)


@ARTICLE.verify("Fast at the end")
def test_what_is_best_agrees_with_the_closed_forms(setting: Settings) -> None:
    found = entrants(setting)
    np.testing.assert_allclose(costs(found), -1.463, atol=5e-4)
    assert iterations(found) == [1, 1, 1]
    for entrant in found.values():
        u = entrant.motion.U[:, 0, 0]
        assert u[0] == pytest.approx(-1.0)
        assert u[-1] == pytest.approx(1.0)
        backward = entrant.motion.T * np.mean(u < -0.5)
        assert 0.15 <= backward <= 0.35
    assert 2 * np.sqrt(3) - 2 == pytest.approx(1.464, abs=5e-4)
    fastest = entrants({**setting, "objective": "least-time"})
    np.testing.assert_allclose(costs(fastest), 2.0, atol=1e-6)
    sparing = entrants({**setting, "objective": "least-energy"})
    np.testing.assert_allclose(costs(sparing), 1.5 / (1 - 1 / 20**2), atol=1e-6)


@ARTICLE.verify("Too much to ask")
def test_what_cannot_be_is_called_infeasible(setting: Settings) -> None:
    found = entrants(setting)
    for entrant in found.values():
        assert entrant.failed
        assert entrant.stopped.startswith("Infeasible")
        assert entrant.history.violation[-1] > 1.0
    assert found["single"].history.violation[-1] == pytest.approx(2.0, abs=0.05)
    assert any("start of" in found[n].stopped for n in ("multiple", "collocation"))
