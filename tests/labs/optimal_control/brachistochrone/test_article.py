"""What the article of the lab brachistochrone claims, in numbers."""

from collections.abc import Mapping

import numpy as np
import pytest

from labs.engine.run import World
from labs.optimal_control.brachistochrone.lab import BrachistochroneState
from labs.optimal_control.brachistochrone.race import (
    CIRCLE,
    CURVE_NAMES,
    CYCLOID,
    KNEE,
    LINE,
    OPTIMISED,
    YOURS,
    BeadRace,
    simulate_race,
)
from tests.labs.experiments import ArticleExperiments
from tests.labs.solving import Settings, solved_world

EXPERIMENTS = ArticleExperiments("labs.optimal_control", "brachistochrone")
verify = EXPERIMENTS.verify


def solved(setting: Settings) -> World:
    return solved_world("brachistochrone", setting)


def state(world: World) -> BrachistochroneState:
    assert isinstance(world.state, BrachistochroneState)
    return world.state


def race(world: World) -> BeadRace:
    return simulate_race(world.params, state(world).history.nodes)  # type: ignore[arg-type]


def delays(world: World) -> np.ndarray:
    """[ms] the six, behind the fastest there is."""
    shown = world.lab.measure(world.params, world.state)
    return np.array([shown.get(f"behind_{name}", np.inf) for name in CURVE_NAMES])


def excess(world: World) -> np.ndarray:
    """[ms] of the iterations."""
    return np.asarray(world.lab.fields(world.params, world.state)["excess"])


@verify("Who is first?")
def test_the_cycloid_is_first(setting: Settings) -> None:
    world = solved(setting)
    late = delays(world)
    assert race(world).times[CYCLOID] == pytest.approx(0.806, abs=5e-4)
    assert late[CYCLOID] == pytest.approx(0.0, abs=1e-3)
    np.testing.assert_allclose(late[[CIRCLE, KNEE, LINE]], [25, 41, 204], atol=0.5)
    assert race(world).finishing_order[0] == CYCLOID
    assert world.params.y_1 / world.params.x_1 < 0.3  # type: ignore[attr-defined]
    assert EXPERIMENTS.answer("Who is first?") == "The cycloid."


@verify("Fastest on arrival")
def test_all_are_equally_fast_at_b(setting: Settings) -> None:
    world = solved(setting)
    arrivals = [descent.speed[-1] for descent in race(world).descents]
    np.testing.assert_allclose(arrivals, 4.43, atol=1e-3)
    assert race(world).descents[CIRCLE].speed.max() > 4.9, "it dips below B"
    assert EXPERIMENTS.answer("Fastest on arrival") == "All are equally fast."


@verify("Bend your own")
def test_a_curve_bent_by_hand_is_nearly_as_fast(setting: Settings) -> None:
    world = solved(setting)
    late = delays(world)
    assert late[YOURS] == pytest.approx(7.4, abs=0.05)
    assert late[YOURS] < late[CIRCLE]
    law = world.lab.fields(world.params, world.state)["snell"]
    np.testing.assert_allclose(law[:, CYCLOID], 1.0, atol=0.01)
    x = world.lab.fields(world.params, world.state)["snell_x"][:, YOURS]
    assert (law[x < 0.3, YOURS] < 0.92).all()
    np.testing.assert_allclose(law[x > 0.7, YOURS], 1.0, atol=0.015)
    better = dict(zip(("x_1", "y_1", "x_2", "y_2", "x_3", "y_3"), BETTER, strict=True))
    assert delays(solved({**setting, **better}))[YOURS] < 0.01


BETTER = (0.0, 0.05, 0.07, 0.6, 0.94, 1.2)


@verify("From anywhere")
def test_all_arrive_at_once_on_the_cycloid_alone(setting: Settings) -> None:
    world = solved(setting)
    shown = world.lab.measure(world.params, world.state)
    assert shown["isochrone"] == pytest.approx(0.721, abs=5e-4)
    np.testing.assert_allclose(race(world).times, shown["isochrone"], rtol=1e-6)
    lengths = [np.hypot(*np.diff(path, axis=0).T).sum() for path in race(world).paths]
    assert lengths[0] / lengths[4] == pytest.approx(5.0, rel=1e-5)
    assert all(race(world).rank(i) == 1 for i in range(6))
    quadrant = solved({**setting, "shape": "circle"})
    spread = quadrant.lab.measure(quadrant.params, quadrant.state)["spread"]
    assert spread == pytest.approx(89, abs=0.5)
    assert (np.diff(race(quadrant).times[:5]) < 0.0).all(), "the higher the later"
    assert EXPERIMENTS.answer("From anywhere") == "All at once."


@verify("From a straight line")
def test_newton_finds_the_cycloid(setting: Settings) -> None:
    world = solved(setting)
    gaps = excess(world)
    assert gaps[0] == pytest.approx(204, abs=0.5)
    assert len(gaps) - 1 == 12
    first = int(np.flatnonzero(gaps < delays(world)[CIRCLE])[0])
    assert EXPERIMENTS.answer("From a straight line") == first
    assert gaps[-1] == pytest.approx(0.07, abs=5e-3)
    zeros = -np.log10(state(world).history.gradient[-4:])
    assert (np.diff(zeros) > 0.6).all()
    assert np.diff(zeros)[-1] > 1.5 * np.diff(zeros)[0]
    nodes = state(world).history.nodes
    on_cycloid = np.stack([np.interp(nodes[:, 0], *race(world).paths[CYCLOID].T)])
    np.testing.assert_allclose(nodes[1:, 1], on_cycloid[0, 1:], atol=5e-3)


@verify("Where the nodes lie")
def test_the_grid_sets_the_order(setting: Settings) -> None:
    def errors(changes: Settings) -> Mapping[float, float]:
        world = solved({**setting, **changes})
        shown = world.lab.fields(world.params, world.state)
        return dict(zip(shown["grid_segments"], shown["grid_error"], strict=True))

    even, close = errors({}), errors({"grid": "clustered"})
    assert list(even) == [5, 10, 20, 40, 80, 160, 320]
    for N in (20, 40, 80, 160):
        assert even[N] / even[2 * N] == pytest.approx(2.0, abs=0.1)
        assert close[N] / close[2 * N] == pytest.approx(4.0, abs=0.05)
    assert errors({"segments": 100.0})[100] == pytest.approx(9e-4, abs=5e-5)
    fine = errors({"segments": 100.0, "grid": "clustered"})[100]
    assert fine == pytest.approx(1.5e-5, abs=5e-7)
    assert EXPERIMENTS.answer("Where the nodes lie") == "To a half."


@verify("A floor")
def test_a_floor_is_run_along(setting: Settings) -> None:
    world = solved(setting)
    assert world.params.depth == pytest.approx(0.2)  # type: ignore[attr-defined]
    assert race(world).paths[CYCLOID][:, 1].max() == pytest.approx(0.98, abs=5e-3)
    y = state(world).history.nodes[:, 1]
    along = np.flatnonzero(y > 0.5 - 1e-9)
    assert y.max() <= 0.5 + 1e-12
    assert len(along) > 10
    assert y[-1] < 0.5, "and up again"
    late = delays(world)
    assert late[OPTIMISED] == pytest.approx(81, abs=0.5)
    assert late[LINE] == pytest.approx(1840, abs=10)
    assert EXPERIMENTS.answer("A floor") == "It runs along the floor for a while."


@verify("With friction")
def test_with_friction_another_curve_is_the_fastest(setting: Settings) -> None:
    world = solved(setting)
    late = delays(world)
    assert late[CYCLOID] - late[OPTIMISED] == pytest.approx(17, abs=0.5)
    assert late[CYCLOID] - late[CIRCLE] == pytest.approx(12, abs=0.5)
    assert not race(world).descents[YOURS].arrived
    assert 0.0 < late[OPTIMISED] < 0.2
    assert EXPERIMENTS.answer("With friction") == "No, another curve is faster."


def test_every_experiment_is_verified() -> None:
    EXPERIMENTS.check_all_are_verified()
