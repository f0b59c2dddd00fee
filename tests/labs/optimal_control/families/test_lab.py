"""What the two clocks of the lab families must obey, and what its picture and plots tell."""

from dataclasses import replace

import numpy as np
import pytest

from labs.optimal_control.families import global_methods, side_by_side
from labs.optimal_control.families.comparison import cost_until
from labs.optimal_control.families.lab import REST_DURATION, Families, FamiliesState
from labs.optimal_control.families.params import WINDOWS, FamiliesParams
from labs.optimal_control.families.picture import (
    ABOVE,
    LAYOUTS,
    CostToGoSurface,
    floor_points,
    state_at,
)
from labs.scene import NullScene
from tests.labs.optimal_control.families.simulation import (
    COARSE,
    costs,
    measured,
    params,
    results,
    solve,
    solved,
    stop_reason,
)

# The solver's clock ---------------------------------------------------------------------------


def test_a_table_serves_every_start() -> None:
    def table(angle: float) -> global_methods.CostToGoTable:
        parts = global_methods.compute_table(FamiliesParams(angle=angle), "hjb", 21)
        *_, last = (part for part in parts if part)
        assert last.table is not None
        return last.table

    assert table(3.0) is table(1.0)
    world = solved({**COARSE, "angle": 1.0})
    rounds = world.latest
    world.change({"angle": 1.5})
    solve(world)
    global_methods._table_cache.clear()
    again = solved({**COARSE, "angle": 1.5})
    assert rounds is not None
    np.testing.assert_array_equal(results(world).motions["hjb"].X, results(again).motions["hjb"].X)
    assert world.latest is not None
    assert again.latest is not None
    assert world.latest.iteration == again.latest.iteration


@pytest.mark.parametrize("moment", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("setting", [{}, {"u_max": 2.5}, {"system": "mass"}], ids=str)
def test_every_tail_is_optimal(setting: dict[str, float], moment: float) -> None:
    world = solved({**COARSE, **setting, "moment": moment})
    assert measured(world)["tail_gap"] < 0.2, "of the largest angle or velocity, in percent"
    assert measured(world)["tail_cost_gap"] < 0.02


def test_what_was_paid_and_what_is_left_make_the_whole() -> None:
    world = solved(COARSE)
    motion = results(world).motions["pontryagin"]
    whole = cost_until(params(world), motion, 1.5) + params(world).cost.final(motion.X[-1])
    assert whole == pytest.approx(motion.cost, rel=1e-4)
    assert cost_until(params(world), motion, 0.0) == 0.0


def test_a_warm_start_follows_a_slider_where_a_cold_one_is_lost() -> None:
    lost = solved({**COARSE, "horizon": 2.0})
    assert not results(lost).motions["pontryagin"].converged
    world = solved({**COARSE, "start": "warm"})
    for horizon in (1.6, 1.7, 1.8, 1.9, 2.0):
        world.change({"horizon": horizon})
        solve(world)
    assert results(world).motions["pontryagin"].cost == pytest.approx(6.036, abs=1e-3)


def test_what_failed_has_no_motion_and_says_why() -> None:
    world = solved({**COARSE, "horizon": 2.0})
    motion = results(world).motions["pontryagin"]
    assert not motion.known
    assert "cost_pontryagin" not in measured(world)
    assert stop_reason(world).startswith("3 of four have found a motion")
    assert "Pontryagin: Stopped short" in stop_reason(world)
    found = world.lab.fields(world.params, world.state)
    assert not len(found["q_pontryagin"])
    assert np.isnan(found["costs"][2])
    assert len(found["q_direct"])
    assert "Stopped short" in world.lab.notes(world.params, world.state)["account"]
    assert measured(world)["gradient_gap"] > 0.0, "measured by the direct method's"


def test_limits_on_q_are_kept_to_at_a_price() -> None:
    free, cheap, dear = (
        solved({**COARSE, "u_max": 3.0, **more})
        for more in ({}, {"limited": True, "rho": 10.0}, {"limited": True, "rho": 1000.0})
    )
    for name in ("hjb", "direct"):
        most = [results(world).motions[name].X[:, 0].max() for world in (free, cheap, dear)]
        paid = [costs(world)[name] for world in (free, cheap, dear)]
        assert most[0] > most[1] > most[2], name
        assert paid[0] < paid[1] < paid[2], name


def test_the_reference_is_the_cheaper_of_the_local_two() -> None:
    world = solved({**COARSE, "horizon": 2.0, "guess": 3.0})
    motions = results(world).motions
    best = side_by_side.optimal_motion(params(world), motions)
    assert best is motions["direct"]
    assert motions["pontryagin"].cost > 4.0 * motions["direct"].cost
    agreed = results(solved(COARSE)).motions
    assert side_by_side.optimal_motion(FamiliesParams(), agreed) is agreed["pontryagin"]
    nothing = {name: replace(motion, converged=False) for name, motion in motions.items()}
    assert side_by_side.optimal_motion(params(world), nothing) is None


def test_tables_are_seen_to_grow() -> None:
    from labs.engine.catalog import find_lab
    from labs.engine.run import World

    world = World(find_lab("families"), COARSE)
    seen = []
    while world.solving:
        world.iterate()
        assert world.latest is not None
        seen.append((world.latest.progress or 0.0, results(world).values["hjb"].max()))
    progress = [part for part, _ in seen]
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    assert len({largest for _, largest in seen}) > 4


# The world's clock ----------------------------------------------------------------------------


def test_motions_are_played_rest_and_start_over() -> None:
    world = solved({**COARSE, "horizon": 0.5})
    scene = NullScene()
    for _ in range(round((0.5 + REST_DURATION) / Families.period)):
        world.advance()
    assert isinstance(world.state, FamiliesState)
    assert world.state.clock > 0
    world.lab.draw(scene, world.params, world.state)
    assert {f"state of {name}" for name in side_by_side.FAMILY_NAMES} <= set(scene.names)
    now = world.lab.fields(world.params, world.state)
    np.testing.assert_array_equal(now["now_t"], 0.5)
    world.advance()
    assert world.state.clock == 0
    assert world.t == pytest.approx(1.31)


@pytest.mark.parametrize("system", WINDOWS)
def test_the_hand_finds_the_state_under_it(system: str) -> None:
    of = FamiliesParams(system=system)
    for X in np.array([[0.3, -1.0], [1.2, 2.0], [-0.9, 0.0]]):
        x, y, z = floor_points(of, X)
        np.testing.assert_allclose(state_at(of, (x, y, z + 0.3)), X, atol=1e-9)
    x, y, z = floor_points(of, np.array([1.0, -0.5]))
    wanted = {"angle" if system == "pendulum" else "place": 1.0, "velocity": -0.5}
    assert Families().edit(of, "start", (x, y, z)) == wanted
    assert Families().edit(of, "other", (x, y, z)) == {}


def test_the_surface_hides_no_path_from_who_comes_in() -> None:
    world = solved(COARSE)
    surface = CostToGoSurface.of(params(world), results(world))
    eye = np.array(LAYOUTS["pendulum"].camera[0])
    ends = [surface.on_surface(motion.X) for motion in results(world).motions.values()]
    ways = np.linspace(np.concatenate(ends), eye, 400)[1:-1].reshape(-1, 3)
    lower, upper = LAYOUTS["pendulum"].window
    states = np.array([state_at(params(world), (x, y, z)) for x, y, z in ways])
    over = ((states > lower) & (states < upper)).all(axis=1)
    assert over.sum() > 1000
    assert (ways[over, 2] > (surface.on_surface(states[over]) - ABOVE)[:, 2]).all()
