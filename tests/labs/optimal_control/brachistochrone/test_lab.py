"""What the lab brachistochrone must obey: its race, its handles and its optimiser's clock."""

import numpy as np
import pytest

from labs.engine.events import Event
from labs.engine.headless import run_headless
from labs.optimal_control.brachistochrone.params import BrachistochroneParams
from labs.optimal_control.brachistochrone.race import CYCLOID, OPTIMISED, simulate_race
from labs.scene import NullScene
from tests.labs.optimal_control.brachistochrone.test_article import (
    delays,
    excess,
    race,
    solved,
    state,
)
from tests.labs.solving import solve, solve_to_convergence

# The race -------------------------------------------------------------------------------------


def test_who_has_arrived_is_told_in_order() -> None:
    world = solved({})

    def notes() -> list[str]:
        return str(world.lab.notes(world.params, world.state)["finish"]).split("\n")

    assert notes() == ["The beads are on their way."]
    while world.state.t < 0.825:
        world.advance()
    assert notes() == ["1. Cycloid: 0.8056 s.", "2. Optimised: 0.8056 s."]
    while world.state.t < 1.3:
        world.advance()
    assert [line[:5] for line in notes()] == ["1. Cy", "2. Op", "3. Ci", "4. St", "5. St", "6. Yo"]
    while state(world).race_steps:
        world.advance()
    assert world.state.t == pytest.approx(race(world).duration + 1.5, abs=0.011), "and once more"


def test_energy_adds_up_in_what_is_measured() -> None:
    world = solved({"mu": 0.2})
    for _ in range(150):
        world.advance()
    shown = world.lab.measure(world.params, world.state)
    total = sum(np.asarray(shown[name]) for name in ("kinetic", "potential", "heat"))
    depth = world.params.depth  # type: ignore[attr-defined]
    np.testing.assert_allclose(total, 9.81 * depth, rtol=1e-8)


def test_out_of_reach_is_said_and_nothing_is_solved() -> None:
    world = solved({"mu": 0.6})
    assert world.latest is not None
    assert world.latest.done.startswith(
        "No curve arrives: up to B friction takes the height of 1.2"
    )
    assert not len(state(world).history.cost)
    for _ in range(800):
        world.advance()
    assert not world.trouble
    assert "stuck" in world.lab.notes(world.params, world.state)["finish"]
    shown = world.lab.measure(world.params, world.state)
    assert not [name for name in shown if name.startswith(("behind", "fastest"))]
    world.change({"mu": 0.1})
    solve(world)
    assert delays(world)[OPTIMISED] < 0.2


@pytest.mark.parametrize("g", [1.62, 24.8])
def test_gravity_changes_the_time_and_not_the_curve(g: float) -> None:
    here, there = solved({}), solved({"g": g})
    np.testing.assert_allclose(
        state(here).history.nodes, state(there).history.nodes, rtol=1e-4, atol=1e-6
    )
    ratio = race(there).times / race(here).times
    np.testing.assert_allclose(ratio, np.sqrt(9.81 / g), rtol=1e-6)


# Handles --------------------------------------------------------------------------------------


def test_what_is_dragged_follows_the_hand() -> None:
    world = solved({})
    world.hold("B", (0.3, 1.504, 0.2))
    assert (world.params.x_b, world.params.z_b) == (1.5, 0.2)  # type: ignore[attr-defined]
    solve(world)
    assert delays(world)[OPTIMISED] < 0.1
    world.hold("A", (0.0, 0.1, 1.5))
    world.hold("knee", (0.0, 0.6, 0.7))
    assert (world.params.x_k, world.params.y_k) == (0.5, 0.8)  # type: ignore[attr-defined]
    world.hold("control 2", (0.0, 99.0, 99.0))
    assert (world.params.x_2, world.params.y_2) == (3.0, 0.05)  # type: ignore[attr-defined]


def test_a_start_is_dragged_along_its_curve() -> None:
    params = BrachistochroneParams(race="starts", release=0.3)
    start = simulate_race(params, np.zeros((2, 2))).starts[-1]
    place = (0.0, *params.world_points(start)[0, 1:])
    world = solved({"race": "starts"})
    world.hold("release", place)
    assert world.params.release == 0.3  # type: ignore[attr-defined]


# The optimiser's clock ------------------------------------------------------------------------


def test_a_warm_start_is_shorter_and_stays_where_it_was() -> None:
    world = solved({"start": "cold"})
    cold = len(excess(world))
    world.change({"start": "warm"})
    world.change({"g": 9.0})
    solve(world)
    assert len(excess(world)) < 0.7 * cold
    assert excess(world)[0] < 1.0
    world.change({"grid": "even", "segments": 25.0, "z_b": 0.3})
    solve_to_convergence(world)


def test_looking_back_races_that_curve() -> None:
    world = solved({"start": "cold"})
    last = race(world).times[OPTIMISED]
    world.show(1)
    assert len(excess(world)) == 2
    assert race(world).times[OPTIMISED] == pytest.approx(last + 0.05, abs=0.01)
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert [name for name in scene.names if name.startswith("before")]


def test_a_run_with_a_dragged_end_is_repeated_exactly() -> None:
    drag = Event(40, "hold", "B", (0.0, 1.5, 0.3))
    once, again = (
        run_headless("brachistochrone", {}, seconds=0.5, events=(drag,)) for _ in range(2)
    )
    np.testing.assert_array_equal(
        once.recording().channels["speed"], again.recording().channels["speed"]
    )
    assert race(once).times[CYCLOID] < 0.8
