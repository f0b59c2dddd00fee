"""The world of the lab mpc-feasibility, and its sets."""

import numpy as np
import pytest

from labs.algorithms.polygons import area
from labs.lab import Inputs
from labs.optimal_control.mpc_feasibility.lab import MpcFeasibility, MpcFeasibilityState
from labs.optimal_control.mpc_feasibility.params import MpcFeasibilityParams
from labs.optimal_control.mpc_feasibility.picture import plane_of
from labs.optimal_control.mpc_feasibility.problem import feasibility, feasibility_system
from labs.optimal_control.mpc_feasibility.sets import compute_sets, subtract_polyhedron

LAB = MpcFeasibility()
SYSTEMS = ("cart", "unstable", "joint")
TERMINALS = ("none", "origin", "still", "admissible", "invariant")


def begun(params: MpcFeasibilityParams) -> MpcFeasibilityState:
    return LAB.init(params, np.random.default_rng(0))


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("terminal", TERMINALS)
def test_there_is_a_plan_exactly_in_the_first_feasible_set(system: str, terminal: str) -> None:
    base = MpcFeasibilityParams(system=system, terminal=terminal, goal=0.1, horizon=4.0)
    sets = compute_sets(base.setup)
    assert sets.rows is not None
    starts = np.random.default_rng(3).uniform(-1.05, 1.05, (25, 2)).round(2)
    told = []
    for x1, x2 in starts:
        state = begun(base.change({"x1": float(x1), "x2": float(x2)}))
        told.append(state.first_failed_period < 0)
    assert sets.rows[0].contains(starts).tolist() == told
    safe = terminal in ("invariant", "admissible", "origin")
    assert (sets.leak_share == pytest.approx(0.0, abs=1e-9)) or not safe
    assert (sets.excess <= 1e-6) == (safe or (system, terminal) == ("cart", "still"))


@pytest.mark.parametrize("block", ["2", "4"])
@pytest.mark.parametrize("terminal", ["none", "origin", "admissible"])
def test_so_is_there_one_of_blocks(terminal: str, block: str) -> None:
    """A plan over six periods, whose controls are held: so it is, and there are fewer of them."""
    base = MpcFeasibilityParams(
        system="joint", terminal=terminal, goal=0.1, horizon=6.0, block=block, u_max=1.2, p_max=0.6
    )
    sets, free = compute_sets(base.setup), compute_sets(base.change({"block": "1"}).setup)
    assert sets.rows is not None
    corners = sets.rows[0]
    starts = np.random.default_rng(3).uniform(-0.7, 0.7, (40, 2)).round(2)
    told = []
    for x1, x2 in starts:
        state = begun(base.change({"x1": float(x1), "x2": float(x2)}))
        told.append(state.first_failed_period < 0)
        if told[-1]:
            plan = state.controller.plan
            assert plan is not None
            held = np.repeat(plan.U[:: int(block)], int(block), axis=0)[:6]
            np.testing.assert_array_equal(plan.U, held)
    assert corners.contains(starts).tolist() == told
    assert sets.feasible_share <= free.feasible_share + 1e-9
    assert len(base.setup.holds) == {"2": 3, "4": 2}[block]


def test_softened_plans_have_no_blocks() -> None:
    params = MpcFeasibilityParams(fallback="soft", block="4")
    assert params.setup.holds == (1,) * 5


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_pieces_beyond_a_set_and_what_is_within_make_the_whole(system: str) -> None:
    params = MpcFeasibilityParams(system=system, u_max=0.8, horizon=3.0)
    sets, largest = compute_sets(params.setup), compute_sets(params.setup).rows
    assert largest is not None
    x_max = np.array(feasibility_system(system).x_max)
    whole, scale = area(sets.chain[0]), float(x_max.prod())
    pieces = subtract_polyhedron(sets.chain[0] / x_max, largest[1])
    outside = sum(area(piece) for piece in pieces) * scale
    assert outside == pytest.approx(sets.dead_end_share * whole, rel=1e-9)
    assert outside + sets.feasible_share * area(sets.invariant) == pytest.approx(whole, rel=1e-9)
    assert not any(largest[1].contains(piece.mean(axis=0)) for piece in pieces)


@pytest.mark.parametrize("system", SYSTEMS)
def test_a_dragged_ball_is_where_the_run_begins(system: str) -> None:
    params = MpcFeasibilityParams(system=system)
    own, at = feasibility_system(system), np.array([0.3, -0.4])
    x = own.x_eq + at * own.x_max
    point = tuple(float(c) for c in plane_of(own).place(x))
    assert len(point) == 3
    changes = LAB.edit(params, "state", point)
    assert changes == pytest.approx({"x1": 0.3, "x2": -0.4})
    assert own.x_eq + begun(params.change(changes)).z == pytest.approx(x)
    goal = LAB.edit(params, "goal", point)
    assert goal == pytest.approx({"goal": 0.3})
    rest = feasibility(params.change(goal).setup).goal
    assert own.x_eq + rest == pytest.approx([x[0], 0.0])


def test_what_acts_without_a_plan_is_what_was_chosen() -> None:
    """In the dead end: the rest of the plan before, or the brake at once."""
    controls = {}
    for fallback in ("tail", "brake"):
        params = MpcFeasibilityParams(u_max=0.5, x1=0.62, x2=0.72, fallback=fallback)
        state = begun(params)
        assert state.first_failed_period < 0
        planned = []
        while state.first_failed_period < 0:
            plan = state.controller.plan
            assert plan is not None
            planned = [float(u) for u in plan.U[1:, 0]]
            for _ in range(5):
                state = LAB.step(params, Inputs(), state)
        controls[fallback] = float(state.controller.u[0])
        if fallback == "tail":
            assert controls["tail"] == planned[0]
            assert "goes on" in state.controller.status
    assert controls["brake"] == -0.5


def test_softened_limits_change_nothing_where_there_is_a_plan() -> None:
    hard, soft = (
        begun(MpcFeasibilityParams(u_max=0.5, x1=0.5, x2=0.6, fallback=fallback))
        for fallback in ("tail", "soft")
    )
    assert soft.first_failed_period < 0
    assert soft.controller.u == pytest.approx(hard.controller.u, abs=1e-7)


def test_a_goal_outside_the_limits_has_no_admissible_set_and_says_so() -> None:
    params = MpcFeasibilityParams(goal=1.0, p_max=0.9, terminal="admissible")
    state = begun(params)
    assert state.first_failed_period == 0
    assert "no admissible set" in LAB.notes(params, state)["planner"]
    snapshots = [s for s in LAB.solve(params, state) if s is not None]
    assert "no admissible set" in snapshots[-1].done
