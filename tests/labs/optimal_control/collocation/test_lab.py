"""The lab collocation: what it keeps, and what it starts from."""

import numpy as np
import pytest

from labs.algorithms.collocation_schemes import SCHEMES
from labs.engine.catalog import find_lab
from labs.engine.run import World
from labs.optimal_control.collocation.structure import MAX_CELLS, cell_starts
from labs.scene import NullScene
from tests.labs.optimal_control.collocation.simulation import (
    Settings,
    solve,
    solved,
    state,
    stop_reason,
)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_motion_in_pieces_joins_by_every_rule(scheme: str) -> None:
    world = World(find_lab("collocation"), {"scheme": scheme, "steps": 20.0})
    motion = state(world).motion
    pieces = 40 if scheme == "hermite-simpson" else 20
    assert motion.gaps.shape == (pieces, 2)
    gaps = state(world).history.gaps[0]
    np.testing.assert_allclose(np.linalg.norm(motion.gaps, axis=1), gaps)
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert {"piece 20", "start 20", "velocity gaps"} <= set(scene.names)
    solve(world)
    motion = state(world).motion
    assert np.abs(motion.gaps).max() < 1e-6
    np.testing.assert_allclose(motion.X[-1], [np.pi, 0.0], atol=1e-8)
    scene = NullScene()
    world.lab.draw(scene, world.params, world.state)
    assert "piece 1" in scene.names
    assert not {"piece 2", "velocity gaps"} & set(scene.names)


def test_costates_see_limits_of_the_state() -> None:
    """Where a velocity's bound is active, p_v jumps by its multiplier."""
    limited: Settings = {
        "speed_limited": True,
        "speed_limit": 3.0,
        "steps": 60.0,
        "guess": "controls",
    }
    world = solved(limited)
    assert stop_reason(world).startswith("Converged"), stop_reason(world)
    s = state(world)
    assert np.abs(s.motion.X[:, 1]).max() == pytest.approx(3.0, abs=1e-8)
    found = s.costates
    between = 0.5 * (found.costate[1:] + found.costate[:-1])
    off = np.abs(found.multipliers - between).max(axis=0) / np.abs(between).max(axis=0)
    assert off.max() < 0.15


WEAK: Settings = {"limited": True, "limit": 0.3, "horizon": 3.0, "guess": "controls"}


def test_a_limited_position_is_kept_and_costs() -> None:
    """A weak motor swings back first: less far than it would."""
    free, held = solved(WEAK), solved({**WEAK, "position_limited": True, "position_margin": 1.5})
    assert stop_reason(held).startswith("Converged"), stop_reason(held)
    assert state(free).motion.X[:, 0].min() < -1.6
    assert state(held).motion.X[:, 0].min() == pytest.approx(-1.5, abs=1e-8)
    assert state(held).history.cost[-1] > state(free).history.cost[-1]


def test_a_change_is_solved_from_the_present_solution() -> None:
    cold = solved({"horizon": 1.9, "start": "cold"})
    world = solved({})
    world.change({"horizon": 1.9})
    assert solve(world) < state(cold).history.iterations
    costs = [state(w).history.cost[-1] for w in (world, cold)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-6)


def test_a_solve_that_ran_out_of_iterations_goes_on() -> None:
    world = solved({"iterations": 3.0})
    assert state(world).failed
    violation = state(world).history.violation[-1]
    world.change({"iterations": 100.0})
    solve(world)
    assert stop_reason(world).startswith("Converged")
    assert state(world).history.violation[0] == violation


def test_a_large_matrix_is_shown_in_blocks() -> None:
    world = solved({"system": "cart-pole", "steps": 60.0})
    structure = state(world).structure
    assert max(structure.jacobian.shape) <= MAX_CELLS < structure.variables
    shown = cell_starts(structure.jacobian.shape[1], structure.variables)
    assert shown[0] == 1.0
    assert shown[-1] <= structure.variables


def test_what_is_played_ends_where_the_robot_is() -> None:
    world = solved({"payload": 0.2, "steps": 10.0})
    for _ in range(150):
        world.advance()
    played = world.lab.fields(world.params, world.state)["played_q"]
    assert played.shape == (151, 2)
    np.testing.assert_array_equal(played[-1], state(world).playback.x[:, 0])
    assert np.abs(np.diff(played, axis=0)).max() < 0.2, "no jump to the plan"
